"""The pixels of a texture that faces show, as boxes, and counts of marked pixels in them."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from colonnade.common.types import Floats, Indices
from colonnade.mesh.materials.texture import Texture, Wrap

#: Positions so near to the border of a pixel, in pixels, do not show the pixel beyond.
_NEAR = 1e-4


def pixel_boxes(uvs: Floats, texture: Texture) -> tuple[Indices, Indices]:
    """The first and last pixels (x, y) that faces at texture coordinates, float64 [k, 3, 2], show, int64 [k, 2] each.

    Pixels beyond the picture count on; `PixelCounts` wraps them.
    """
    at = uvs * texture.size
    first = np.floor(at.min(axis=1) + _NEAR).astype(np.int64)
    return first, np.maximum(first, np.ceil(at.max(axis=1) - _NEAR).astype(np.int64) - 1)


def unfolded(values: npt.NDArray[Any], wrap: tuple[Wrap, Wrap]) -> npt.NDArray[Any]:
    """A picture [height, width, …] as one that repeats without being mirrored."""
    for axis, along in ((1, wrap[0]), (0, wrap[1])):
        if along == "mirror":
            values = np.concatenate([values, np.flip(values, axis)], axis=axis)
    return values


def wrapped(pixels: Indices, texture: Texture) -> Indices:
    """Pixels (x, y), int64 [k, 2], as pixels of the unfolded picture."""
    found = np.empty_like(pixels)
    for axis, (wrap, count) in enumerate(zip(texture.wrap, texture.size, strict=True)):
        along = pixels[:, axis]
        period = 2 * count if wrap == "mirror" else count
        found[:, axis] = np.clip(along, 0, count - 1) if wrap == "clamp" else along % period
    return found


class PixelCounts:
    """Counts of the marked pixels of a texture in boxes of any size and place."""

    def __init__(self, marks: npt.NDArray[np.bool_], texture: Texture) -> None:
        """Marks are of the unfolded picture."""
        self._texture = texture
        self._sums = np.zeros((marks.shape[0] + 1, marks.shape[1] + 1), dtype=np.int32)
        counts = self._sums[1:, 1:]
        np.cumsum(marks, axis=1, dtype=np.int32, out=counts)
        np.cumsum(counts, axis=0, out=counts)

    def within(self, first: Indices, last: Indices) -> Indices:
        """Marked pixels from the first to the last pixel (x, y), int64 [k]; pixels of a clamped border count once."""
        low, high = first.copy(), last + 1
        for axis, wrap in enumerate(self._texture.wrap):
            if wrap == "clamp":
                count = self._texture.size[axis]
                empty = high[:, axis] <= low[:, axis]
                low[:, axis] = np.clip(low[:, axis], 0, count - 1)
                high[:, axis] = np.where(empty, low[:, axis], np.clip(high[:, axis], low[:, axis] + 1, count))
        (left, top), (right, bottom) = low.T, high.T
        total = self._before(right, bottom) - self._before(left, bottom)
        return total - self._before(right, top) + self._before(left, top)

    def _before(self, x: Indices, y: Indices) -> Indices:
        """Marked pixels from 0 to x and y of the repeated picture; signed."""
        sums = self._sums
        height, width = sums.shape[0] - 1, sums.shape[1] - 1
        (columns, x), (rows, y) = np.divmod(x, width), np.divmod(y, height)
        found: Indices = rows * columns * sums[-1, -1] + rows * sums[-1, x] + columns * sums[y, -1] + sums[y, x]
        return found
