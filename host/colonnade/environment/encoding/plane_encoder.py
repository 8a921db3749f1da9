"""Encodes the plane map: planes shared by the whole map, and one, two or four of them for each tile.

The error of a pixel is the distance along the view ray, saturated at `_MAX_ERROR`. A wrong plane at a depth
discontinuity costs much more than a plane on a curved surface, so the heap serves discontinuities first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.environment.encoding.bounding_planes import choose_bounding_planes, pack_bounding_planes
from colonnade.environment.encoding.layout import AttributeLayout
from colonnade.environment.encoding.plane_fit import Samples, fit_planes, refit_planes, sample_pixels
from colonnade.environment.encoding.plane_map import PLANE_MODES, PlaneMap
from colonnade.environment.encoding.planes import PlaneProjection, pack_planes, unpack_planes
from colonnade.environment.encoding.selection import best_subsets, choose_within_budget
from colonnade.environment.encoding.tiles import expand_cells, inside_mask, join_tiles, split_tiles, sum_cells
from colonnade.environment.encoding.two_level import mask_words
from colonnade.environment.model import Environment

#: Largest error of a pixel, metres.
_MAX_ERROR = 0.5
#: Cells on a tile's edge in the search for candidates.
_COARSE = 8
#: Alternating rounds of choosing ids and refitting planes.
_ROUNDS = 3
#: Candidate planes of a tile.
_CANDIDATES = 12


@dataclass(frozen=True)
class _Choices:
    """Candidate planes of each tile, and the errors of its cells on them.

    Attributes:
        candidates: intp [tiles, candidates], plane ids.
        costs: float32 [tiles, finest * finest, candidates], sums of the pixels' errors.
        modes: Mode numbers that the layout allows.
        finest: Cells on a tile's edge in ``costs``.
    """

    candidates: NDArray[np.intp]
    costs: NDArray[np.float32]
    modes: list[int]
    finest: int

    def of_cells(self, cells: int, which: NDArray[np.intp] | slice = slice(None)) -> NDArray[np.float32]:
        """Costs of ``cells`` by ``cells`` cells of a tile: float32 [which, cells * cells, candidates]."""
        costs = self.costs[which]
        fine = costs.reshape(len(costs), self.finest, self.finest, costs.shape[2])
        coarse: NDArray[np.float32] = sum_cells(fine, cells)
        return coarse


def encode_planes(environment: Environment, layout: AttributeLayout, rounds: int = _ROUNDS) -> PlaneMap:
    """Encode the plane map of an environment."""
    projection = PlaneProjection.of(environment, depth_unit=float(environment.depth.min()))
    pixels = sample_pixels(environment, projection)
    planes = fit_planes(environment, projection, layout.infinite_plane)
    for completed_rounds in range(rounds):
        words = pack_planes(planes)
        planes = unpack_planes(words)
        choices = _choices(pixels, planes, layout)
        modes, members = _chosen(choices, layout)
        if completed_rounds < rounds - 1:
            planes = refit_planes(pixels, planes, _owners(modes, members, choices, layout))
    table = np.zeros(layout.planes, np.uint64)
    table[: layout.infinite_plane] = words
    descriptors, heap = _written(modes, members, choices, layout)
    shell = pack_bounding_planes(
        choose_bounding_planes(environment, projection, planes, layout.shell_planes), projection, layout
    )
    return PlaneMap(descriptors, table, heap, shell, projection.depth_unit)


def _choices(pixels: Samples, planes: NDArray[np.float64], layout: AttributeLayout) -> _Choices:
    """Choose the candidate planes of each tile greedily."""
    inside = inside_mask(layout).astype(np.float32)
    index = split_tiles(np.arange(len(pixels.w)).reshape(layout.height, layout.width), layout)
    finest, tried = layout.plane_cells, min(_CANDIDATES, len(planes))
    candidates = np.empty((layout.tiles, tried), np.intp)
    costs = np.empty((layout.tiles, finest * finest, tried), np.float32)
    for first in range(0, layout.tiles, 16):
        part = slice(first, min(first + 16, layout.tiles))
        errors = np.minimum(pixels.part(index[part].ravel()).errors(planes), np.float32(_MAX_ERROR))
        shaped = errors.reshape(*index[part].shape, len(planes)) * inside[part, ..., np.newaxis]
        candidates[part] = best_subsets(sum_cells(shaped, _COARSE), (tried,), rounds=0)[tried][0]
        candidate_errors = np.take_along_axis(shaped, candidates[part][:, np.newaxis, np.newaxis], axis=3)
        costs[part] = sum_cells(candidate_errors, finest)
    modes = [number for number, mode in enumerate(PLANE_MODES) if mode.cells <= finest]
    return _Choices(candidates, costs, modes, finest)


def _chosen(choices: _Choices, layout: AttributeLayout) -> tuple[NDArray[np.intp], dict[int, NDArray[np.intp]]]:
    """Choose each tile's mode within the heap; also returns for each mode the members [tiles, ids]."""
    errors = np.empty((layout.tiles, len(choices.modes)))
    members: dict[int, NDArray[np.intp]] = {}
    for cells in sorted({PLANE_MODES[number].cells for number in choices.modes}):
        numbers = [number for number in choices.modes if PLANE_MODES[number].cells == cells]
        counts = tuple(PLANE_MODES[number].ids for number in numbers)
        subsets = best_subsets(choices.of_cells(cells), counts, rounds=2)
        for number, count in zip(numbers, counts, strict=True):
            members[number], errors[:, choices.modes.index(number)] = subsets[count]
    sizes = np.array([PLANE_MODES[number].words for number in choices.modes])
    return np.array(choices.modes)[choose_within_budget(errors, sizes, layout.plane_heap_words)], members


def _cell_choices(
    choices: _Choices, number: int, which: NDArray[np.intp], members: NDArray[np.intp]
) -> NDArray[np.int64]:
    """The best member for each cell, for tiles of one mode: int64 [which, cells * cells]."""
    costs = choices.of_cells(PLANE_MODES[number].cells, which)
    member_costs = np.take_along_axis(costs, members[which][:, np.newaxis, :], axis=2)
    taken: NDArray[np.int64] = member_costs.argmin(axis=2).astype(np.int64)
    return taken


def _ids(choices: _Choices, which: NDArray[np.intp], members: NDArray[np.intp]) -> NDArray[np.intp]:
    """Plane ids of the tiles' members: intp [which, ids]."""
    return np.take_along_axis(choices.candidates[which], members[which], axis=1)


def _owners(
    modes: NDArray[np.intp], members: dict[int, NDArray[np.intp]], choices: _Choices, layout: AttributeLayout
) -> NDArray[np.intp]:
    """The plane id of each pixel in row-major order: intp [height * width]."""
    size = layout.tile_size
    owner = np.empty((layout.tiles, size, size), np.intp)
    for number in choices.modes:
        which = np.flatnonzero(modes == number)
        taken = _cell_choices(choices, number, which, members[number])
        owner[which] = expand_cells(np.take_along_axis(_ids(choices, which, members[number]), taken, axis=1), size)
    pixels: NDArray[np.intp] = join_tiles(owner, layout).ravel()
    return pixels


def _written(
    modes: NDArray[np.intp], members: dict[int, NDArray[np.intp]], choices: _Choices, layout: AttributeLayout
) -> tuple[NDArray[np.uint16], NDArray[np.uint16]]:
    """Pack descriptors and heap."""
    descriptors = np.zeros(layout.tiles, np.uint16)
    heap = np.zeros(layout.plane_heap_words, np.uint16)
    top = 0
    for number in choices.modes:
        mode, which = PLANE_MODES[number], np.flatnonzero(modes == number)
        ids = _ids(choices, which, members[number])
        if not mode.words:
            descriptors[which] = number | ids[:, 0] << 3
            continue
        masks = mask_words(_cell_choices(choices, number, which, members[number]), mode.bits_per_cell)
        for tile, own, mask in zip(which, ids, masks, strict=True):
            heap[top : top + mode.words] = [*(own[0::2] | own[1::2] << 8), *mask]
            descriptors[tile] = number | top << 3
            top += mode.words
    return descriptors, heap
