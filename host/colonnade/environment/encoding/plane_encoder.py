"""Makes the plane map: shared planes, and for each tile the one, two or four of them that its cells lie on.

The error of a cell is metres along the view ray, saturated at `_WRONG`: at the edge of a near thing a wrong plane costs
that much, far more than a bent surface does, so the heap goes to depth's discontinuities first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.environment.encoding.bounding_planes import choose_bounding_planes, packed_shell
from colonnade.environment.encoding.layout import AttributeLayout
from colonnade.environment.encoding.plane_fit import Samples, fitted_planes, refitted, samples_of
from colonnade.environment.encoding.plane_map import PLANE_MODES, PlaneMap
from colonnade.environment.encoding.planes import Picture, packed_planes, unpacked_planes
from colonnade.environment.encoding.selection import best_subsets, within_budget
from colonnade.environment.encoding.tiles import cut, joined, pooled, present, spread_cells
from colonnade.environment.encoding.two_level import mask_words
from colonnade.environment.model import Environment

#: The error of a pixel on a wrong plane, metres.
_WRONG = 0.5
#: Cells on a tile's edge when candidates are sought.
_COARSE = 8
#: Turns of ids and planes.
_TURNS = 3
#: Planes that are tried in a tile: so many that together serve its cells best.
_CANDIDATES = 12


@dataclass(frozen=True)
class _Choices:
    """Planes that each tile may have, and what its cells would lose by them.

    Attributes:
        candidates: intp [tiles, candidates], plane ids.
        costs: float32 [tiles, finest cells, candidates], sums of the pixels' errors.
        modes: Numbers of the modes that the layout allows.
        finest: Cells on a tile's edge in ``costs``.
    """

    candidates: NDArray[np.intp]
    costs: NDArray[np.float32]
    modes: list[int]
    finest: int

    def of_cells(self, cells: int, which: NDArray[np.intp] | slice = slice(None)) -> NDArray[np.float32]:
        """Costs of coarser cells: float32 [which, cells * cells, candidates]."""
        costs = self.costs[which]
        fine = costs.reshape(len(costs), self.finest, self.finest, costs.shape[2])
        coarse: NDArray[np.float32] = pooled(fine, cells)
        return coarse


def encode_planes(environment: Environment, layout: AttributeLayout, turns: int = _TURNS) -> PlaneMap:
    """The plane map of a room."""
    picture = Picture.of(environment, depth_unit=float(environment.depth.min()))
    pixels = samples_of(environment, picture)
    planes = fitted_planes(environment, picture, layout.nothing)
    for turn in range(turns):
        words = packed_planes(planes)
        planes = unpacked_planes(words)
        choices = _choices(pixels, planes, layout)
        modes, members = _chosen(choices, layout)
        if turn < turns - 1:
            planes = refitted(pixels, planes, _owners(modes, members, choices, layout))
    table = np.zeros(layout.planes, np.uint64)
    table[: layout.nothing] = words
    descriptors, heap = _written(modes, members, choices, layout)
    shell = packed_shell(choose_bounding_planes(environment, picture, planes, layout.shell_planes), picture, layout)
    return PlaneMap(descriptors, table, heap, shell, picture.depth_unit)


def _choices(pixels: Samples, planes: NDArray[np.float64], layout: AttributeLayout) -> _Choices:
    """For each tile the planes that serve it best, chosen greedily."""
    inside = present(layout).astype(np.float32)
    index = cut(np.arange(len(pixels.w)).reshape(layout.height, layout.width), layout)
    finest, tried = layout.plane_cells, min(_CANDIDATES, len(planes))
    candidates = np.empty((layout.tiles, tried), np.intp)
    costs = np.empty((layout.tiles, finest * finest, tried), np.float32)
    for first in range(0, layout.tiles, 16):
        part = slice(first, min(first + 16, layout.tiles))
        errors = np.minimum(pixels.part(index[part].ravel()).errors(planes), np.float32(_WRONG))
        shaped = errors.reshape(*index[part].shape, len(planes)) * inside[part, ..., np.newaxis]
        candidates[part] = best_subsets(pooled(shaped, _COARSE), (tried,), rounds=0)[tried][0]
        own = np.take_along_axis(shaped, candidates[part][:, np.newaxis, np.newaxis], axis=3)
        costs[part] = pooled(own, finest)
    modes = [number for number, mode in enumerate(PLANE_MODES) if mode.cells <= finest]
    return _Choices(candidates, costs, modes, finest)


def _chosen(choices: _Choices, layout: AttributeLayout) -> tuple[NDArray[np.intp], dict[int, NDArray[np.intp]]]:
    """The mode of each tile, and for each mode the candidates [tiles, ids] that it would have."""
    errors = np.empty((layout.tiles, len(choices.modes)))
    members: dict[int, NDArray[np.intp]] = {}
    for cells in sorted({PLANE_MODES[number].cells for number in choices.modes}):
        numbers = [number for number in choices.modes if PLANE_MODES[number].cells == cells]
        counts = tuple(PLANE_MODES[number].ids for number in numbers)
        subsets = best_subsets(choices.of_cells(cells), counts, rounds=2)
        for number, count in zip(numbers, counts, strict=True):
            members[number], errors[:, choices.modes.index(number)] = subsets[count]
    sizes = np.array([PLANE_MODES[number].words for number in choices.modes])
    return np.array(choices.modes)[within_budget(errors, sizes, layout.plane_heap_words)], members


def _cell_choices(
    choices: _Choices, number: int, which: NDArray[np.intp], members: NDArray[np.intp]
) -> NDArray[np.int64]:
    """Which of its tile's members each cell takes, for tiles of one mode: int64 [which, cells * cells]."""
    costs = choices.of_cells(PLANE_MODES[number].cells, which)
    own = np.take_along_axis(costs, members[which][:, np.newaxis, :], axis=2)
    taken: NDArray[np.int64] = own.argmin(axis=2).astype(np.int64)
    return taken


def _ids(choices: _Choices, which: NDArray[np.intp], members: NDArray[np.intp]) -> NDArray[np.intp]:
    """Plane ids of tiles' members: intp [which, ids]."""
    return np.take_along_axis(choices.candidates[which], members[which], axis=1)


def _owners(
    modes: NDArray[np.intp], members: dict[int, NDArray[np.intp]], choices: _Choices, layout: AttributeLayout
) -> NDArray[np.intp]:
    """The plane of every pixel of the map, row by row: intp [height * width]."""
    size = layout.tile_size
    owner = np.empty((layout.tiles, size, size), np.intp)
    for number in choices.modes:
        which = np.flatnonzero(modes == number)
        taken = _cell_choices(choices, number, which, members[number])
        owner[which] = spread_cells(np.take_along_axis(_ids(choices, which, members[number]), taken, axis=1), size)
    pixels: NDArray[np.intp] = joined(owner, layout).ravel()
    return pixels


def _written(
    modes: NDArray[np.intp], members: dict[int, NDArray[np.intp]], choices: _Choices, layout: AttributeLayout
) -> tuple[NDArray[np.uint16], NDArray[np.uint16]]:
    """Descriptors and heap."""
    descriptors = np.zeros(layout.tiles, np.uint16)
    heap = np.zeros(layout.plane_heap_words, np.uint16)
    top = 0
    for number in choices.modes:
        mode, which = PLANE_MODES[number], np.flatnonzero(modes == number)
        ids = _ids(choices, which, members[number])
        if not mode.words:
            descriptors[which] = number | ids[:, 0] << 3
            continue
        masks = mask_words(_cell_choices(choices, number, which, members[number]), mode.bits_a_cell)
        for tile, own, mask in zip(which, ids, masks, strict=True):
            heap[top : top + mode.words] = [*(own[0::2] | own[1::2] << 8), *mask]
            descriptors[tile] = number | top << 3
            top += mode.words
    return descriptors, heap
