"""The SLIC map: superpixels on a grid of seeds, with a label for each block of pixels.

Each tile has a seed, a vector of three fields. The label of a block (4x4 pixels in a tile of 16) names one of the 3x3
seeds around its tile: label = (dy + 1) * 3 + dx + 1. Labels are in row-major order, four to a 16-bit word, the first in
the low bits. A lookup reads one label and one seed.

The clusters are the superpixels of SLIC (Achanta et al., "SLIC Superpixels Compared to State-of-the-art Superpixel
Methods", PAMI 2012), on blocks instead of pixels: k-means in colour and position, where a seed competes only for nearby
blocks. The weight of the position decreases from round to round.

This is our own code and not scikit-image's because the hardware needs labels of a block among 3x3 fixed seeds. A
library's superpixels have free pixel labels, other counts, and no quantisation to the memory's fields in the loop.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.common import fixed_order
from colonnade.maps.layout import BLOCKS_PER_TILE_EDGE, LABEL_BITS, AttributeLayout
from colonnade.maps.tiles import inside_mask, split_tiles, sum_cells
from colonnade.maps.vectors import VectorSpace

#: Weight of the position in each round: squared 8-bit error that equals a distance of one tile.
_COMPACTNESS = (400.0, 200.0, 100.0, 50.0, 25.0, 12.0, 6.0, 3.0, 1.0, 0.0, 0.0, 0.0)
_LABELS_PER_WORD = 16 // LABEL_BITS


@dataclass(frozen=True)
class SlicMap:
    """Contents of one map's memories.

    Attributes:
        seeds: uint64 [tiles], vectors of three fields.
        labels: uint16 [label_words].
    """

    seeds: NDArray[np.uint64]
    labels: NDArray[np.uint16]

    def memories(self) -> dict[str, NDArray[np.unsignedinteger]]:
        """Words of each memory."""
        return {"seeds": self.seeds, "labels": self.labels}

    def seeds_at(self, u: NDArray[np.int64], v: NDArray[np.int64], layout: AttributeLayout) -> NDArray[np.int64]:
        """Seed indices of pixels (u, v) in the map; arrays of any shape."""
        block = v // layout.block_size * layout.block_columns + u // layout.block_size
        word = self.labels.astype(np.int64)[block // _LABELS_PER_WORD]
        label = (word >> (block % _LABELS_PER_WORD * LABEL_BITS)) & 15
        row = np.clip(v // layout.tile_size + label // 3 - 1, 0, layout.tile_rows - 1)
        column = np.clip(u // layout.tile_size + label % 3 - 1, 0, layout.tile_columns - 1)
        seed: NDArray[np.int64] = row * layout.tile_columns + column
        return seed

    def at(
        self, u: NDArray[np.int64], v: NDArray[np.int64], layout: AttributeLayout, space: VectorSpace
    ) -> NDArray[np.float64]:
        """Vectors of pixels (u, v): float64 [..., 3]."""
        return space.vectors(self.seeds)[self.seeds_at(u, v, layout)]

    def decoded(self, layout: AttributeLayout, space: VectorSpace) -> NDArray[np.float64]:
        """Decode the whole map: float64 [height, width, 3]."""
        v, u = np.mgrid[: layout.height, : layout.width]
        return self.at(u, v, layout, space)


def encode_slic(vectors: NDArray[np.float64], space: VectorSpace, layout: AttributeLayout) -> SlicMap:
    """Encode ``vectors``, float64 [height, width, 3]."""

    inside = inside_mask(layout)
    points = split_tiles(space.to_points(vectors), layout) * inside[..., np.newaxis]
    weights = sum_cells(inside, BLOCKS_PER_TILE_EDGE)
    sums = sum_cells(points, BLOCKS_PER_TILE_EDGE)
    positions = _block_positions(layout)
    neighbours, allowed = _neighbours(layout)
    # Start with each tile's mean at its centre
    seeds = sums.sum(axis=1) / weights.sum(axis=1)[:, np.newaxis]
    centres = positions.mean(axis=1)
    for compactness in _COMPACTNESS:
        seeds = space.to_points(space.vectors(space.words(space.from_points(seeds))))
        # Costs [tiles, blocks, 9] without the term that is equal for all seeds
        near = seeds[neighbours]
        costs = weights[..., np.newaxis] * (near**2).sum(axis=2)[:, np.newaxis]
        costs -= 2.0 * fixed_order.product(sums, near.transpose(0, 2, 1))
        distance = ((positions[:, :, np.newaxis] - centres[neighbours][:, np.newaxis]) ** 2).sum(axis=3)
        costs += compactness * weights[..., np.newaxis] * distance
        costs = np.where(allowed[:, np.newaxis], costs, np.inf)
        label = costs.argmin(axis=2)
        owner = np.take_along_axis(neighbours, label, axis=1).ravel()
        mass = np.bincount(owner, weights.ravel(), layout.tiles)
        used = mass > 0
        safe_mass = np.maximum(mass, 1e-12)[:, np.newaxis]
        mean = np.stack([np.bincount(owner, sums[..., k].ravel(), layout.tiles) for k in range(3)], axis=1) / safe_mass
        moment = [np.bincount(owner, (weights * positions[..., k]).ravel(), layout.tiles) for k in range(2)]
        seeds = np.where(used[:, np.newaxis], mean, seeds)
        centres = np.where(used[:, np.newaxis], np.stack(moment, axis=1) / safe_mass, centres)
    grid = label.reshape(layout.tiles, BLOCKS_PER_TILE_EDGE, BLOCKS_PER_TILE_EDGE)
    return SlicMap(space.words(space.from_points(seeds)), _label_words(grid, layout))


def _block_positions(layout: AttributeLayout) -> NDArray[np.float64]:
    """Centres of each tile's blocks, in units of tiles: float64 [tiles, blocks, 2]."""
    edge = BLOCKS_PER_TILE_EDGE
    offset = (np.arange(edge) + 0.5) / edge
    row, column = np.divmod(np.arange(layout.tiles), layout.tile_columns)
    y = row[:, np.newaxis] + offset.repeat(edge)
    x = column[:, np.newaxis] + np.tile(offset, edge)
    return np.stack([x, y], axis=2)


def _neighbours(layout: AttributeLayout) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Indices of the 3x3 tiles around each tile by label, intp [tiles, 9], and whether they exist, bool [tiles, 9]."""
    row, column = np.divmod(np.arange(layout.tiles), layout.tile_columns)
    dy, dx = np.divmod(np.arange(9), 3)
    rows, columns = row[:, np.newaxis] + dy - 1, column[:, np.newaxis] + dx - 1
    allowed = (rows >= 0) & (rows < layout.tile_rows) & (columns >= 0) & (columns < layout.tile_columns)
    return np.where(allowed, rows * layout.tile_columns + columns, 0), allowed


def _label_words(labels: NDArray[np.intp], layout: AttributeLayout) -> NDArray[np.uint16]:
    """Pack the labels of each tile's blocks, intp [tiles, 4, 4], without blocks beyond the map's edge."""
    edge = BLOCKS_PER_TILE_EDGE
    grid = labels.reshape(layout.tile_rows, layout.tile_columns, edge, edge).swapaxes(1, 2)
    flat = grid.reshape(layout.tile_rows * edge, -1)[: layout.block_rows, : layout.block_columns].ravel()
    padded = np.zeros(layout.label_words * _LABELS_PER_WORD, np.int64)
    padded[: flat.size] = flat
    shifts = np.arange(_LABELS_PER_WORD) * LABEL_BITS
    words: NDArray[np.uint16] = (padded.reshape(-1, _LABELS_PER_WORD) << shifts).sum(axis=1).astype(np.uint16)
    return words
