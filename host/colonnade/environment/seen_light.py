"""The light of a room around a point, in the directions that its picture shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.common import fixed_order
from colonnade.common.image_io import decode_srgb
from colonnade.common.types import Floats
from colonnade.environment.light_cube import LightCube
from colonnade.environment.lights import RoomLights, irradiance, world_surface
from colonnade.environment.model import Environment

#: Texels along the edge of a face while the light is collected.
FINE = 32
#: Pixels of a texel that are farther than its nearest one by this factor are behind it.
_BEHIND = 1.1


@dataclass(frozen=True)
class SeenLight:
    """Light by the texels of a cube of `FINE` texels along an edge, in the order of `LightCube.texel_of`.

    Attributes:
        radiance: Linear, float64 [texels, 3]; 0 where the picture shows nothing.
        is_seen: The picture shows something, bool [texels].
        is_bright: It shows pixels that are as bright as a photo can be, bool [texels].
        distance: Of the nearest surface, metres, float64 [texels]; infinite where the picture shows nothing.
    """

    radiance: Floats
    is_seen: NDArray[np.bool_]
    is_bright: NDArray[np.bool_]
    distance: Floats

    @staticmethod
    def of(environment: Environment, point: Floats, lights: RoomLights | None = None) -> SeenLight:
        """The light of a room's photo, or of its albedo under lights, around a point.

        Args:
            environment: The room.
            point: World space, float64 [3].
            lights: Of the room, without shadows; None: its photo has its light.
        """
        surface, normals = world_surface(environment)
        if lights is None:
            assert environment.photo is not None
            colours = decode_srgb(environment.photo)
        else:
            colours = (environment.albedo * irradiance(surface, normals, lights)).clip(max=1.0)
        towards = (surface - point).reshape(-1, 3)
        facing = fixed_order.dot(normals.reshape(-1, 3), towards) < 0
        towards, colours = towards[facing], colours.reshape(-1, 3)[facing]
        count = 6 * FINE * FINE
        texel = LightCube(np.zeros((6, FINE, FINE, 3))).texel_of(towards)
        distance = np.sqrt(fixed_order.dot(towards, towards))
        nearest = np.full(count, np.inf)
        np.minimum.at(nearest, texel, distance)
        is_near = distance <= _BEHIND * nearest[texel]
        texel, colours = texel[is_near], colours[is_near]
        pixels = np.bincount(texel, minlength=count)
        sums = np.stack([np.bincount(texel, colours[:, channel], count) for channel in range(3)], axis=1)
        bright = np.bincount(texel, colours.max(axis=1) >= 1.0, count) > 0
        return SeenLight(sums / np.maximum(pixels, 1)[:, None], pixels > 0, bright, nearest)
