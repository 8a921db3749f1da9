"""The textures of mesh files: pictures of base colours, sampled at positions (u, v) of the surface.

u goes to the right and v down, from the picture's upper left corner, as in glTF; 0 to 1 is the picture.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from colonnade.common.errors import UserError
from colonnade.common.image_io import decoded_picture
from colonnade.common.srgb import linear_from_srgb
from colonnade.common.types import Floats, Indices
from colonnade.mesh.losses import PICTURE_FORMATS, Losses

#: What lies beyond the picture: it repeats, it repeats mirrored, or its border goes on.
Wrap = Literal["repeat", "mirror", "clamp"]

#: Linear value of each code of 8 bits.
_LINEAR = linear_from_srgb(np.arange(256) / 255.0)


def read_texture(data: bytes, name: str, wrap: tuple[Wrap, Wrap], losses: Losses) -> Texture | None:
    """The texture of a picture's bytes; None, and a loss, if they are no PNG, JPEG or WebP picture."""
    try:
        return Texture(name, decoded_picture(data, name), wrap)
    except UserError:
        losses.add(PICTURE_FORMATS)
        return None


@dataclass(frozen=True, eq=False)
class Texture:
    """A picture of base colours.

    Attributes:
        name: Name for messages.
        pixels: uint8 [height, width, 3], sRGB.
        wrap: What lies beyond the picture, along u and v.
    """

    name: str
    pixels: npt.NDArray[np.uint8]
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""
        return self.pixels.shape[1], self.pixels.shape[0]

    @property
    def mean(self) -> Floats:
        """Mean linear colour, float64 [3]."""
        return np.asarray(_LINEAR[self.pixels].mean(axis=(0, 1)))

    def colours(self, positions: Floats) -> Floats:
        """Linear colours at positions, float64 [n, 2], bilinear between the pixels' centres, float64 [n, 3]."""
        width, height = self.size
        at = positions * (width, height) - 0.5
        low = np.floor(at)
        far = at - low
        column, row = (low[:, axis].astype(np.int64) for axis in range(2))
        columns = [_wrapped(column + step, width, self.wrap[0]) for step in range(2)]
        rows = [_wrapped(row + step, height, self.wrap[1]) for step in range(2)]
        colours = np.zeros((len(positions), 3))
        for x, share_x in ((0, 1 - far[:, 0]), (1, far[:, 0])):
            for y, share_y in ((0, 1 - far[:, 1]), (1, far[:, 1])):
                colours += (share_x * share_y)[:, None] * _LINEAR[self.pixels[rows[y], columns[x]]]
        return colours


def _wrapped(index: Indices, count: int, wrap: Wrap) -> Indices:
    """Pixels beyond the picture, as pixels of it."""
    if wrap == "clamp":
        return np.clip(index, 0, count - 1)
    if wrap == "repeat":
        return index % count
    folded = index % (2 * count)
    return np.minimum(folded, 2 * count - 1 - folded)
