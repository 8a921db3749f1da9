"""Encodes the plane map: planes shared by the whole map, and one, two or four of them for each tile.

The error of a pixel is the distance along the view ray, saturated at `_MAX_ERROR`. A wrong plane at a depth
discontinuity costs much more than a plane on a curved surface, so the heap serves discontinuities first. Tiles with the
same planes may share words of the heap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.environment.model import Environment
from colonnade.maps.bounding_planes import choose_bounding_planes, pack_bounding_planes
from colonnade.maps.heap import pack_words
from colonnade.maps.layout import AttributeLayout
from colonnade.maps.plane_fit import Samples, fit_planes, refit_planes, sample_pixels
from colonnade.maps.plane_map import PLANE_MODES, PlaneMap
from colonnade.maps.planes import PlaneProjection, pack_planes, unpack_planes
from colonnade.maps.selection import best_subsets, choose_within_budget
from colonnade.maps.sharing import shared_words
from colonnade.maps.subdivision import Subdivided
from colonnade.maps.tiles import expand_cells, inside_mask, join_tiles, split_tiles, sum_cells

#: Largest error of a pixel, metres.
_MAX_ERROR = 0.5
#: Cells on a tile's edge in the search for candidates.
_COARSE = 8
#: Most cells on a tile's edge.
_FINEST = max(mode.cells for mode in PLANE_MODES)
#: Alternating rounds of choosing ids and refitting planes.
_ROUNDS = 3
#: Candidate planes of a tile.
_CANDIDATES = 12
#: Tiles that have a mask in a heap so many times as large offer their words to all.
_LARGER_HEAP = 2


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

    def errors_with(self, words: Subdivided) -> NDArray[np.float32]:
        """Errors of all tiles with words, float32 [words, tiles]; infinite if a plane is no candidate of the tile."""
        cells, count = words.mode.cells, self.candidates.shape[1]
        costs = self.of_cells(cells)
        errors = np.full((len(words.tiles), len(costs)), np.inf, np.float32)
        slots = np.full(words.indices.max(initial=self.candidates.max()) + 1, count)
        for tile, candidates in enumerate(self.candidates):
            slots[candidates] = np.arange(count)
            which = np.flatnonzero((slots[words.members] < count).all(axis=1))
            taken = slots[words.indices[which]]
            errors[which, tile] = np.take_along_axis(costs[tile].T, taken, axis=0).sum(axis=1)
            slots[candidates] = count
        return errors


def encode_planes(environment: Environment, layout: AttributeLayout, rounds: int = _ROUNDS) -> PlaneMap:
    """Encode the plane map of an environment."""
    words = encode_surfaces(environment, layout, rounds)
    bounding = encode_bounding(environment, layout, words["planes"])
    return PlaneMap(**words, **bounding, depth_unit=depth_unit_of(environment))


def depth_unit_of(environment: Environment) -> float:
    """The depth unit of an environment's plane map, metres."""
    return float(environment.depth.min())


def encode_surfaces(
    environment: Environment, layout: AttributeLayout, rounds: int = _ROUNDS
) -> dict[str, NDArray[np.unsignedinteger]]:
    """The words of a plane map but for the bounding planes, by memory; they do not depend on albedos."""
    projection = PlaneProjection.of(environment, depth_unit_of(environment))
    pixels = sample_pixels(environment, projection)
    planes = fit_planes(environment, projection, layout.infinite_plane)
    for completed_rounds in range(rounds):
        words = pack_planes(planes)
        planes = unpack_planes(words)
        choices = _choices(pixels, planes, layout)
        parts = _chosen(choices, layout)
        if completed_rounds < rounds - 1:
            planes = refit_planes(pixels, planes, _owners(parts, layout))
    table = np.zeros(layout.planes, np.uint64)
    table[: layout.infinite_plane] = words
    descriptors, heap = _written(parts, layout)
    return {"descriptors": descriptors, "planes": table, "heap": heap}


def encode_bounding(
    environment: Environment, layout: AttributeLayout, table: NDArray[np.unsignedinteger]
) -> dict[str, NDArray[np.unsignedinteger]]:
    """The words of the bounding planes, which are chosen among the planes of the table."""
    projection = PlaneProjection.of(environment, depth_unit_of(environment))
    planes = unpack_planes(table[: layout.infinite_plane])
    chosen = choose_bounding_planes(environment, projection, planes, layout.bounding_planes)
    return {"bounding": pack_bounding_planes(chosen, projection, layout)}


def _choices(pixels: Samples, planes: NDArray[np.float64], layout: AttributeLayout) -> _Choices:
    """Choose the candidate planes of each tile greedily."""
    inside = inside_mask(layout).astype(np.float32)
    index = split_tiles(np.arange(len(pixels.w)).reshape(layout.height, layout.width), layout)
    finest, tried = min(_FINEST, layout.tile_size), min(_CANDIDATES, len(planes))
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


def _chosen(choices: _Choices, layout: AttributeLayout) -> list[Subdivided]:
    """Choose each tile's mode and words within the heap; the tiles of each mode, with plane ids as members."""
    errors = np.empty((layout.tiles, len(choices.modes)))
    members: dict[int, NDArray[np.intp]] = {}
    for cells in sorted({PLANE_MODES[number].cells for number in choices.modes}):
        numbers = [number for number in choices.modes if PLANE_MODES[number].cells == cells]
        counts = tuple(PLANE_MODES[number].ids for number in numbers)
        subsets = best_subsets(choices.of_cells(cells), counts, rounds=2)
        for number, count in zip(numbers, counts, strict=True):
            members[number], errors[:, choices.modes.index(number)] = subsets[count]
    sizes = np.array([PLANE_MODES[number].words for number in choices.modes])
    chosen, larger = (
        choose_within_budget(errors, sizes, times * layout.plane_heap_words) for times in (1, _LARGER_HEAP)
    )
    tiles, order = np.flatnonzero((chosen > 0) | (larger > 0)), np.arange(layout.planes)
    flat, users = shared_words(
        errors[:, 0],
        [_subdivided(choices, number, tiles, members[number]).ordered(order) for number in choices.modes[1:]],
        [chosen[tiles] == slot for slot in range(1, len(choices.modes))],
        choices.errors_with,
        layout.plane_heap_words,
    )
    return [_subdivided(choices, 0, flat, members[0]), *(part.subdivided() for part in users)]


def _subdivided(choices: _Choices, number: int, tiles: NDArray[np.intp], members: NDArray[np.intp]) -> Subdivided:
    """Tiles in a mode, each cell with its best plane; ``members`` are intp [all tiles, ids], of the candidates."""
    costs = choices.of_cells(PLANE_MODES[number].cells, tiles)
    taken = np.take_along_axis(costs, members[tiles][:, np.newaxis, :], axis=2).argmin(axis=2).astype(np.int64)
    ids = np.take_along_axis(choices.candidates[tiles], members[tiles], axis=1)
    return Subdivided(number, PLANE_MODES[number], tiles, ids, taken)


def _owners(parts: list[Subdivided], layout: AttributeLayout) -> NDArray[np.intp]:
    """The plane id of each pixel in row-major order: intp [height * width]."""
    owner = np.empty((layout.tiles, layout.tile_size, layout.tile_size), np.intp)
    for part in parts:
        owner[part.tiles] = expand_cells(part.indices, layout.tile_size)
    pixels: NDArray[np.intp] = join_tiles(owner, layout).ravel()
    return pixels


def _written(parts: list[Subdivided], layout: AttributeLayout) -> tuple[NDArray[np.uint16], NDArray[np.uint16]]:
    """Pack descriptors and heap."""
    flat, *divided = parts
    heap, pointers = pack_words([part.words() for part in divided], layout.plane_heap_words)
    descriptors = np.zeros(layout.tiles, np.uint16)
    descriptors[flat.tiles] = flat.members[:, 0] << 3
    for part, pointer in zip(divided, pointers, strict=True):
        descriptors[part.tiles] = part.number | pointer << 3
    return descriptors, heap
