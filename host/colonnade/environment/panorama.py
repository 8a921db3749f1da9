"""Panoramas: radiance by direction around a point, from an equirectangular picture.

A row is a height, from straight up to straight down. A column is an azimuth. The middle of the picture looks along
world -z, and a quarter of its width further right along +x.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from colonnade.common.types import Floats
from colonnade.environment.light_cube import LightCube

#: A pixel that is so near to the brightest one may be cut off; share of all directions from which on they are.
_CUT, _CUT_OFF = 0.99, 0.001


@dataclass(frozen=True)
class Panorama:
    """Radiance by direction.

    Attributes:
        radiance: Linear, float64 [height, width, 3].
        yaw: Rotation about world y, degrees; counter-clockwise as seen from above, as an object's turn.
    """

    radiance: Floats
    yaw: float = 0.0

    def directions(self) -> Floats:
        """Unit directions through the middles of the pixels, world space, float64 [height, width, 3]."""
        height, width = self.radiance.shape[:2]
        polar = (np.arange(height)[:, None] + 0.5) * (np.pi / height)
        azimuth = (np.arange(width) + 0.5) * (2 * np.pi / width) - np.pi - np.radians(self.yaw)
        across = np.sin(polar)
        up = np.broadcast_to(np.cos(polar), (height, width))
        return np.stack([across * np.sin(azimuth), up, -across * np.cos(azimuth)], axis=2)

    def solid_angles(self) -> Floats:
        """Solid angle of each pixel, float64 [height, 1]; all together 4π."""
        return solid_angles(*self.radiance.shape[:2])

    def at(self, directions: Floats) -> Floats:
        """Radiance from directions of any length, world space, float64 [n, 3] each: of the nearest pixel."""
        height, width = self.radiance.shape[:2]
        x, y, z = directions.T
        row = np.arctan2(np.hypot(x, z), y) * (height / np.pi)
        column = (np.arctan2(x, -z) + np.radians(self.yaw)) * (width / (2 * np.pi)) + width / 2
        return np.asarray(
            self.radiance[np.clip(row, 0, height - 1).astype(np.intp), np.floor(column).astype(np.intp) % width]
        )

    def mean(self) -> Floats:
        """The mean over all directions, float64 [3]."""
        return np.asarray((self.radiance * self.solid_angles()[..., None]).sum(axis=(0, 1)) / (4 * np.pi))

    def on_ground(self) -> Floats:
        """What level ground of albedo 1 shows under it, float64 [3]."""
        weights = (self.solid_angles() * self.directions()[..., 1].clip(min=0.0))[..., None]
        return np.asarray((self.radiance * weights).sum(axis=(0, 1)) / weights.sum())

    @property
    def is_cut_off(self) -> bool:
        """Whether its brightest light is a limit that a part of all directions has reached, as in 8-bit pictures."""
        brightest = self.radiance.max(axis=2)
        angles = np.broadcast_to(self.solid_angles(), brightest.shape)
        return bool(angles[brightest >= _CUT * brightest.max()].sum() > _CUT_OFF * 4 * np.pi)

    def cube(self, size: int) -> LightCube:
        """The cube of these directions, of at most 32 texels along an edge, each the mean of the pixels in it."""
        texel = LightCube(np.zeros((6, size, size, 3))).texel_of(self.directions().reshape(-1, 3))
        weights = np.broadcast_to(self.solid_angles(), self.radiance.shape[:2]).ravel()
        light = self.radiance.reshape(-1, 3) * weights[:, None]
        count = 6 * size * size
        sums = np.stack([np.bincount(texel, light[:, channel], count) for channel in range(3)], axis=1)
        return LightCube((sums / np.bincount(texel, weights, count)[:, None]).reshape(6, size, size, 3))

    def scaled(self, exposure: float) -> Panorama:
        """The panorama with its radiance times a factor."""
        return replace(self, radiance=self.radiance * exposure)


def solid_angles(height: int, width: int) -> Floats:
    """Solid angle of each pixel of a panorama of this size, float64 [height, 1]; all together 4π."""
    edges = np.cos(np.arange(height + 1) * (np.pi / height))
    return np.asarray((edges[:-1] - edges[1:])[:, None] * (2 * np.pi / width))
