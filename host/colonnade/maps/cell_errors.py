"""Weighted squared errors of a tile's cells for candidate entries.

If all pixels x of a cell take the entry p, the cell's error is S|x|^2 - 2 p . Sx + |p|^2 S1. Three sums over the cell
therefore give its error for any entry. They are centred on the tile's mean, so that float32 is precise enough.

Detail of single pixels is seen less than errors of larger areas. So in cells larger than a pixel, the part of S|x|^2
that lies within blocks of 2x2 pixels counts by `PIXEL_DETAIL`. Masks of single pixels gain less in comparison.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.common import fixed_order
from colonnade.maps.layout import AttributeLayout
from colonnade.maps.tiles import inside_mask, split_tiles, sum_cells

#: A tile's weight is 1 / (variance + this constant), on an 8-bit scale: texture masks errors.
TEXTURE_MASKING = 150.0
#: Weight of the variance within 2x2 pixels.
PIXEL_DETAIL = 0.5


@dataclass(frozen=True)
class Cells:
    """Sums over the cells of every tile.

    Attributes:
        weights: float32 [tiles, cells * cells], S1.
        sums: float32 [tiles, cells * cells, 3], Sx.
        squares: float32 [tiles, cells * cells], S|x|^2, with less weight on detail of single pixels.
    """

    weights: NDArray[np.float32]
    sums: NDArray[np.float32]
    squares: NDArray[np.float32]


class TilePixels:
    """A map split into weighted tiles.

    Attributes:
        layout: Sizes of the map.
        points: float64 [tiles, size, size, 3].
        weights: float64 [tiles, size, size], weight of each pixel's error; 0 beyond the map's edge.
        means: float64 [tiles, 3].
    """

    def __init__(self, points: NDArray[np.float64], layout: AttributeLayout) -> None:
        """Split ``points``, float64 [height, width, 3], into tiles."""
        self.layout = layout
        self.points: NDArray[np.float64] = split_tiles(points, layout)
        inside = inside_mask(layout)
        count = inside.sum(axis=(1, 2))[:, np.newaxis]
        self.means: NDArray[np.float64] = (self.points * inside[..., np.newaxis]).sum(axis=(1, 2)) / count
        centred = self.points - self.means[:, np.newaxis, np.newaxis]
        variance = ((centred**2).sum(axis=3) * inside).sum(axis=(1, 2)) / (3 * count[:, 0])
        self.weights: NDArray[np.float64] = inside / (variance + TEXTURE_MASKING)[:, np.newaxis, np.newaxis]
        self._centred = centred
        self._pixel_detail = self._variance_within_blocks()
        self._cells: dict[int, Cells] = {}

    def _sums(self, cells: int) -> list[NDArray[np.float64]]:
        """S1, Sx and S|x|^2 of ``cells`` by ``cells`` cells of each tile."""
        weighted = self._centred * self.weights[..., np.newaxis]
        squares = (self._centred * weighted).sum(axis=3)
        return [sum_cells(values, cells) for values in (self.weights, weighted, squares)]

    def _variance_within_blocks(self) -> NDArray[np.float64]:
        """Weighted squared distances to the means of 2x2 pixels, float64 [tiles, size / 2, size / 2]."""
        blocks = self.layout.tile_size // 2
        weights, sums, squares = self._sums(blocks)
        variance: NDArray[np.float64] = squares - (sums**2).sum(axis=2) / np.maximum(weights, 1e-12)
        return variance.reshape(-1, blocks, blocks)

    def cells(self, cells: int) -> Cells:
        """Sums over the cells of each tile, ``cells`` by ``cells`` of them."""
        if cells not in self._cells:
            weights, sums, squares = self._sums(cells)
            if cells < self.layout.tile_size:
                squares -= (1.0 - PIXEL_DETAIL) * sum_cells(self._pixel_detail, cells)
            self._cells[cells] = Cells(*(values.astype(np.float32) for values in (weights, sums, squares)))
        return self._cells[cells]

    def cell_costs(
        self, cells: int, entries: NDArray[np.float64], which: NDArray[np.intp] | slice = slice(None)
    ) -> NDArray[np.float32]:
        """Weighted errors float32 [which, cells * cells, entries] of tiles' entries, float64 [which, entries, 3]."""
        sums = self.cells(cells)
        centred = (entries - self.means[which][:, np.newaxis]).astype(np.float32)
        lengths = (centred * centred).sum(axis=2)
        costs: NDArray[np.float32] = fixed_order.product(sums.sums[which], centred.transpose(0, 2, 1) * np.float32(-2))
        costs += sums.weights[which][..., np.newaxis] * lengths[:, np.newaxis, :]
        costs += sums.squares[which][..., np.newaxis]
        return costs
