"""The two-level map: a descriptor for each tile, and masks of two or four palette entries in a heap.

A descriptor, low bit first: mode (3), pointer (13), entry 0 (8), entry 1 (8).

| mode | entries | cells | mask, words | location |
|---|---|---|---|---|
| 0 | 2 | 2x2 | 4 bits | in the pointer's low bits |
| 1, 2, 3 | 2 | 4x4, 8x8, 16x16 | 1, 4, 16 | at the pointer |
| 4, 5, 6, 7 | 4 | 2x2, 4x4, 8x8, 16x16 | 1, 2, 8, 32 | after a word with entries 2 (low byte) and 3 |

Cells of a tile are numbered row by row. Cell c uses the mask's bit c (two entries) or bits 2c and 2c + 1 (four),
counted from the low bit of the first word. A lookup reads a descriptor, up to two heap words, and a palette entry.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.maps.layout import POINTER_BITS, AttributeLayout
from colonnade.maps.vectors import VectorSpace


@dataclass(frozen=True)
class Mode:
    """A subdivision of a tile.

    Attributes:
        entries: Number of palette entries, 2 or 4.
        cells: Cells on the tile's edge.
    """

    entries: int
    cells: int

    @property
    def bits_per_cell(self) -> int:
        """Mask bits per cell, which choose its entry."""
        return self.entries // 2

    @property
    def mask_words(self) -> int:
        """Heap words of the mask."""
        if self.entries == 2 and self.cells == 2:
            return 0
        return -(-self.cells * self.cells * self.bits_per_cell // 16)

    @property
    def in_descriptor(self) -> int:
        """Entries in the descriptor."""
        return 2

    @property
    def words(self) -> int:
        """Heap words of the mask and of entries 2 and 3."""
        return self.mask_words + (self.entries == 4)


#: Modes by number.
MODES = tuple(Mode(entries, cells) for entries in (2, 4) for cells in (2, 4, 8, 16))


@dataclass(frozen=True)
class TwoLevelMap:
    """Contents of one map's memories.

    Attributes:
        descriptors: uint32 [tiles].
        palette: uint64 [palette_size], vectors of three fields.
        heap: uint16 [heap_words].
    """

    descriptors: NDArray[np.uint32]
    palette: NDArray[np.uint64]
    heap: NDArray[np.uint16]

    def memories(self) -> dict[str, NDArray[np.unsignedinteger]]:
        """Words of each memory."""
        return {"descriptors": self.descriptors, "palette": self.palette, "heap": self.heap}

    def entries_at(self, u: NDArray[np.int64], v: NDArray[np.int64], layout: AttributeLayout) -> NDArray[np.int64]:
        """Palette indices of pixels (u, v) in the map; arrays of any shape."""
        size = layout.tile_size
        descriptor = self.descriptors[(v // size) * layout.tile_columns + u // size].astype(np.int64)
        mode, pointer = descriptor & 7, (descriptor >> 3) & ((1 << POINTER_BITS) - 1)
        kinds = np.array([[m.cells, m.bits_per_cell, m.entries == 4] for m in MODES], dtype=np.int64)
        cells, bits, four = np.moveaxis(kinds[mode], -1, 0)
        edge = size // cells
        cell = (v % size) // edge * cells + (u % size) // edge
        bit = cell * bits
        heap = np.append(self.heap, np.uint16(0)).astype(np.int64)
        last = heap.size - 1
        word = heap[np.minimum(pointer + four + (bit >> 4), last)]
        word = np.where(mode == 0, pointer, word)
        choice = (word >> (bit & 15)) & ((1 << bits) - 1)
        more = heap[np.minimum(np.where(four == 1, pointer, last), last)]
        entries = np.stack([(descriptor >> 16) & 255, (descriptor >> 24) & 255, more & 255, more >> 8])
        chosen: NDArray[np.int64] = np.take_along_axis(entries, choice[np.newaxis], axis=0)[0]
        return chosen

    def at(
        self, u: NDArray[np.int64], v: NDArray[np.int64], layout: AttributeLayout, space: VectorSpace
    ) -> NDArray[np.float64]:
        """Vectors of pixels (u, v): float64 [..., 3]."""
        return space.vectors(self.palette)[self.entries_at(u, v, layout)]

    def decoded(self, layout: AttributeLayout, space: VectorSpace) -> NDArray[np.float64]:
        """Decode the whole map: float64 [height, width, 3]."""
        v, u = np.mgrid[: layout.height, : layout.width]
        return self.at(u, v, layout, space)


def mask_words(choices: NDArray[np.int64], bits: int) -> NDArray[np.uint16]:
    """Pack the cells' choices, int64 [tiles, cells], into masks, uint16 [tiles, words]."""
    count, cells = choices.shape
    words = -(-cells * bits // 16)
    padded = np.zeros((count, words * 16 // bits), dtype=np.int64)
    padded[:, :cells] = choices
    shifts = np.arange(16 // bits) * bits
    packed: NDArray[np.uint16] = (padded.reshape(count, words, 16 // bits) << shifts).sum(axis=2).astype(np.uint16)
    return packed
