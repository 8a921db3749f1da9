"""Fits ambient light and point lights to a room's photo, by the device's own light rules.

The model is photo = albedo * (ambient + sum of intensity * falloff * max(0, n.l)), without shadows. Shadows,
highlights and lamps in the photo are outliers of a robust fit in sRGB. Everything is deterministic.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, nnls

from colonnade.common.errors import UserError
from colonnade.common.image_io import decode_srgb, encode_srgb
from colonnade.common.srgb import linear_from_srgb, srgb_from_linear
from colonnade.common.types import Floats
from colonnade.environment.lights import RoomLight, RoomLights, exposure, irradiance, world_surface
from colonnade.environment.model import Environment
from colonnade.quality.image_metrics import psnr

#: Default number of point lights.
DEFAULT_LIGHTS = 2
#: Most point lights of a fit.
MAX_LIGHTS = 4
#: Pixels of the photo that the fit uses, about.
_SAMPLES = 2500
#: Residuals beyond this, in sRGB from 0 to 1, count as outliers.
_OUTLIER = 0.1
#: Channels of the photo are used from and up to these values; the fit ignores lamps and black.
_PHOTO_RANGE = (2, 250)
_MIN_ALBEDO = 0.01
#: Positions tried along x, y and z, and the distances of unit intensity, metres.
_GRID = (7, 5, 7)
_FALLOFFS = (None, 1.0, 2.0)
#: Distance between lights and the box of what the camera sees, metres, at most; the camera is part of the box.
_MARGIN = np.array([1.0, 0.5, 1.5])
_MIN_HEIGHT = 0.3
#: Refined starts for each further light.
_STARTS = 4
_EVALUATIONS = 50
#: Step of numeric derivatives, metres.
_STEP = 1e-4
#: Least ambient light, as a share of the best ambient light without point lights: shadows that are drawn are not darker
#: than those of a room whose walls reflect light.
_AMBIENT_SHARE = 0.5
#: A further light has to lower the robust cost to this share.
_GAIN = 0.97
#: Limits of an intensity (that of a scene), and of a fitted falloff.
_MAX_INTENSITY = 15.0
_FALLOFF_RANGE = (0.5, 4.0)


@dataclass(frozen=True)
class Samples:
    """The pixels that the fit uses.

    Attributes:
        points, normals: World space, float64 [n, 3].
        albedo: Linear, float64 [n, 3].
        photo: sRGB, 0 to 1, float64 [n, 3].
        usable: The channel tells the light, bool [n, 3].
        low, high: Corners of the box that may hold lights, world space, float64 [3].
    """

    points: Floats
    normals: Floats
    albedo: Floats
    photo: Floats
    usable: NDArray[np.bool_]
    low: Floats
    high: Floats


@dataclass(frozen=True)
class LightFit:
    """Fitted lights and their residuals.

    Attributes:
        lights: In world space.
        psnr: Of the relit room against its photo, 8-bit sRGB, decibels.
        ambient_psnr: The same of the best ambient light alone.
    """

    lights: RoomLights
    psnr: float
    ambient_psnr: float


def fit_lights(environment: Environment, count: int = DEFAULT_LIGHTS) -> LightFit:
    """Fit ambient light and at most ``count`` point lights to a room's photo.

    A light that does not improve the fit is left out.

    Raises:
        UserError: The room has no photo, or too few pixels are neither black nor saturated.
    """
    samples = _samples(environment)
    ambient = best = _refined(samples, RoomLights(np.full(3, 0.5)))
    floor = _AMBIENT_SHARE * ambient.ambient
    for _ in range(count):
        starts = _starts(samples, best, _candidates(samples))
        refined = [_refined(samples, start, floor) for start in starts]
        better = min(refined, key=lambda lights: _cost(samples, lights))
        if not _cost(samples, better) <= _GAIN * _cost(samples, best):
            break
        best = better
    rounded = _rounded(best)
    return LightFit(rounded, relit_psnr(environment, rounded), relit_psnr(environment, ambient))


def relit(environment: Environment, lights: RoomLights) -> Floats:
    """The room under lights, without shadows, linear, 0 to 1, float64 [height, width, 3]."""
    return np.asarray((environment.albedo * irradiance(*world_surface(environment), lights)).clip(max=1.0))


def relit_psnr(environment: Environment, lights: RoomLights) -> float:
    """PSNR of the relit room against its photo, 8-bit sRGB, decibels."""
    assert environment.photo is not None
    return psnr(environment.photo, encode_srgb(relit(environment, lights)))


def comparison_picture(environment: Environment, lights: RoomLights) -> Floats:
    """Photo, relit room and their difference, four times amplified: linear, float64 [height, 3 · width, 3]."""
    assert environment.photo is not None
    fit = relit(environment, lights)
    difference = np.abs(environment.photo / 255.0 - encode_srgb(fit) / 255.0) * 4.0
    return np.concatenate([decode_srgb(environment.photo), fit, linear_from_srgb(difference.clip(max=1.0))], axis=1)


def _samples(environment: Environment) -> Samples:
    """The pixels of a regular grid whose colours can tell the light."""
    if environment.photo is None:
        raise UserError(f"room {environment.name} has no photo.png or render.png: there is nothing to fit lights to")
    step = max(1, round(float(np.sqrt(environment.width * environment.height / _SAMPLES))))
    grid = np.s_[step // 2 :: step, step // 2 :: step]
    points, normals = (surface[grid].reshape(-1, 3) for surface in world_surface(environment))
    albedo, encoded = environment.albedo[grid].reshape(-1, 3), environment.photo[grid].reshape(-1, 3)
    usable = (encoded >= _PHOTO_RANGE[0]) & (encoded <= _PHOTO_RANGE[1]) & (albedo >= _MIN_ALBEDO)
    if np.count_nonzero(usable.all(axis=1)) < len(usable) / 20:
        raise UserError(
            f"the photo of room {environment.name} is nearly all black or saturated: lights cannot be fitted"
        )
    eye = environment.camera_to_world[:, 3]
    low = np.minimum(np.percentile(points, 2, axis=0), eye) - _MARGIN
    high = np.maximum(np.percentile(points, 98, axis=0), eye) + _MARGIN
    low[1] = np.percentile(points[:, 1], 2) + _MIN_HEIGHT
    return Samples(points, normals, albedo, encoded / 255.0, usable, low, high)


def _candidates(samples: Samples) -> Floats:
    """Positions to try, world space, in and around what the camera sees, float64 [n, 3]."""
    axes = [np.linspace(samples.low[axis], samples.high[axis], _GRID[axis]) for axis in range(3)]
    return np.array(list(itertools.product(*axes)))


def _starts(samples: Samples, lights: RoomLights, positions: Floats) -> list[RoomLights]:
    """The best starts with one more light: intensities of all lights by non-negative least squares."""
    model = samples.albedo * irradiance(samples.points, samples.normals, lights)
    relative = _residuals(samples, lights) / _OUTLIER
    # Weights of soft-L1, and the slope that makes linear differences those of the picture
    weights = _slope(samples, model) * (1 + relative**2) ** -0.25
    known = [np.ones(len(samples.points))]
    known += [exposure(samples.points, samples.normals, light.position, light.falloff) for light in lights.lights]
    scored = []
    for position, falloff in itertools.product(positions, _FALLOFFS):
        columns = np.stack([*known, exposure(samples.points, samples.normals, position, falloff)], axis=1)
        intensities, cost = _non_negative(samples, weights, columns)
        new = RoomLight(position, intensities[-1], falloff)
        old = [
            RoomLight(light.position, colour, light.falloff)
            for light, colour in zip(lights.lights, intensities[1:-1], strict=True)
        ]
        scored.append((cost, RoomLights(intensities[0], (*old, new))))
    scored.sort(key=lambda pair: pair[0])
    chosen: list[RoomLights] = []
    for _, start in scored:
        new = start.lights[-1]
        if all(
            np.linalg.norm(new.position - other.lights[-1].position) > 1.0 or new.falloff != other.lights[-1].falloff
            for other in chosen
        ):
            chosen.append(start)
        if len(chosen) == _STARTS:
            break
    return chosen


def _non_negative(samples: Samples, weights: Floats, columns: Floats) -> tuple[Floats, float]:
    """Intensities >= 0 of each channel, float64 [k, 3], for columns of exposure [n, k], and the weighted cost."""
    scaled = weights * samples.albedo
    target = weights * linear_from_srgb(samples.photo)
    intensities, cost = np.zeros((columns.shape[1], 3)), 0.0
    for channel in range(3):
        system = columns * scaled[:, channel, None]
        # The same problem with k rows: |R x - Q'b|² differs from |A x - b|² by a constant.
        gram, moment = system.T @ system, system.T @ target[:, channel]
        gram = gram + np.eye(len(gram)) * (1e-9 * np.trace(gram) + 1e-12)
        upper = np.linalg.cholesky(gram).T
        solution, _ = nnls(upper, np.linalg.solve(upper.T, moment))
        intensities[:, channel] = solution.clip(max=_MAX_INTENSITY)
        cost += float(target[:, channel] @ target[:, channel] - 2 * moment @ solution + solution @ gram @ solution)
    return intensities, cost


def _residuals(samples: Samples, lights: RoomLights) -> Floats:
    """Differences from the photo, sRGB, float64 [n, 3]."""
    model = samples.albedo * irradiance(samples.points, samples.normals, lights)
    return np.asarray(np.where(samples.usable, srgb_from_linear(model) - samples.photo, 0.0))


def _slope(samples: Samples, model: Floats) -> Floats:
    """Derivative of sRGB at linear colours, 0 for unused channels, float64 [n, 3]; finite at 0."""
    slope = np.where(model > 0.0031308, 1.055 / 2.4 * model.clip(min=0.0031308) ** (1 / 2.4 - 1), 12.92)
    return np.asarray(np.where(samples.usable, slope, 0.0))


def _cost(samples: Samples, lights: RoomLights) -> float:
    """The robust cost that `_refined` minimises."""
    relative = _residuals(samples, lights) / _OUTLIER
    return float((np.sqrt(1 + relative**2) - 1).sum())


def _refined(samples: Samples, start: RoomLights, floor: Floats | None = None) -> RoomLights:
    """Refine all values of some lights by robust least squares; ``floor`` is the least ambient light."""
    layout = _Layout(tuple(light.falloff is not None for light in start.lights))
    low, high = [*(np.zeros(3) if floor is None else floor)], [_MAX_INTENSITY] * 3
    for light in start.lights:
        low += [*samples.low, 0.0, 0.0, 0.0]
        high += [*samples.high, *[_MAX_INTENSITY] * 3]
        if light.falloff is not None:
            low.append(_FALLOFF_RANGE[0])
            high.append(_FALLOFF_RANGE[1])
    begin = np.clip(layout.pack(start), np.array(low) + 1e-6, np.array(high) - 1e-6)
    found = least_squares(
        lambda values: _residuals(samples, layout.unpack(values)).ravel(),
        begin,
        jac=lambda values: _jacobian(samples, layout.unpack(values)),
        bounds=(low, high),
        loss="soft_l1",
        f_scale=_OUTLIER,
        x_scale=np.maximum(np.abs(begin), 0.1),
        max_nfev=_EVALUATIONS,
    )
    return layout.unpack(found.x)


@dataclass(frozen=True)
class _Layout:
    """Lights as a vector: ambient, then position, colour and falloff (where `has_falloff`) of each light."""

    has_falloff: tuple[bool, ...]

    def pack(self, lights: RoomLights) -> Floats:
        parts = [lights.ambient]
        for light in lights.lights:
            parts += [light.position, light.colour, np.array([] if light.falloff is None else [light.falloff])]
        return np.concatenate(parts)

    def unpack(self, values: Floats) -> RoomLights:
        lights, at = [], 3
        for has_falloff in self.has_falloff:
            falloff = float(values[at + 6]) if has_falloff else None
            lights.append(RoomLight(values[at : at + 3], values[at + 3 : at + 6], falloff))
            at += 7 if has_falloff else 6
        return RoomLights(values[:3], tuple(lights))


def _jacobian(samples: Samples, lights: RoomLights) -> Floats:
    """Derivatives of `_residuals` in the order of `_Layout`, float64 [3 n, values]; of positions by differences."""
    scaled = _slope(samples, samples.albedo * irradiance(samples.points, samples.normals, lights)) * samples.albedo
    channels = scaled[:, :, None] * np.eye(3)  # [n, 3, 3]
    columns = [channels]
    for light in lights.lights:

        def at(position: Floats, falloff: float | None) -> Floats:
            return exposure(samples.points, samples.normals, position, falloff)

        here, coloured = at(light.position, light.falloff), scaled * light.colour
        steps = [at(light.position + _STEP * axis, light.falloff) - here for axis in np.eye(3)]
        columns.append(np.stack([coloured * step[:, None] / _STEP for step in steps], axis=2))
        columns.append(channels * here[:, None, None])
        if light.falloff is not None:
            change = (at(light.position, light.falloff + _STEP) - here) / _STEP
            columns.append((coloured * change[:, None])[:, :, None])
    return np.concatenate(columns, axis=2).reshape(-1, sum(column.shape[2] for column in columns))


def _rounded(lights: RoomLights) -> RoomLights:
    """The lights as a scene file states them: millimetres, and four digits of intensity."""
    return RoomLights(
        lights.ambient.round(4),
        tuple(
            RoomLight(
                light.position.round(3),
                light.colour.round(4),
                None if light.falloff is None else round(light.falloff, 3),
            )
            for light in lights.lights
        ),
    )
