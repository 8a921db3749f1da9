"""The pixels of a photo that tell its light, and how well lights explain them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from colonnade.common import fixed_order
from colonnade.common.errors import UserError
from colonnade.common.srgb import srgb_from_linear
from colonnade.common.types import Floats
from colonnade.environment.lights import RoomLights, irradiance, light_box, world_surface
from colonnade.environment.model import Environment

#: Pixels of the photo that the fit uses, about.
_SAMPLES = 2500
#: Residuals beyond this, in sRGB from 0 to 1, count as outliers.
OUTLIER = 0.1
#: Channels of the photo are used from and up to these values; the fit ignores lamps and black.
_PHOTO_RANGE = (2, 250)
_MIN_ALBEDO = 0.01


@dataclass(frozen=True)
class Samples:
    """The pixels that the fit uses.

    Attributes:
        points, normals: World space, float64 [n, 3].
        albedo: Linear, float64 [n, 3].
        photo: sRGB, 0 to 1, float64 [n, 3].
        usable: The channel tells the light, bool [n, 3].
        low, high: Corners of the box that may hold lights, world space, float64 [3].
        surround: Ambient light of each sample as a factor of the mean, float64 [n, 3].
    """

    points: Floats
    normals: Floats
    albedo: Floats
    photo: Floats
    usable: NDArray[np.bool_]
    low: Floats
    high: Floats
    surround: Floats

    def colours(self, lights: RoomLights) -> Floats:
        """The colours of the samples under lights, linear, float64 [n, 3]."""
        light = irradiance(self.points, self.normals, replace(lights, ambient=np.zeros(3)))
        return np.asarray(self.albedo * (light + lights.ambient * self.surround))


def samples_of(environment: Environment) -> Samples:
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
    return Samples(points, normals, albedo, encoded / 255.0, usable, *light_box(environment), np.ones_like(points))


def residuals_of(samples: Samples, lights: RoomLights) -> Floats:
    """Differences from the photo, sRGB, float64 [n, 3]."""
    return np.asarray(np.where(samples.usable, srgb_from_linear(samples.colours(lights)) - samples.photo, 0.0))


def weights_of(samples: Samples, lights: RoomLights) -> Floats:
    """Weights of linear differences from the photo, float64 [n, 3]: of soft-L1, and the slope of sRGB."""
    relative = residuals_of(samples, lights) / OUTLIER
    return np.asarray(slope_of(samples, samples.colours(lights)) / np.sqrt(np.sqrt(1 + relative**2)))


def slope_of(samples: Samples, model: Floats) -> Floats:
    """Derivative of sRGB at linear colours, 0 for unused channels, float64 [n, 3]; finite at 0."""
    slope = np.where(model > 0.0031308, 1.055 / 2.4 / fixed_order.power(model.clip(min=0.0031308), 1 - 1 / 2.4), 12.92)
    return np.asarray(np.where(samples.usable, slope, 0.0))


def cost_of(samples: Samples, lights: RoomLights) -> float:
    """The robust cost that `_refined` minimises."""
    relative = residuals_of(samples, lights) / OUTLIER
    return float((np.sqrt(1 + relative**2) - 1).sum())
