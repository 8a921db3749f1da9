"""The sliding map: superpixels on a grid of seeds, with a label for each block of pixels.

There is a seed in every tile, a vector of three fields. The label of a block (4x4 pixels of a tile of 16) says to which
of the 3x3 seeds around its tile it belongs: label = (dy + 1) * 3 + dx + 1. Labels lie row by row, four to a word of 16
bits, the first in its low bits. A look-up reads one label and one seed.

The clusters are superpixels of SLIC (Achanta et al., "SLIC Superpixels Compared to State-of-the-art Superpixel
Methods", PAMI 2012) with blocks for pixels: k-means in colour and place, a seed competing only for what lies around it.
The weight of place falls from round to round.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.environment.encoding.layout import BLOCKS_A_TILE_EDGE, LABEL_BITS, AttributeLayout
from colonnade.environment.encoding.tiles import cut, pooled, present
from colonnade.environment.encoding.vectors import VectorSpace

#: Weight of place in each round: squared error that a tile's edge away is worth, on the scale of 8 bits.
_COMPACTNESS = (400.0, 200.0, 100.0, 50.0, 25.0, 12.0, 6.0, 3.0, 1.0, 0.0, 0.0, 0.0)
_LABELS_A_WORD = 16 // LABEL_BITS


@dataclass(frozen=True)
class SlicMap:
    """Memory contents of one map.

    Attributes:
        seeds: uint64 [tiles], three fields each.
        labels: uint16 [label_words].
    """

    seeds: NDArray[np.uint64]
    labels: NDArray[np.uint16]

    def memories(self) -> dict[str, NDArray[np.unsignedinteger]]:
        """Words of each memory."""
        return {"seeds": self.seeds, "labels": self.labels}

    def seeds_at(self, u: NDArray[np.int64], v: NDArray[np.int64], layout: AttributeLayout) -> NDArray[np.int64]:
        """Seeds that pixels (u, v), of any shape, belong to; inside the map."""
        block = v // layout.block_size * layout.block_columns + u // layout.block_size
        word = self.labels.astype(np.int64)[block // _LABELS_A_WORD]
        label = (word >> (block % _LABELS_A_WORD * LABEL_BITS)) & 15
        row = np.clip(v // layout.tile_size + label // 3 - 1, 0, layout.tile_rows - 1)
        column = np.clip(u // layout.tile_size + label % 3 - 1, 0, layout.tile_columns - 1)
        seed: NDArray[np.int64] = row * layout.tile_columns + column
        return seed

    def at(
        self, u: NDArray[np.int64], v: NDArray[np.int64], layout: AttributeLayout, space: VectorSpace
    ) -> NDArray[np.float64]:
        """Vectors float64 [..., 3] of pixels (u, v)."""
        return space.vectors(self.seeds)[self.seeds_at(u, v, layout)]

    def decoded(self, layout: AttributeLayout, space: VectorSpace) -> NDArray[np.float64]:
        """The whole map, float64 [height, width, 3]."""
        v, u = np.mgrid[: layout.height, : layout.width]
        return self.at(u, v, layout, space)


def encode_slic(vectors: NDArray[np.float64], space: VectorSpace, layout: AttributeLayout) -> SlicMap:
    """The map of ``vectors``, float64 [height, width, 3]."""

    inside = present(layout)
    points = cut(space.spread(vectors), layout) * inside[..., np.newaxis]
    weights = pooled(inside, BLOCKS_A_TILE_EDGE)
    sums = pooled(points, BLOCKS_A_TILE_EDGE)
    places = _block_places(layout)
    around, allowed = _neighbours(layout)
    # Start with each tile's mean, at its centre
    seeds = sums.sum(axis=1) / weights.sum(axis=1)[:, np.newaxis]
    centres = places.mean(axis=1)
    for compactness in _COMPACTNESS:
        seeds = space.spread(space.vectors(space.words(space.gathered(seeds))))
        # Costs [tiles, blocks, 9] without what all seeds share
        near = seeds[around]
        costs = weights[..., np.newaxis] * (near**2).sum(axis=2)[:, np.newaxis] - 2.0 * sums @ near.transpose(0, 2, 1)
        distance = ((places[:, :, np.newaxis] - centres[around][:, np.newaxis]) ** 2).sum(axis=3)
        costs += compactness * weights[..., np.newaxis] * distance
        costs = np.where(allowed[:, np.newaxis], costs, np.inf)
        label = costs.argmin(axis=2)
        owner = np.take_along_axis(around, label, axis=1).ravel()
        mass = np.bincount(owner, weights.ravel(), layout.tiles)
        kept = mass > 0
        share = np.maximum(mass, 1e-12)[:, np.newaxis]
        mean = np.stack([np.bincount(owner, sums[..., k].ravel(), layout.tiles) for k in range(3)], axis=1) / share
        place = [np.bincount(owner, (weights * places[..., k]).ravel(), layout.tiles) for k in range(2)]
        seeds = np.where(kept[:, np.newaxis], mean, seeds)
        centres = np.where(kept[:, np.newaxis], np.stack(place, axis=1) / share, centres)
    grid = label.reshape(layout.tiles, BLOCKS_A_TILE_EDGE, BLOCKS_A_TILE_EDGE)
    return SlicMap(space.words(space.gathered(seeds)), _label_words(grid, layout))


def _block_places(layout: AttributeLayout) -> NDArray[np.float64]:
    """Centres of each tile's blocks in tiles: float64 [tiles, blocks, 2]."""
    edge = BLOCKS_A_TILE_EDGE
    offset = (np.arange(edge) + 0.5) / edge
    row, column = np.divmod(np.arange(layout.tiles), layout.tile_columns)
    y = row[:, np.newaxis] + offset.repeat(edge)
    x = column[:, np.newaxis] + np.tile(offset, edge)
    return np.stack([x, y], axis=2)


def _neighbours(layout: AttributeLayout) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """The nine tiles around each by label, intp [tiles, 9], and whether they are tiles at all."""
    row, column = np.divmod(np.arange(layout.tiles), layout.tile_columns)
    dy, dx = np.divmod(np.arange(9), 3)
    rows, columns = row[:, np.newaxis] + dy - 1, column[:, np.newaxis] + dx - 1
    allowed = (rows >= 0) & (rows < layout.tile_rows) & (columns >= 0) & (columns < layout.tile_columns)
    return np.where(allowed, rows * layout.tile_columns + columns, 0), allowed


def _label_words(labels: NDArray[np.intp], layout: AttributeLayout) -> NDArray[np.uint16]:
    """Words of the labels of each tile's blocks, intp [tiles, 4, 4]; blocks beyond the map's edge are left out."""
    edge = BLOCKS_A_TILE_EDGE
    grid = labels.reshape(layout.tile_rows, layout.tile_columns, edge, edge).swapaxes(1, 2)
    flat = grid.reshape(layout.tile_rows * edge, -1)[: layout.block_rows, : layout.block_columns].ravel()
    padded = np.zeros(layout.label_words * _LABELS_A_WORD, np.int64)
    padded[: flat.size] = flat
    shifts = np.arange(_LABELS_A_WORD) * LABEL_BITS
    words: NDArray[np.uint16] = (padded.reshape(-1, _LABELS_A_WORD) << shifts).sum(axis=1).astype(np.uint16)
    return words
