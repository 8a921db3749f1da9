"""The plane map: which of the shared planes a pixel lies on.

A descriptor, low bit first: mode (3), plane id or pointer (13).

| mode | ids | cells | words in the heap |
|---|---|---|---|
| 0 | 1, in the descriptor | | 0 |
| 1 | 2 | 4x4 | ids (low byte id 0, high byte id 1), mask |
| 2 | 2 | 8x8 | ids, 4 of mask |
| 3 | 4 | 4x4 | 2 of ids, 2 of mask |
| 4 | 4 | 8x8 | 2 of ids, 8 of mask |
| 5 | 2 | 16x16 | ids, 16 of mask |
| 6 | 4 | 16x16 | 2 of ids, 32 of mask |

Cells are numbered, and masks filled, as in the two-level map. Modes 5 and 6 occur where `plane_cells` is 16.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.environment.encoding.layout import POINTER_BITS, AttributeLayout
from colonnade.environment.encoding.planes import Picture, unpacked_planes


@dataclass(frozen=True)
class PlaneMode:
    """How a tile is divided.

    Attributes:
        ids: Planes in it: 1, 2 or 4.
        cells: Cells on its edge.
    """

    ids: int
    cells: int

    @property
    def bits_a_cell(self) -> int:
        """Mask bits that choose a cell's plane."""
        return self.ids // 2

    @property
    def id_words(self) -> int:
        """Words that hold the ids."""
        return self.ids // 2

    @property
    def words(self) -> int:
        """Words in the heap."""
        return self.id_words + self.cells * self.cells * self.bits_a_cell // 16


#: By number.
PLANE_MODES = (
    PlaneMode(1, 1),
    PlaneMode(2, 4),
    PlaneMode(2, 8),
    PlaneMode(4, 4),
    PlaneMode(4, 8),
    PlaneMode(2, 16),
    PlaneMode(4, 16),
)


@dataclass(frozen=True)
class PlaneMap:
    """Memory contents of the planes.

    Attributes:
        descriptors: uint16 [tiles].
        planes: uint64 [planes]; the last one is 0: w = 0, infinitely far away.
        heap: uint16 [plane_heap_words].
        shell: uint64 [shell_planes, 3], 144 bits each, low word first: plane, albedo, normal; all zero if unused.
        depth_unit: Metres: w is this divided by the depth.
    """

    descriptors: NDArray[np.uint16]
    planes: NDArray[np.uint64]
    heap: NDArray[np.uint16]
    shell: NDArray[np.uint64]
    depth_unit: float

    def memories(self) -> dict[str, NDArray[np.unsignedinteger]]:
        """Words of each memory."""
        return {"descriptors": self.descriptors, "planes": self.planes, "heap": self.heap, "shell": self.shell}

    def ids_at(self, u: NDArray[np.int64], v: NDArray[np.int64], layout: AttributeLayout) -> NDArray[np.int64]:
        """Plane ids of pixels (u, v), of any shape; inside the map."""
        size = layout.tile_size
        descriptor = self.descriptors[(v // size) * layout.tile_columns + u // size].astype(np.int64)
        mode, pointer = descriptor & 7, (descriptor >> 3) & ((1 << POINTER_BITS) - 1)
        kinds = np.array([[m.cells, m.bits_a_cell, m.id_words] for m in PLANE_MODES], dtype=np.int64)
        cells, bits, id_words = np.moveaxis(kinds[mode], -1, 0)
        edge = size // cells
        place = ((v % size) // edge * cells + (u % size) // edge) * bits
        heap = np.append(self.heap, np.uint16(0)).astype(np.int64)
        last = heap.size - 1
        mask = heap[np.minimum(pointer + id_words + (place >> 4), last)]
        choice = np.where(mode == 0, 0, (mask >> (place & 15)) & ((1 << bits) - 1))
        ids = heap[np.minimum(pointer + (choice >> 1), last)] >> (choice & 1) * 8 & 255
        chosen: NDArray[np.int64] = np.where(mode == 0, pointer, ids)
        return chosen

    def ids(self, layout: AttributeLayout) -> NDArray[np.int64]:
        """Plane ids of all pixels, int64 [height, width]."""
        v, u = np.mgrid[: layout.height, : layout.width]
        return self.ids_at(u, v, layout)

    def inverse_depth(self, layout: AttributeLayout, picture: Picture) -> NDArray[np.float64]:
        """w of every pixel's centre on its plane, float64 [height, width]."""
        planes = unpacked_planes(self.planes)[self.ids(layout)]
        w: NDArray[np.float64] = np.einsum("yxc,yxc->yx", planes, picture.basis())
        return w

    def depth(self, layout: AttributeLayout, picture: Picture) -> NDArray[np.float64]:
        """Metres along z of every pixel's centre; infinite where w is not positive."""
        w = self.inverse_depth(layout, picture)
        return np.where(w > 0, self.depth_unit / np.maximum(w, 1e-12), np.inf)
