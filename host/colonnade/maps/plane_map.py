"""The plane map: assigns one of the shared planes to each pixel.

A descriptor, low bit first: mode (3), plane id or pointer (13).

| mode | ids | cells | heap words |
|---|---|---|---|
| 0 | 1, in the descriptor | | 0 |
| 1 | 2 | 4x4 | 1 of ids (low byte id 0, high byte id 1), 1 of mask |
| 2 | 2 | 8x8 | 1 of ids, 4 of mask |
| 3 | 4 | 4x4 | 2 of ids, 2 of mask |
| 4 | 4 | 8x8 | 2 of ids, 8 of mask |
| 5 | 2 | 16x16 | 1 of ids, 16 of mask |
| 6 | 4 | 16x16 | 2 of ids, 32 of mask |

Cells and masks are ordered as in the two-level map. Mode 7 is read as mode 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.common import fixed_order
from colonnade.maps.layout import POINTER_BITS, AttributeLayout
from colonnade.maps.planes import PlaneProjection, unpack_planes


@dataclass(frozen=True)
class PlaneMode:
    """A subdivision of a tile.

    Attributes:
        ids: Number of planes: 1, 2 or 4.
        cells: Cells on the tile's edge.
    """

    ids: int
    cells: int

    @property
    def bits_per_cell(self) -> int:
        """Mask bits per cell, which choose its plane."""
        return self.ids // 2

    @property
    def in_descriptor(self) -> int:
        """Ids in the descriptor."""
        return self.ids % 2

    @property
    def id_words(self) -> int:
        """Heap words of the ids."""
        return self.ids // 2

    @property
    def words(self) -> int:
        """Heap words of the ids and the mask."""
        return self.id_words + self.cells * self.cells * self.bits_per_cell // 16


#: Modes by number.
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
    """Contents of the planes' memories.

    Attributes:
        descriptors: uint16 [tiles].
        planes: uint64 [planes]; the last one is 0: w = 0, at infinity.
        heap: uint16 [plane_heap_words].
        bounding: uint64 [bounding_planes, 3], 144 bits each, low word first: plane, albedo, normal; all zero if unused.
        depth_unit: Depth of w = 1, metres: w = depth_unit / depth.
    """

    descriptors: NDArray[np.uint16]
    planes: NDArray[np.uint64]
    heap: NDArray[np.uint16]
    bounding: NDArray[np.uint64]
    depth_unit: float

    def memories(self) -> dict[str, NDArray[np.unsignedinteger]]:
        """Words of each memory."""
        return {"descriptors": self.descriptors, "planes": self.planes, "heap": self.heap, "bounding": self.bounding}

    def ids_at(self, u: NDArray[np.int64], v: NDArray[np.int64], layout: AttributeLayout) -> NDArray[np.int64]:
        """Plane ids of pixels (u, v) in the map; arrays of any shape."""
        size = layout.tile_size
        descriptor = self.descriptors[(v // size) * layout.tile_columns + u // size].astype(np.int64)
        mode, pointer = descriptor & 7, (descriptor >> 3) & ((1 << POINTER_BITS) - 1)
        kinds = np.array([[m.cells, m.bits_per_cell, m.id_words] for m in PLANE_MODES], dtype=np.int64)
        cells, bits, id_words = np.moveaxis(kinds[mode], -1, 0)
        edge = size // cells
        bit = ((v % size) // edge * cells + (u % size) // edge) * bits
        heap = np.append(self.heap, np.uint16(0)).astype(np.int64)
        last = heap.size - 1
        mask = heap[np.minimum(pointer + id_words + (bit >> 4), last)]
        choice = np.where(mode == 0, 0, (mask >> (bit & 15)) & ((1 << bits) - 1))
        ids = heap[np.minimum(pointer + (choice >> 1), last)] >> (choice & 1) * 8 & 255
        chosen: NDArray[np.int64] = np.where(mode == 0, pointer, ids)
        return chosen

    def ids(self, layout: AttributeLayout) -> NDArray[np.int64]:
        """Plane ids of all pixels, int64 [height, width]."""
        v, u = np.mgrid[: layout.height, : layout.width]
        return self.ids_at(u, v, layout)

    def inverse_depth(self, layout: AttributeLayout, projection: PlaneProjection) -> NDArray[np.float64]:
        """w of each pixel's centre on its plane, float64 [height, width]."""
        planes = unpack_planes(self.planes)[self.ids(layout)]
        w: NDArray[np.float64] = fixed_order.dot(planes, projection.basis())
        return w

    def depth(self, layout: AttributeLayout, projection: PlaneProjection) -> NDArray[np.float64]:
        """Depth of each pixel's centre, metres along z: float64 [height, width]; infinite where w is not positive."""
        w = self.inverse_depth(layout, projection)
        return np.where(w > 0, self.depth_unit / np.maximum(w, 1e-12), np.inf)
