"""The textures of mesh files: pictures of base colours, sampled at texture coordinates (u, v).

u goes to the right and v down, from the picture's upper left corner, as in glTF; 0 to 1 is the picture.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from colonnade.common.image_io import encode_srgb
from colonnade.common.srgb import linear_from_srgb
from colonnade.common.types import Floats

#: What lies beyond the picture: it repeats, it repeats mirrored, or its border goes on.
Wrap = Literal["repeat", "mirror", "clamp"]

#: Largest magnitude of a position: beyond it float32 holds no fractions of a picture.
MAX_UV = 1e6

#: Linear value of each code of 8 bits.
LINEAR = linear_from_srgb(np.arange(256) / 255.0)
#: The same as whole numbers of 16 bits, and the code of each of these.
_LEVELS = np.rint(LINEAR * 65535).astype(np.int64)
_CODES = encode_srgb(np.arange(65536) / 65535)
#: What lies beyond the picture, as numbers of ``cpp/mesh/texture.hpp``.
_WRAPS: dict[Wrap, int] = {"repeat": 0, "mirror": 1, "clamp": 2}


@dataclass(frozen=True, eq=False)
class Texture:
    """A picture of base colours.

    Attributes:
        name: Name for messages.
        pixels: uint8 [height, width, 3], sRGB.
        wrap: What lies beyond the picture, along u and v.
        alpha: uint8 [height, width]; None: all of it is opaque.
        is_nearest: A position shows its pixel, without a filter.
    """

    name: str
    pixels: npt.NDArray[np.uint8]
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    alpha: npt.NDArray[np.uint8] | None = None
    is_nearest: bool = False

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""
        return self.pixels.shape[1], self.pixels.shape[0]

    @property
    def compiled(self) -> tuple[npt.NDArray[np.uint8], int, int, bool]:
        """What the compiled half needs of it."""
        across, down = self.wrap
        return np.ascontiguousarray(self.pixels), _WRAPS[across], _WRAPS[down], self.is_nearest

    @property
    def linear(self) -> Floats:
        """Linear colours of the pixels, float64 [height, width, 3]."""
        return np.asarray(LINEAR[self.pixels])

    @property
    def mean(self) -> Floats:
        """Mean linear colour, float64 [3]."""
        sums = np.sum([LINEAR[row].sum(axis=0) for row in self.pixels], axis=0)
        return np.asarray(sums / (self.size[0] * self.size[1]))

    def halved(self) -> Texture:
        """The texture with half the pixels along each axis, the linear means of 2 by 2; a last odd one is kept."""
        width, height = (-(-length // 2) for length in self.size)
        right = np.minimum(2 * np.arange(width) + 1, self.size[0] - 1)
        pixels = np.empty((height, width, 3), np.uint8)
        for row in range(height):
            sums = np.take(_LEVELS, self.pixels[2 * row : 2 * row + 2]).sum(axis=0)
            count = 2 * min(2, self.size[1] - 2 * row)
            pixels[row] = np.take(_CODES, (sums[::2] + sums[right]) // count)
        alpha = None
        if self.alpha is not None:
            padded = np.pad(self.alpha, ((0, self.size[1] % 2), (0, self.size[0] % 2)), mode="edge")
            alpha = padded.reshape(height, 2, width, 2).mean(axis=(1, 3)).astype(np.uint8)
        return replace(self, pixels=pixels, alpha=alpha)

    def colours(self, uvs: Floats) -> Floats:
        """Linear colours at texture coordinates, float64 [n, 2]: bilinear between pixels' centres, float64 [n, 3]."""
        return self._filtered(uvs, self.pixels, LINEAR)

    def codes(self, uvs: Floats) -> Floats:
        """The pixels' codes, 0 to 255, at texture coordinates, filtered as the colours, float64 [n, 3]."""
        return self._filtered(uvs, self.pixels, np.arange(256.0))

    def alphas(self, uvs: Floats) -> Floats:
        """Alpha at texture coordinates, float64 [n, 2], filtered as the colours, 0 to 1, float64 [n]."""
        if self.alpha is None:
            return np.ones(len(uvs))
        return self._filtered(uvs, self.alpha, np.arange(256) / 255.0)

    def _filtered(self, uvs: Floats, pixels: npt.NDArray[np.uint8], values: Floats) -> Floats:
        """The pixels' values at texture coordinates, float64 [n, ...]."""
        return sampled(pixels, uvs, self.wrap, self.is_nearest, values)


def sampled(
    pixels: npt.NDArray[np.uint8] | npt.NDArray[np.float32],
    uvs: Floats,
    wrap: tuple[Wrap, Wrap],
    is_nearest: bool = False,
    values: Floats | None = None,
) -> Floats:
    """A picture at texture coordinates: bilinear between pixels' centres, or the pixel there.

    Args:
        pixels: uint8 or float32 [height, width, ...].
        uvs: float64 [n, 2].
        wrap: What lies beyond the picture, along u and v.
        is_nearest: No filter.
        values: The value of each code of uint8, float64 [256]; None: the pixels are values.

    Returns:
        float64 [n, ...].
    """
    from colonnade import _core

    height, width = pixels.shape[:2]
    channels = np.ascontiguousarray(pixels).reshape(height, width, -1)
    table = None if values is None else np.ascontiguousarray(values, dtype=np.float64)
    modes = [_WRAPS[axis] for axis in wrap]
    found: Floats = _core.sampled(channels, np.ascontiguousarray(uvs, dtype=np.float64), *modes, is_nearest, table)
    return found.reshape(len(uvs), *pixels.shape[2:])
