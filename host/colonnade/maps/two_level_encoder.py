"""Encodes a two-level map: a palette for the whole map and a mode for each tile.

Each round finds every mode's best entries and error in every tile, then the modes that minimise the weighted error
within the heap. Finally it updates the palette's entries to the means of their pixels. In the last rounds tiles share
words of the heap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.maps.cell_errors import TilePixels
from colonnade.maps.heap import pack_words
from colonnade.maps.layout import AttributeLayout
from colonnade.maps.palette import initial_palette, nearest, update_palette
from colonnade.maps.selection import best_subsets, choose_within_budget
from colonnade.maps.sharing import shared_words
from colonnade.maps.subdivision import Subdivided
from colonnade.maps.tiles import expand_cells, sum_cells
from colonnade.maps.two_level import MODES, Mode, TwoLevelMap
from colonnade.maps.two_level_sharing import errors_with, fitted
from colonnade.maps.vectors import VectorSpace

#: Alternating rounds of choosing modes and updating the palette.
_ROUNDS = 6
#: The last of these rounds, in which tiles share words: most of the time.
_SHARED_ROUNDS = 2
#: Candidate palette entries of a tile.
_CANDIDATES = 32
#: Tiles that have a mask in a heap so many times as large offer their words to all.
_LARGER_HEAP = 2


@dataclass(frozen=True)
class _Choices:
    """Options of each tile with the current palette.

    Attributes:
        candidates: intp [tiles, candidates], palette indices.
        modes: Mode numbers that the tile size allows; the first one is 0.
        errors: float64 [tiles, modes], weighted squared errors.
        members: For each mode the palette indices, intp [tiles, entries].
    """

    candidates: NDArray[np.intp]
    modes: list[int]
    errors: NDArray[np.float64]
    members: list[NDArray[np.intp]]

    def within(self, heap_words: int) -> NDArray[np.intp]:
        """For each tile the place of its mode in `modes`, with words of its own in a heap."""
        sizes = np.array([MODES[number].words for number in self.modes])
        return choose_within_budget(self.errors, sizes, heap_words)


def encode_two_level(
    vectors: NDArray[np.float64],
    space: VectorSpace,
    layout: AttributeLayout,
    rounds: int = _ROUNDS,
    shared_rounds: int = _SHARED_ROUNDS,
) -> TwoLevelMap:
    """Encode ``vectors``, float64 [height, width, 3]; tiles share words in the last ``shared_rounds`` rounds."""
    pixels = TilePixels(space.to_points(vectors), layout)
    flat = pixels.points.reshape(-1, 3)
    weights = pixels.weights.ravel()
    palette = _first_palette(pixels)
    for completed_rounds in range(rounds):
        words = space.words(space.from_points(palette))
        palette = space.to_points(space.vectors(words))
        last = completed_rounds == rounds - 1
        choices = _choices(pixels, palette, rounds=2 if last else 1)
        is_shared = rounds - completed_rounds <= shared_rounds
        parts = (_shared if is_shared else _own)(pixels, palette, choices)
        if not last:
            index = _indices(pixels, parts)
            palette = update_palette(palette, flat, weights, index, ((flat - palette[index]) ** 2).sum(axis=1))
    return _written(parts, words, layout)


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
    return _Choices(candidates, modes, errors, members)


def _subdivided(
    pixels: TilePixels, palette: NDArray[np.float64], choices: _Choices, slot: int, tiles: NDArray[np.intp]
) -> Subdivided:
    """Tiles in one of the modes, each cell with its best entry."""
    mode, members = MODES[choices.modes[slot]], choices.members[slot][tiles]
    taken = pixels.cell_costs(mode.cells, palette[members], tiles).argmin(axis=2).astype(np.int64)
    return Subdivided(choices.modes[slot], mode, tiles, members, taken)


def _own(pixels: TilePixels, palette: NDArray[np.float64], choices: _Choices) -> list[Subdivided]:
    """The tiles of each mode within the heap, with words of their own."""
    chosen = choices.within(pixels.layout.heap_words)
    slots = range(len(choices.modes))
    return [_subdivided(pixels, palette, choices, slot, np.flatnonzero(chosen == slot)) for slot in slots]


def _shared(pixels: TilePixels, palette: NDArray[np.float64], choices: _Choices) -> list[Subdivided]:
    """The tiles of each mode within the heap, with words that they share."""
    chosen, larger = (choices.within(times * pixels.layout.heap_words) for times in (1, _LARGER_HEAP))
    uses = np.bincount(_indices(pixels, _own(pixels, palette, choices)), minlength=len(palette))
    ranks = uses.argsort(kind="stable").argsort()
    tiles = np.flatnonzero((chosen > 0) | (larger > 0))
    slots = range(1, len(choices.modes))
    free, users = shared_words(
        choices.errors[:, 0],
        [_subdivided(pixels, palette, choices, slot, tiles).ordered(ranks) for slot in slots],
        [chosen[tiles] == slot for slot in slots],
        lambda words: errors_with(words, pixels, palette, choices.candidates),
        pixels.layout.heap_words,
    )
    flat = _subdivided(pixels, palette, choices, 0, free)
    return [flat, *(fitted(part, pixels, palette, choices.candidates) for part in users)]


def _indices(pixels: TilePixels, parts: list[Subdivided]) -> NDArray[np.intp]:
    """The palette index of each pixel, tile by tile: intp [pixels]."""
    index = np.empty(pixels.weights.shape, np.intp)
    for part in parts:
        index[part.tiles] = expand_cells(part.indices, pixels.layout.tile_size)
    return index.ravel()


def _written(parts: list[Subdivided], words: NDArray[np.uint64], layout: AttributeLayout) -> TwoLevelMap:
    """Pack descriptors and heap."""
    heap, pointers = pack_words([part.words() for part in parts if part.mode.words], layout.heap_words)
    pointers = [parts[0].words()[:, 0].astype(np.int64), *pointers]
    descriptors = np.zeros(layout.tiles, np.uint32)
    for part, pointer in zip(parts, pointers, strict=True):
        entries = part.members[:, 0] << 16 | part.members[:, 1] << 24
        descriptors[part.tiles] = part.number | pointer << 3 | entries
    return TwoLevelMap(descriptors, words, heap)
