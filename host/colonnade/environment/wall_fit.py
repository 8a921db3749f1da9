"""The fit of the light of walls around a room, beside point lights."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from colonnade.common import fixed_order
from colonnade.common.srgb import linear_from_srgb
from colonnade.common.types import Floats
from colonnade.environment.light_samples import Samples, weights_of
from colonnade.environment.lights import MIN_HEIGHT, RoomLights, irradiance
from colonnade.environment.photo_colours import MAX_INTENSITY
from colonnade.environment.surround import PATCHES, Surround, non_negative_least_squares, wall_exposures

#: Weight that holds the light of each patch of the walls to the mean ambient light, against all samples' weight.
_HELD = 0.1
#: Repetitions of the fit of the walls before there are point lights, and of the fit of an ambient light.
ALTERNATIONS, _REWEIGHTINGS = 3, 10


@dataclass(frozen=True)
class Walls:
    """The walls of a box around the samples, while they are fitted.

    Attributes:
        low, high: Corners of the box, float64 [3].
        exposures: Of the samples, float64 [n, PATCHES].
        radiance: Linear, float64 [PATCHES, 3].
    """

    low: Floats
    high: Floats
    exposures: Floats
    radiance: Floats

    @staticmethod
    def around(samples: Samples) -> Walls:
        """Dark walls around the box of the lights, down to the floor."""
        low = samples.low - [0.0, MIN_HEIGHT, 0.0]
        exposures = wall_exposures(samples.points, samples.normals, low, samples.high)
        return Walls(low, samples.high, exposures, np.zeros((PATCHES, 3)))

    def fitted(self, samples: Samples, lights: RoomLights) -> tuple[Samples, RoomLights, Walls]:
        """Fit the walls beside point lights. They replace the ambient light, and are as bright as it where unsure."""
        weights, radiance = weights_of(samples, lights), np.empty((PATCHES, 3))
        points = irradiance(samples.points, samples.normals, replace(lights, ambient=np.zeros(3)))
        missing = linear_from_srgb(samples.photo) - samples.albedo * points
        for channel in range(3):
            scale = (weights * samples.albedo)[:, channel]
            columns = self.exposures * scale[:, None]
            held = _HELD**2 * fixed_order.dot(scale, scale) / PATCHES
            gram = fixed_order.product(columns.T, columns) + held * np.eye(PATCHES)
            target = (weights * missing)[:, channel, None]
            moment = fixed_order.product(columns.T, target)[:, 0] + held * lights.ambient[channel]
            radiance[:, channel] = non_negative_least_squares(gram, moment)
        light = fixed_order.product(self.exposures, radiance)
        mean = light.mean(axis=0).clip(min=1e-9)
        return (
            replace(samples, surround=light / mean),
            replace(lights, ambient=mean),
            replace(self, radiance=radiance),
        )

    def surround(self, ambient: Floats) -> Surround:
        """The walls with the mean ambient light of the samples."""
        mean = fixed_order.product(self.exposures, self.radiance).mean(axis=0).clip(min=1e-9)
        return Surround(self.low, self.high, (self.radiance * ambient / mean).round(4))


def with_best_ambient(samples: Samples, lights: RoomLights) -> RoomLights:
    """The lights with the ambient light that fits best beside the point lights."""
    points = samples.albedo * irradiance(samples.points, samples.normals, replace(lights, ambient=np.zeros(3)))
    missing = linear_from_srgb(samples.photo) - points
    for _ in range(_REWEIGHTINGS):
        squares = weights_of(samples, lights) ** 2
        best = (squares * samples.albedo * missing).sum(axis=0) / (squares * samples.albedo**2).sum(axis=0).clip(1e-12)
        lights = replace(lights, ambient=best.clip(0.0, MAX_INTENSITY))
    return lights
