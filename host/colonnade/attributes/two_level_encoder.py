"""Makes a two-level map: a palette for the whole map, a mode for each tile.

In turns: with a palette, every mode's best entries and error in every tile; the modes that minimise the weighted error
within the heap; with these, the palette's entries as means of the pixels that they stand for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.attributes.choose import best_subsets, within_budget
from colonnade.attributes.layout import AttributeLayout
from colonnade.attributes.palette import first_palette, nearest, updated
from colonnade.attributes.tiles import cut, pooled, present, spread_cells
from colonnade.attributes.two_level import MODES, Mode, TwoLevelMap, mask_words
from colonnade.attributes.vectors import VectorSpace

#: A tile's error counts for 1 / (variance + this), on the scale of 8 bits: an error shows less in a busy tile.
TEXTURE_MASKING = 58.0
#: Turns of modes and palette.
_TURNS = 6
#: Palette entries that are tried in a tile.
_CANDIDATES = 32


@dataclass(frozen=True)
class _Pixels:
    """A map as the encoder sees it.

    Attributes:
        points: float64 [tiles, size, size, 3].
        weights: float64 [tiles, size, size]: 0 beyond the map's edge.
        layout: Its sizes.
    """

    points: NDArray[np.float64]
    weights: NDArray[np.float64]
    layout: AttributeLayout


@dataclass(frozen=True)
class _Choices:
    """What a palette allows.

    Attributes:
        modes: Numbers of the modes that the tile size allows.
        errors: float64 [tiles, modes], weighted.
        members: For each mode intp [tiles, entries], palette indices.
    """

    modes: list[int]
    errors: NDArray[np.float64]
    members: list[NDArray[np.intp]]


def encode_two_level(
    vectors: NDArray[np.float64], space: VectorSpace, layout: AttributeLayout, turns: int = _TURNS
) -> TwoLevelMap:
    """The map of ``vectors``, float64 [height, width, 3]."""
    pixels = _pixels(space.spread(vectors), layout)
    flat = pixels.points.reshape(-1, 3)
    weights = pixels.weights.ravel()
    halves = pooled(pixels.weights, layout.tile_size // 2).ravel()
    means = pooled(pixels.points * pixels.weights[..., np.newaxis], layout.tile_size // 2).reshape(-1, 3)
    used = halves > 0
    palette = first_palette(means[used] / halves[used, np.newaxis], halves[used], layout.palette_size)
    for turn in range(turns):
        words = space.words(space.gathered(palette))
        palette = space.spread(space.vectors(words))
        choices = _choices(pixels, palette, rounds=1 if turn < turns - 1 else 2)
        chosen = _budgeted(choices, layout)
        index = _indices(pixels, palette, choices, chosen)
        if turn < turns - 1:
            difference = flat - palette[index.ravel()]
            palette = updated(palette, flat, weights, index.ravel(), (difference**2).sum(axis=1))
    return _written(pixels, words, palette, choices, chosen)


def _pixels(points: NDArray[np.float64], layout: AttributeLayout) -> _Pixels:
    tiles, inside = cut(points, layout), present(layout)
    count = inside.sum(axis=(1, 2))[:, np.newaxis]
    mean = (tiles * inside[..., np.newaxis]).sum(axis=(1, 2)) / count
    spread = ((tiles - mean[:, np.newaxis, np.newaxis]) ** 2 * inside[..., np.newaxis]).sum(axis=(1, 2)) / count
    weight = 1.0 / (spread.mean(axis=1) + TEXTURE_MASKING)
    return _Pixels(tiles, inside * weight[:, np.newaxis, np.newaxis], layout)


def _cell_costs(pixels: _Pixels, cells: int, entries: NDArray[np.float64]) -> NDArray[np.float32]:
    """Weighted squared error of each cell for each of its tile's entries: float32 [tiles, cells * cells, entries].

    ``entries`` is float64 [tiles, entries, 3]. Sums over a cell suffice: S|x|^2 - 2 p . Sx + |p|^2 S1.
    """
    weights = pooled(pixels.weights, cells)
    sums = pooled(pixels.points * pixels.weights[..., np.newaxis], cells)
    squares = pooled((pixels.points**2).sum(axis=3) * pixels.weights, cells)
    lengths = (entries**2).sum(axis=2)
    costs = squares[..., np.newaxis] + weights[..., np.newaxis] * lengths[:, np.newaxis, :]
    costs -= 2.0 * (sums @ entries.transpose(0, 2, 1))
    return costs.astype(np.float32)


def _candidates(pixels: _Pixels, palette: NDArray[np.float64]) -> NDArray[np.intp]:
    """The palette entries that most pixels of each tile are nearest to: intp [tiles, candidates]."""
    tiles = len(pixels.points)
    index, _ = nearest(pixels.points.reshape(-1, 3), palette)
    place = np.arange(tiles).repeat(index.size // tiles) * len(palette) + index
    votes = np.bincount(place, pixels.weights.ravel(), tiles * len(palette)).reshape(tiles, -1)
    # Ties, and tiles of few colours, by the distance from the tile's mean
    weight = pixels.weights.sum(axis=(1, 2))[:, np.newaxis]
    mean = (pixels.points * pixels.weights[..., np.newaxis]).sum(axis=(1, 2)) / weight
    distance = ((mean[:, np.newaxis] - palette) ** 2).sum(axis=2)
    order = np.argsort(-votes + 1e-9 * distance / (1.0 + distance), axis=1, kind="stable")
    return order[:, : min(_CANDIDATES, len(palette))]


def _choices(pixels: _Pixels, palette: NDArray[np.float64], rounds: int) -> _Choices:
    candidates = _candidates(pixels, palette)
    modes = [number for number, mode in enumerate(MODES) if mode.cells <= pixels.layout.tile_size]
    errors = np.empty((len(pixels.points), len(modes)))
    members: list[NDArray[np.intp]] = [np.empty(0, np.intp)] * len(modes)
    for cells in sorted({MODES[number].cells for number in modes}):
        costs = _cell_costs(pixels, cells, palette[candidates])
        for entries, (subset, total) in best_subsets(costs, (2, 4), rounds).items():
            place = modes.index(MODES.index(Mode(entries, cells)))
            errors[:, place] = total
            members[place] = np.take_along_axis(candidates, subset, axis=1)
    return _Choices(modes, errors, members)


def _budgeted(choices: _Choices, layout: AttributeLayout) -> NDArray[np.intp]:
    sizes = np.array([MODES[number].words for number in choices.modes])
    return within_budget(choices.errors, sizes, layout.heap_words)


def _cell_choices(
    pixels: _Pixels, palette: NDArray[np.float64], members: NDArray[np.intp], cells: int, which: NDArray[np.intp]
) -> NDArray[np.int64]:
    """Which of its tile's members each cell takes: int64 [which, cells * cells]."""
    part = _Pixels(pixels.points[which], pixels.weights[which], pixels.layout)
    best: NDArray[np.int64] = _cell_costs(part, cells, palette[members[which]]).argmin(axis=2).astype(np.int64)
    return best


def _indices(
    pixels: _Pixels, palette: NDArray[np.float64], choices: _Choices, chosen: NDArray[np.intp]
) -> NDArray[np.intp]:
    """The palette index of every pixel: intp [tiles, size, size]."""
    index = np.empty(pixels.weights.shape, np.intp)
    for place, number in enumerate(choices.modes):
        which = np.flatnonzero(chosen == place)
        members = choices.members[place]
        taken = _cell_choices(pixels, palette, members, MODES[number].cells, which)
        index[which] = spread_cells(np.take_along_axis(members[which], taken, axis=1), pixels.layout.tile_size)
    return index


def _written(
    pixels: _Pixels,
    words: NDArray[np.uint64],
    palette: NDArray[np.float64],
    choices: _Choices,
    chosen: NDArray[np.intp],
) -> TwoLevelMap:
    descriptors = np.zeros(len(chosen), np.uint32)
    heap = np.zeros(pixels.layout.heap_words, np.uint16)
    top = 0
    for place, number in enumerate(choices.modes):
        mode, members = MODES[number], choices.members[place]
        which = np.flatnonzero(chosen == place)
        taken = _cell_choices(pixels, palette, members, mode.cells, which)
        masks = mask_words(taken, mode.bits_a_cell)
        for tile, mask in zip(which, masks, strict=True):
            own = members[tile]
            content = [own[2] | own[3] << 8, *mask] if mode.entries == 4 else list(mask)
            pointer = top
            if mode.words:
                heap[top : top + mode.words] = content
                top += mode.words
            else:
                pointer = int(mask[0])
            descriptors[tile] = number | pointer << 3 | int(own[0]) << 16 | int(own[1]) << 24
    return TwoLevelMap(descriptors, words, heap)
