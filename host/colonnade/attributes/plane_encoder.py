"""Makes the plane map: shared planes, and for each tile the one, two or four of them that its cells lie on.

The error of a cell is metres along the view ray, saturated at `_WRONG`: at the edge of a near thing a wrong plane costs
that much, far more than a bent surface does, so the heap goes to depth's discontinuities first.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from colonnade.attributes.choose import best_subsets, within_budget
from colonnade.attributes.layout import AttributeLayout
from colonnade.attributes.plane_fit import Samples, fitted_planes, refitted, samples_of
from colonnade.attributes.plane_map import PLANE_MODES, PlaneMap
from colonnade.attributes.plane_numbers import Picture, packed_planes, unpacked_planes
from colonnade.attributes.shell import packed_shell, room_shell
from colonnade.attributes.tiles import cut, joined, pooled, present, spread_cells
from colonnade.attributes.two_level import mask_words
from colonnade.room.room import Room

#: The error of a pixel on a wrong plane, metres.
_WRONG = 0.5
#: Turns of ids and planes.
_TURNS = 3
#: Cells on the edge of a tile that errors are summed over first: the finest that a mode has.
_FINEST = 8


def encode_planes(room: Room, layout: AttributeLayout, turns: int = _TURNS) -> PlaneMap:
    """The plane map of a room."""
    picture = Picture.of(room, depth_unit=float(room.depth.min()))
    pixels = samples_of(room, picture)
    planes = fitted_planes(room, picture, layout.nothing)
    for turn in range(turns):
        words = packed_planes(planes)
        planes = unpacked_planes(words)
        costs = _cell_costs(pixels, planes, layout)
        modes, ids = _chosen(costs, layout)
        if turn < turns - 1:
            planes = refitted(pixels, planes, _owners(modes, ids, costs, layout))
    table = np.zeros(layout.planes, np.uint64)
    table[: layout.nothing] = words
    descriptors, heap = _written(modes, ids, costs, layout)
    shell = packed_shell(room_shell(room, picture, planes, layout.shell_planes), picture, layout)
    return PlaneMap(descriptors, table, heap, shell, picture.depth_unit)


def _cell_costs(pixels: Samples, planes: NDArray[np.float64], layout: AttributeLayout) -> NDArray[np.float32]:
    """Sums of the pixels' errors over the finest cells: float32 [tiles, cells, planes]."""
    inside = present(layout).astype(np.float32)
    shape = (layout.height, layout.width)
    index = cut(np.arange(len(pixels.w)).reshape(shape), layout)
    costs = np.empty((layout.tiles, _FINEST * _FINEST, len(planes)), np.float32)
    for first in range(0, layout.tiles, 16):
        part = slice(first, first + 16)
        errors = np.minimum(pixels.part(index[part].ravel()).errors(planes), np.float32(_WRONG))
        weighted = errors.reshape(*index[part].shape, -1) * inside[part, ..., np.newaxis]
        costs[part] = pooled(weighted, _FINEST)
    return costs


def _of_cells(costs: NDArray[np.float32], cells: int) -> NDArray[np.float32]:
    """Costs of coarser cells: float32 [tiles, cells * cells, planes]."""
    fine: NDArray[np.float32] = costs.reshape(len(costs), _FINEST, _FINEST, costs.shape[2])
    coarse: NDArray[np.float32] = pooled(fine, cells)
    return coarse


def _chosen(costs: NDArray[np.float32], layout: AttributeLayout) -> tuple[NDArray[np.intp], list[NDArray[np.intp]]]:
    """The mode of each tile, and for each mode the ids [tiles, ids] that it would have."""
    errors = np.empty((len(costs), len(PLANE_MODES)))
    ids: list[NDArray[np.intp]] = [np.empty(0, np.intp)] * len(PLANE_MODES)
    for cells in sorted({mode.cells for mode in PLANE_MODES}):
        numbers = [number for number, mode in enumerate(PLANE_MODES) if mode.cells == cells]
        counts = tuple(PLANE_MODES[number].ids for number in numbers)
        subsets = best_subsets(_of_cells(costs, cells), counts, rounds=2)
        for number, count in zip(numbers, counts, strict=True):
            ids[number], errors[:, number] = subsets[count]
    sizes = np.array([mode.words for mode in PLANE_MODES])
    return within_budget(errors, sizes, layout.plane_heap_words), ids


def _cell_choices(
    costs: NDArray[np.float32], number: int, which: NDArray[np.intp], ids: NDArray[np.intp]
) -> NDArray[np.int64]:
    """Which of its tile's ids each cell takes, for tiles of one mode: int64 [which, cells * cells]."""
    own = np.take_along_axis(_of_cells(costs[which], PLANE_MODES[number].cells), ids[which][:, np.newaxis, :], axis=2)
    taken: NDArray[np.int64] = own.argmin(axis=2).astype(np.int64)
    return taken


def _owners(
    modes: NDArray[np.intp], ids: list[NDArray[np.intp]], costs: NDArray[np.float32], layout: AttributeLayout
) -> NDArray[np.intp]:
    """The plane of every pixel of the map, row by row: intp [height * width]."""
    size = layout.tile_size
    owner = np.empty((layout.tiles, size, size), np.intp)
    for number in range(len(PLANE_MODES)):
        which = np.flatnonzero(modes == number)
        taken = _cell_choices(costs, number, which, ids[number])
        owner[which] = spread_cells(np.take_along_axis(ids[number][which], taken, axis=1), size)
    pixels: NDArray[np.intp] = joined(owner, layout).ravel()
    return pixels


def _written(
    modes: NDArray[np.intp], ids: list[NDArray[np.intp]], costs: NDArray[np.float32], layout: AttributeLayout
) -> tuple[NDArray[np.uint16], NDArray[np.uint16]]:
    """Descriptors and heap."""
    descriptors = np.zeros(layout.tiles, np.uint16)
    heap = np.zeros(layout.plane_heap_words, np.uint16)
    top = 0
    for number, mode in enumerate(PLANE_MODES):
        which = np.flatnonzero(modes == number)
        if not mode.words:
            descriptors[which] = number | ids[number][which, 0] << 3
            continue
        masks = mask_words(_cell_choices(costs, number, which, ids[number]), mode.bits_a_cell)
        for tile, mask in zip(which, masks, strict=True):
            own = ids[number][tile]
            heap[top : top + mode.words] = [*(own[0::2] | own[1::2] << 8), *mask]
            descriptors[tile] = number | top << 3
            top += mode.words
    return descriptors, heap
