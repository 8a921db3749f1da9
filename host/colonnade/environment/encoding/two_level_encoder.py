"""Encodes a two-level map: a palette for the whole map and a mode for each tile.

Each round finds every mode's best entries and error in every tile, then the modes that minimise the weighted error
within the heap. Finally it updates the palette's entries to the means of their pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.environment.encoding.cell_errors import TilePixels
from colonnade.environment.encoding.layout import AttributeLayout
from colonnade.environment.encoding.palette import initial_palette, nearest, update_palette
from colonnade.environment.encoding.selection import best_subsets, choose_within_budget
from colonnade.environment.encoding.tiles import expand_cells, sum_cells
from colonnade.environment.encoding.two_level import MODES, Mode, TwoLevelMap, mask_words
from colonnade.environment.encoding.vectors import VectorSpace

#: Alternating rounds of choosing modes and updating the palette.
_ROUNDS = 6
#: Candidate palette entries of a tile.
_CANDIDATES = 32


@dataclass(frozen=True)
class _Choices:
    """Options of each tile with the current palette.

    Attributes:
        modes: Mode numbers that the tile size allows.
        errors: float64 [tiles, modes], weighted squared errors.
        members: For each mode the palette indices, intp [tiles, entries].
    """

    modes: list[int]
    errors: NDArray[np.float64]
    members: list[NDArray[np.intp]]


def encode_two_level(
    vectors: NDArray[np.float64], space: VectorSpace, layout: AttributeLayout, rounds: int = _ROUNDS
) -> TwoLevelMap:
    """Encode ``vectors``, float64 [height, width, 3]."""
    pixels = TilePixels(space.to_points(vectors), layout)
    flat = pixels.points.reshape(-1, 3)
    weights = pixels.weights.ravel()
    palette = _first_palette(pixels)
    for completed_rounds in range(rounds):
        words = space.words(space.from_points(palette))
        palette = space.to_points(space.vectors(words))
        last = completed_rounds == rounds - 1
        choices = _choices(pixels, palette, rounds=2 if last else 1)
        sizes = np.array([MODES[number].words for number in choices.modes])
        chosen = choose_within_budget(choices.errors, sizes, layout.heap_words)
        if not last:
            index = _indices(pixels, palette, choices, chosen).ravel()
            palette = update_palette(palette, flat, weights, index, ((flat - palette[index]) ** 2).sum(axis=1))
    return _written(pixels, words, palette, choices, chosen)


def _first_palette(pixels: TilePixels) -> NDArray[np.float64]:
    """Fit the first palette to the means of 2x2 pixels."""
    halves = pixels.layout.tile_size // 2
    weights = sum_cells(pixels.weights, halves).ravel()
    sums = sum_cells(pixels.points * pixels.weights[..., np.newaxis], halves).reshape(-1, 3)
    used = weights > 0
    return initial_palette(sums[used] / weights[used, np.newaxis], weights[used], pixels.layout.palette_size)


def _candidates(pixels: TilePixels, palette: NDArray[np.float64]) -> NDArray[np.intp]:
    """The palette entries nearest to most pixels of each tile: intp [tiles, candidates]."""
    tiles = len(pixels.points)
    index, _ = nearest(pixels.points.reshape(-1, 3), palette)
    slot = np.arange(tiles).repeat(index.size // tiles) * len(palette) + index
    votes = np.bincount(slot, pixels.weights.ravel(), tiles * len(palette)).reshape(tiles, -1)
    # The distance from the tile's mean breaks ties, and orders entries without votes
    distance = ((pixels.means[:, np.newaxis] - palette) ** 2).sum(axis=2)
    order = np.argsort(-votes + 1e-9 * distance / (1.0 + distance), axis=1, kind="stable")
    return order[:, : min(_CANDIDATES, len(palette))]


def _choices(pixels: TilePixels, palette: NDArray[np.float64], rounds: int) -> _Choices:
    """Find every mode's best entries in every tile."""
    candidates = _candidates(pixels, palette)
    modes = [number for number, mode in enumerate(MODES) if mode.cells <= pixels.layout.tile_size]
    errors = np.empty((len(pixels.points), len(modes)))
    members: list[NDArray[np.intp]] = [np.empty(0, np.intp)] * len(modes)
    for cells in sorted({MODES[number].cells for number in modes}):
        costs = pixels.cell_costs(cells, palette[candidates])
        for entries, (subset, total) in best_subsets(costs, (2, 4), rounds).items():
            slot = modes.index(MODES.index(Mode(entries, cells)))
            errors[:, slot] = total
            members[slot] = np.take_along_axis(candidates, subset, axis=1)
    return _Choices(modes, errors, members)


def _cell_choices(
    pixels: TilePixels, palette: NDArray[np.float64], members: NDArray[np.intp], cells: int, which: NDArray[np.intp]
) -> NDArray[np.int64]:
    """The best member for each cell: int64 [which, cells * cells]."""
    best: NDArray[np.int64] = pixels.cell_costs(cells, palette[members[which]], which).argmin(axis=2).astype(np.int64)
    return best


def _indices(
    pixels: TilePixels, palette: NDArray[np.float64], choices: _Choices, chosen: NDArray[np.intp]
) -> NDArray[np.intp]:
    """The palette index of each pixel: intp [tiles, size, size]."""
    index = np.empty(pixels.weights.shape, np.intp)
    for slot, number in enumerate(choices.modes):
        which = np.flatnonzero(chosen == slot)
        members = choices.members[slot]
        taken = _cell_choices(pixels, palette, members, MODES[number].cells, which)
        index[which] = expand_cells(np.take_along_axis(members[which], taken, axis=1), pixels.layout.tile_size)
    return index


def _written(
    pixels: TilePixels,
    words: NDArray[np.uint64],
    palette: NDArray[np.float64],
    choices: _Choices,
    chosen: NDArray[np.intp],
) -> TwoLevelMap:
    """Pack descriptors and heap, mode by mode."""
    descriptors = np.zeros(len(chosen), np.uint32)
    heap = np.zeros(pixels.layout.heap_words, np.uint16)
    top = 0
    for slot, number in enumerate(choices.modes):
        mode, members = MODES[number], choices.members[slot]
        which = np.flatnonzero(chosen == slot)
        masks = mask_words(_cell_choices(pixels, palette, members, mode.cells, which), mode.bits_per_cell)
        for tile, mask in zip(which, masks, strict=True):
            own = members[tile]
            pointer = top
            if mode.words:
                heap[top : top + mode.words] = [own[2] | own[3] << 8, *mask] if mode.entries == 4 else mask
                top += mode.words
            else:
                pointer = int(mask[0])
            descriptors[tile] = number | pointer << 3 | int(own[0]) << 16 | int(own[1]) << 24
    return TwoLevelMap(descriptors, words, heap)
