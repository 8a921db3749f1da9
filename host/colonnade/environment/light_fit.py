"""Fits ambient light and point lights to a room's photo, by the device's own light rules.

The model is photo = albedo * (ambient + sum of intensity * falloff * max(0, n.l)), without shadows. Shadows,
highlights and lamps in the photo are outliers of a robust fit in sRGB. Everything is deterministic.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from colonnade.common import fixed_order
from colonnade.common.image_io import decode_srgb, encode_srgb
from colonnade.common.srgb import linear_from_srgb
from colonnade.common.types import Floats
from colonnade.environment.light_samples import (
    OUTLIER,
    Samples,
    cost_of,
    residuals_of,
    samples_of,
    slope_of,
    weights_of,
)
from colonnade.environment.lights import RoomLight, RoomLights, exposure, irradiance, world_surface
from colonnade.environment.model import Environment
from colonnade.environment.seen_sources import SEEN_RADIANCE, seen_sources
from colonnade.environment.surround import Surround
from colonnade.environment.wall_fit import ALTERNATIONS, Walls, with_best_ambient
from colonnade.quality.image_metrics import psnr

#: Default number of point lights.
DEFAULT_LIGHTS = 2
#: Positions tried along x, y and z, and the distances of unit intensity, metres.
_GRID = (7, 5, 7)
_FALLOFFS = (None, 1.0, 2.0)
#: Refined starts for each further light.
_STARTS = 4
_EVALUATIONS = 50
#: Damping of the refinement: the first, and that from which on it has no better step; the least share of a gain.
_FIRST_DAMPING, _LAST_DAMPING, _CONVERGED = 1e-3, 1e9, 1e-8
#: Step of numeric derivatives, metres.
_STEP = 1e-4
#: Least ambient light, as a share of the best ambient light without point lights: shadows that are drawn are not darker
#: than of a room whose walls reflect light.
_AMBIENT_SHARE = 0.5
#: A further light, or the walls, have to lower the robust cost to this share.
_GAIN = 0.97
#: Limits of an intensity (as in a scene), and of a fitted falloff.
_MAX_INTENSITY = 15.0
_FALLOFF_RANGE = (0.5, 4.0)


@dataclass(frozen=True)
class LightFit:
    """Fitted lights and their residuals.

    Attributes:
        lights: In world space.
        psnr: Of the relit room against its photo, 8-bit sRGB, decibels.
        ambient_psnr: The same of the best ambient light alone.
        surround: The light of the walls, with which the lights were fitted in place of ambient light; None: without it.
    """

    lights: RoomLights
    psnr: float
    ambient_psnr: float
    surround: Surround | None = None


def fit_lights(environment: Environment, count: int = DEFAULT_LIGHTS, walls: bool = False) -> LightFit:
    """Fit ambient light and at most ``count`` point lights to a room's photo.

    A light that does not improve the fit is left out.

    Args:
        environment: The room.
        count: Number of point lights.
        walls: Also fit the light of the walls of a box around the room: large sources do not become point lights.
            The ambient light of the result is then the best one beside the point lights. The walls are dropped if they
            do not explain the photo better.

    Raises:
        UserError: The room has no photo, or too few pixels are neither black nor saturated.
    """
    samples = samples_of(environment)
    ambient = _refined(samples, RoomLights(np.full(3, 0.5)))
    seen = tuple(seen_sources(environment)[: max(1, count - 1)])
    lights, surround, cost = _fitted(samples, ambient, seen, count, False)
    if walls:
        beside, walls_beside, beside_cost = _fitted(samples, ambient, seen, count, True)
        if beside_cost <= _GAIN * cost:
            lights, surround = beside, walls_beside
    lights = _rounded(lights)
    return LightFit(lights, relit_psnr(environment, lights), relit_psnr(environment, ambient), surround)


def _fitted(
    samples: Samples, ambient: RoomLights, seen: tuple[RoomLight, ...], count: int, walls: bool
) -> tuple[RoomLights, Surround | None, float]:
    """As `fit_lights` beside the best ambient light, from the sources seen; with the walls anyway; and the cost."""
    best, floor = ambient, _AMBIENT_SHARE * ambient.ambient
    shining = Walls.around(samples) if walls else None
    if shining is not None:
        for _ in range(ALTERNATIONS):
            samples, best, shining = shining.fitted(samples, best)
    if seen:
        best = _refined(samples, replace(best, lights=seen), floor)
    for _ in range(count - len(seen)):
        starts = _starts(samples, best, _candidates(samples))
        refined = [_refined(samples, start, floor) for start in starts]
        better = min(refined, key=lambda lights: cost_of(samples, lights))
        if not cost_of(samples, better) <= _GAIN * cost_of(samples, best):
            break
        best = better
        if shining is not None:
            samples, best, shining = shining.fitted(samples, best)
            best = _refined(samples, best, floor)
    surround, cost = None, cost_of(samples, best)
    if shining is not None:
        surround = shining.surround(best.ambient)
        best = with_best_ambient(replace(samples, surround=np.ones_like(samples.surround)), best)
    return best, surround, cost


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


def _candidates(samples: Samples) -> Floats:
    """Positions to try, world space, in and around what the camera sees, float64 [n, 3]."""
    axes = [np.linspace(samples.low[axis], samples.high[axis], _GRID[axis]) for axis in range(3)]
    return np.array(list(itertools.product(*axes)))


def _starts(samples: Samples, lights: RoomLights, positions: Floats) -> list[RoomLights]:
    """The best starts with one more light: intensities of all lights by non-negative least squares."""
    weights = weights_of(samples, lights)
    points = [exposure(samples.points, samples.normals, light.position, light.falloff) for light in lights.lights]
    known = [samples.surround, *(np.repeat(one[:, None], 3, axis=1) for one in points)]
    tried = list(itertools.product(positions, _FALLOFFS))
    new = [exposure(samples.points, samples.normals, position, falloff) for position, falloff in tried]
    intensities, costs = _non_negative(samples, weights, np.stack(known, axis=1), np.stack(new, axis=1))
    chosen: list[RoomLights] = []
    for index in np.argsort(costs, kind="stable"):
        (position, falloff), colours = tried[index], intensities[index]
        if all(
            fixed_order.dot(offset := position - other.lights[-1].position, offset) > 1.0
            or falloff != other.lights[-1].falloff
            for other in chosen
        ):
            old = [
                replace(light, colour=np.maximum(colour, SEEN_RADIANCE * light.radius**2))
                for light, colour in zip(lights.lights, colours[1:-1], strict=True)
            ]
            chosen.append(RoomLights(colours[0], (*old, RoomLight(position, colours[-1], falloff))))
        if len(chosen) == _STARTS:
            break
    return chosen


def _non_negative(samples: Samples, weights: Floats, known: Floats, new: Floats) -> tuple[Floats, Floats]:
    """Intensities >= 0 of some lights together with each of many others, and the weighted costs.

    Args:
        samples: n samples.
        weights: float64 [n, 3].
        known: Exposures by k lights, float64 [n, k, 3].
        new: Exposures by m other lights, float64 [n, m].

    Returns:
        Intensities, float64 [m, k + 1, 3], and costs up to a constant, float64 [m].
    """
    k, m = known.shape[1], new.shape[1]
    intensities, costs = np.zeros((m, k + 1, 3)), np.zeros(m)
    for channel in range(3):
        scale = (weights * samples.albedo)[:, channel, None]
        target = weights[:, channel, None] * linear_from_srgb(samples.photo[:, channel, None])
        old, added = known[:, :, channel] * scale, new * scale
        gram, moment = np.empty((m, k + 1, k + 1)), np.empty((m, k + 1))
        gram[:, :k, :k] = fixed_order.product(old.T, old)
        gram[:, :k, k] = gram[:, k, :k] = fixed_order.product(added.T, old)
        gram[:, k, k] = (added**2).sum(axis=0)
        moment[:, :k] = fixed_order.product(old.T, target)[:, 0]
        moment[:, k] = fixed_order.product(added.T, target)[:, 0]
        trace = np.trace(gram, axis1=1, axis2=2)
        gram += np.eye(k + 1) * (1e-9 * trace + 1e-12)[:, None, None]
        solution = _non_negative_solution(gram, moment)
        intensities[:, :, channel] = solution.clip(max=_MAX_INTENSITY)
        change = fixed_order.product(gram, solution[..., None])[..., 0]
        costs += fixed_order.dot(solution, change - 2 * moment)
    return intensities, costs


def _non_negative_solution(gram: Floats, moment: Floats) -> Floats:
    """Minima of x'Gx - 2 m'x with x >= 0, for G [n, k, k] and m [n, k], float64 [n, k].

    A minimum is the free minimum of some of its variables while the others are 0, so all such sets are tried.
    """
    count, k = moment.shape
    best, least = np.zeros((count, k)), np.zeros(count)
    for size in range(1, k + 1):
        for some in itertools.combinations(range(k), size):
            tried = np.zeros((count, k))
            tried[:, some] = fixed_order.solve(gram[:, some][:, :, some], moment[:, some])
            value = -fixed_order.dot(moment, tried)
            better = (tried >= 0).all(axis=1) & (value < least)
            best[better], least[better] = tried[better], value[better]
    return best


def _refined(samples: Samples, start: RoomLights, floor: Floats | None = None) -> RoomLights:
    """Refine all values of some lights by robust least squares; ``floor`` is the least ambient light.

    This is the Levenberg-Marquardt method within bounds; a library's would depend on the processor (`fixed_order`).
    """
    layout = _Layout(start.lights)
    low, high = [*(np.zeros(3) if floor is None else floor)], [_MAX_INTENSITY] * 3
    for light in start.lights:
        # The place of a source that is seen is known, and its least brightness
        seen = light.radius > 0
        low += [*(light.position if seen else samples.low), *[SEEN_RADIANCE * light.radius**2] * 3]
        high += [*(light.position if seen else samples.high), *[_MAX_INTENSITY] * 3]
        if light.falloff is not None:
            low.append(light.falloff if seen else _FALLOFF_RANGE[0])
            high.append(light.falloff if seen else _FALLOFF_RANGE[1])
    lower, upper = np.array(low), np.array(high)
    values = np.clip(layout.pack(start), lower, upper)
    cost, damping = cost_of(samples, layout.unpack(values)), _FIRST_DAMPING
    for _ in range(_EVALUATIONS):
        lights = layout.unpack(values)
        residuals, slopes = residuals_of(samples, lights).ravel(), _jacobian(samples, lights)
        # Derivatives of the soft-L1 cost: its slope is r / root, its curvature root^-3
        root = np.sqrt(1 + (residuals / OUTLIER) ** 2)
        gradient = fixed_order.product(slopes.T, residuals / root)
        normal = fixed_order.product((slopes / (root * root * root)[:, None]).T, slopes)
        held = ((values <= lower) & (gradient > 0)) | ((values >= upper) & (gradient < 0))
        free = np.flatnonzero(~held)
        normal, diagonal = normal[np.ix_(free, free)], np.diag(np.diag(normal)[free] + 1e-9)
        while damping < _LAST_DAMPING:
            tried = values.copy()
            tried[free] -= fixed_order.solve(normal + damping * diagonal, gradient[free])
            tried = np.clip(tried, lower, upper)
            new_cost = cost_of(samples, layout.unpack(tried))
            if new_cost < cost:
                break
            damping *= 4
        else:
            break
        is_last = cost - new_cost < _CONVERGED * cost
        values, cost, damping = tried, new_cost, damping / 4
        if is_last:
            break
    return layout.unpack(values)


@dataclass(frozen=True)
class _Layout:
    """Lights as a vector: ambient, then position, colour and falloff, if it has one, of each light. Radii stay."""

    lights: tuple[RoomLight, ...]

    def pack(self, lights: RoomLights) -> Floats:
        parts = [lights.ambient]
        for light in lights.lights:
            parts += [light.position, light.colour, np.array([] if light.falloff is None else [light.falloff])]
        return np.concatenate(parts)

    def unpack(self, values: Floats) -> RoomLights:
        lights, at = [], 3
        for light in self.lights:
            falloff = None if light.falloff is None else float(values[at + 6])
            lights.append(RoomLight(values[at : at + 3], values[at + 3 : at + 6], falloff, light.radius))
            at += 6 if falloff is None else 7
        return RoomLights(values[:3], tuple(lights))


def _jacobian(samples: Samples, lights: RoomLights) -> Floats:
    """Derivatives of `residuals_of` in the order of `_Layout`, float64 [3 n, values]; of positions by differences."""
    scaled = slope_of(samples, samples.colours(lights)) * samples.albedo
    channels = scaled[:, :, None] * np.eye(3)  # [n, 3, 3]
    columns = [channels * samples.surround[:, :, None]]
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
                round(light.radius, 3),
            )
            for light in lights.lights
        ),
    )
