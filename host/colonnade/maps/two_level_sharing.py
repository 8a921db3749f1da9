"""Shares masks between the tiles of a two-level map.

A tile may have the words of any other tile, with entries 0 and 1 of its own.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from colonnade.common import fixed_order
from colonnade.maps.cell_errors import TilePixels
from colonnade.maps.sharing import Users
from colonnade.maps.subdivision import Subdivided

#: Tiles per batch, so that their costs fit a cache.
_TILES = 16


def errors_with(
    words: Subdivided, pixels: TilePixels, palette: NDArray[np.float64], candidates: NDArray[np.intp]
) -> NDArray[np.float32]:
    """Errors of all tiles with words, float32 [words, tiles].

    Args:
        words: Subdivisions with these words.
        pixels: The map.
        palette: float64 [entries, 3].
        candidates: intp [tiles, candidates], palette entries that a tile may have as its entries 0 and 1.
    """
    cells, count, tiles = words.mode.cells, len(words.tiles), len(candidates)
    regions = [(words.taken == member).astype(np.float32) for member in range(words.members.shape[1])]
    own = np.concatenate(regions[:2])
    errors = np.empty((count, tiles), np.float32)
    for first in range(0, tiles, _TILES):
        part = slice(first, min(first + _TILES, tiles))
        costs = pixels.cell_costs(cells, palette[candidates[part]], part)
        totals = fixed_order.product(own, costs.transpose(1, 0, 2).reshape(cells * cells, -1))
        errors[:, part] = totals.reshape(2, count, *costs.shape[::2]).min(axis=3).sum(axis=0)
    sums = pixels.cells(cells)
    moments = np.concatenate([sums.squares[..., np.newaxis], sums.sums, sums.weights[..., np.newaxis]], axis=2)
    by_cell = moments.transpose(1, 0, 2).reshape(cells * cells, -1)
    for entries, inside in zip(words.members.T[2:], regions[2:], strict=True):
        inner = fixed_order.product(inside, by_cell).reshape(count, tiles, moments.shape[2])
        square, first_moment, weight = np.split(inner, [1, 4], axis=2)
        entry = (palette[entries, np.newaxis] - pixels.means).astype(np.float32)
        errors += square[..., 0] + (entry * (entry * weight - 2 * first_moment)).sum(axis=2)
    return errors


def fitted(users: Users, pixels: TilePixels, palette: NDArray[np.float64], candidates: NDArray[np.intp]) -> Subdivided:
    """The users of words with their best entries, and with masks that are the best for all who share them."""
    words = users.shared
    first = _with_entries(words, users, pixels, palette, candidates)
    costs = np.zeros((len(words.tiles), *words.taken.shape[1:], words.members.shape[1]))
    np.add.at(costs, users.rows, pixels.cell_costs(words.mode.cells, palette[first.members], users.tiles))
    voted = replace(words, taken=costs.argmin(axis=2).astype(np.int64))
    return _with_entries(voted, users, pixels, palette, candidates)


def _with_entries(
    words: Subdivided, users: Users, pixels: TilePixels, palette: NDArray[np.float64], candidates: NDArray[np.intp]
) -> Subdivided:
    """The users with the words, and with the best entries 0 and 1 for them."""
    members, taken = words.members[users.rows].copy(), words.taken[users.rows]
    costs = pixels.cell_costs(words.mode.cells, palette[candidates[users.tiles]], users.tiles)
    for entry in range(2):
        best = (costs * (taken == entry)[..., np.newaxis]).sum(axis=1).argmin(axis=1)
        members[:, entry] = candidates[users.tiles, best]
    return Subdivided(words.number, words.mode, users.tiles, members, taken)
