"""The light of a room around a point, in the directions that its picture shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.common.accumulation import LUMINANCE
from colonnade.common.image_io import decode_srgb
from colonnade.common.types import Floats
from colonnade.environment.light_cube import face_directions
from colonnade.environment.lights import RoomLights, irradiance, world_surface
from colonnade.environment.model import Environment

#: Texels along the edge of a face while the light is collected.
FINE = 32


def texel_weights() -> Floats:
    """Weights of the texels by solid angle, in the order of `LightCube.texel_of`, float64 [texels]."""
    return np.broadcast_to(face_directions(FINE)[1], (6, FINE, FINE)).ravel()


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

    def beside(self, other: SeenLight) -> SeenLight:
        """This light, and another picture's in directions that this one does not show.

        The other one's exposure is matched where both show something.
        """
        both = self.is_seen & other.is_seen & ~self.is_bright & ~other.is_bright
        weights = texel_weights() * both
        total = float(weights @ (other.radiance @ LUMINANCE))
        factor = float(weights @ (self.radiance @ LUMINANCE)) / total if total > 0 else 1.0
        return SeenLight(
            np.where(self.is_seen[:, None], self.radiance, other.radiance * factor),
            self.is_seen | other.is_seen,
            np.where(self.is_seen, self.is_bright, other.is_bright),
            np.where(self.is_seen, self.distance, other.distance),
        )

    @property
    def share(self) -> float:
        """Share of all directions in which the picture shows something, 0 to 1."""
        weights = texel_weights()
        return float(weights[self.is_seen].sum() / weights.sum())

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
        from colonnade import _core

        pixels = (values.reshape(-1, 3) for values in (surface, normals, colours))
        radiance, count, is_bright, distance = _core.seen_light(*pixels, point.tolist())
        return SeenLight(radiance, count > 0, is_bright, distance)
