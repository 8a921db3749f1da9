"""Light by direction around an object: a cube map of radiance, which rays meet that leave it (docs/gather.md)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from colonnade.common import fixed_order
from colonnade.common.types import Floats

#: Texels of the device's cube along the edge of a face.
FACE = 16
#: Directions averaged along each edge of a texel.
_SUBSAMPLES = 4
#: The value 1.0 in the device's cube, and its largest value, a light's.
_ONE, _LAST = 1 << 12, (1 << 16) - 1
#: The radiance of a light in the device's cube.
MOST = _LAST / _ONE
#: Bits of a mantissa of the device's cube, and its largest exponent.
_MANTISSA, _LAST_EXPONENT = 7, 9
#: The largest radiance of a texel without a light in the device's cube.
LARGEST = ((1 << _MANTISSA) - 1 << _LAST_EXPONENT) / _ONE


@dataclass(frozen=True)
class LightCube:
    """Radiance by direction.

    Attributes:
        texels: Linear, float64 [6, n, n, 3]. Face 2 a + s has the directions whose largest component is a, 0 to 2,
            with sign s, 1 for a negative one. Rows part the slope of the next axis, columns of the one after it,
            from -1 to 1.
        lights: Texels in which there is a light, bool [6, n, n]; None: there are none. Their radiance is without it.
        middle: Where it is collected, in the space of its directions, float64 [3]; None: it is of everywhere.
        distance: Of what it shows, along the largest component of a direction.
    """

    texels: Floats
    lights: NDArray[np.bool_] | None = None
    middle: Floats | None = None
    distance: float = np.inf

    @staticmethod
    def of(radiance: Callable[[Floats], Floats], size: int = FACE) -> LightCube:
        """The cube of a function from unit directions to radiance, float64 [n, 3] each; ``size`` texels along an edge.

        A texel has the mean over its solid angle.
        """
        directions, weights = face_directions(size * _SUBSAMPLES)
        light = radiance(directions.reshape(-1, 3)).reshape(directions.shape)
        parts = weights.reshape(size, _SUBSAMPLES, size, _SUBSAMPLES, 1)
        sums = (light.reshape(6, size, _SUBSAMPLES, size, _SUBSAMPLES, 3) * parts).sum(axis=(2, 4))
        return LightCube(sums / parts.sum(axis=(1, 3)))

    def texel_of(self, directions: Floats) -> NDArray[np.intp]:
        """Index in ``texels.reshape(-1, 3)`` of the texel that directions of any length, float64 [n, 3], meet."""
        size, rows = self.texels.shape[1], np.arange(len(directions))
        axis = np.abs(directions).argmax(axis=1)
        major = directions[rows, axis]
        index = 2 * axis + (major < 0)
        for turn in (1, 2):
            slope = directions[rows, (axis + turn) % 3] / np.abs(major)
            index = index * size + np.clip(np.floor((slope + 1) * (size / 2)), 0, size - 1).astype(np.intp)
        return np.asarray(index, dtype=np.intp)

    def radiance(
        self, directions: Floats, origins: Floats | None = None, sees_lights: NDArray[np.bool_] | None = None
    ) -> Floats:
        """Radiance of rays, whose directions have any length, float64 [n, 3] each.

        Args:
            directions: float64 [n, 3].
            origins: Of the rays, float64 [n, 3]; None: all begin in the middle.
            sees_lights: Rays that see lights, bool [n], `MOST` where there is one; None: none do.
        """
        if origins is not None and self.middle is not None and np.isfinite(self.distance):
            reach = directions * (self.distance / np.abs(directions).max(axis=1))[:, None]
            directions = reach + np.clip(origins - self.middle, -self.distance, self.distance)
        texels = self.texel_of(directions)
        radiance = self.texels.reshape(-1, 3)[texels]
        if self.lights is None or sees_lights is None:
            return np.asarray(radiance)
        return np.where((sees_lights & self.lights.ravel()[texels])[:, None], MOST, radiance)

    def with_lights(self, discs: Sequence[tuple[Floats, float]]) -> LightCube:
        """The cube with discs of light: unit direction, float64 [3], and radius, radians.

        A light covers the texels whose middles lie in it, and at least the one that holds its own middle.
        """
        size = self.texels.shape[1]
        directions = face_directions(size)[0].reshape(-1, 3)
        lights = np.zeros(len(directions), dtype=np.bool_)
        for middle, radius in discs:
            lights |= fixed_order.product(directions, middle[:, None])[:, 0] >= np.cos(radius)
            lights[self.texel_of(middle[None])] = True
        return replace(self, lights=lights.reshape(6, size, size))

    def turned(self, rotation: Floats) -> LightCube:
        """The device's cube of another space: a direction d of it is ``rotation @ d`` of this one, float64 [3, 3].

        It has no lights.
        """
        from colonnade import _core

        texels = np.asarray(self.texels, np.float64)
        return LightCube(_core.rotated_cube(texels.reshape(-1, 3), texels.shape[1], rotation))

    def words(self) -> NDArray[np.uint8]:
        """The words of the device's memory, uint8 [texels, 4], low byte first.

        The fields are, from the highest, a light, the exponent, and the mantissas of red, green and blue.
        """
        from colonnade import _core

        texels = np.asarray(self.texels, np.float64).reshape(-1, 3)
        lights = np.zeros(len(texels), bool) if self.lights is None else self.lights.ravel()
        words: NDArray[np.uint32] = _core.cube_words(texels, lights)
        return words.astype("<u4").view(np.uint8).reshape(-1, 4)


def face_directions(size: int) -> tuple[Floats, Floats]:
    """Unit directions through the texels of a cube, float64 [6, size, size, 3], and their weights, [size, size]."""
    slopes = (np.arange(size) + 0.5) * (2 / size) - 1
    squares = 1 + slopes[:, None] ** 2 + slopes**2
    lengths = np.sqrt(squares)
    directions = np.empty((6, size, size, 3))
    for face in range(6):
        axis = face // 2
        directions[face, :, :, axis] = (1 - 2 * (face % 2)) / lengths
        directions[face, :, :, (axis + 1) % 3] = slopes[:, None] / lengths
        directions[face, :, :, (axis + 2) % 3] = slopes / lengths
    return directions, 1 / (squares * lengths)
