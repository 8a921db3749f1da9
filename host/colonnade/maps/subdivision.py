"""Tiles of one mode, and the words of their masks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from colonnade.maps.two_level import mask_words


class TileMode(Protocol):
    """A mode of a two-level map or of the plane map."""

    @property
    def cells(self) -> int:
        """Cells on the tile's edge."""

    @property
    def bits_per_cell(self) -> int:
        """Mask bits per cell, which choose its member."""

    @property
    def in_descriptor(self) -> int:
        """Members that the descriptor holds; the others are in the heap."""

    @property
    def words(self) -> int:
        """Heap words of a tile."""


@dataclass(frozen=True)
class Subdivided:
    """Tiles of one mode.

    Attributes:
        number: Number of the mode.
        mode: The mode.
        tiles: intp [n].
        members: intp [n, members], palette entries or planes.
        taken: int64 [n, cells * cells], which member each cell has.
    """

    number: int
    mode: TileMode
    tiles: NDArray[np.intp]
    members: NDArray[np.intp]
    taken: NDArray[np.int64]

    def __getitem__(self, rows: NDArray[np.intp]) -> Subdivided:
        """Some of the tiles."""
        return replace(self, tiles=self.tiles[rows], members=self.members[rows], taken=self.taken[rows])

    @property
    def indices(self) -> NDArray[np.intp]:
        """The palette entry or plane of each cell: intp [n, cells * cells]."""
        return np.take_along_axis(self.members, self.taken, axis=1)

    def words(self) -> NDArray[np.uint16]:
        """The heap words of each tile, uint16 [n, words]: members, two to a word, then the mask."""
        stored = self.members[:, self.mode.in_descriptor :].astype(np.uint16)
        masks = mask_words(self.taken, self.mode.bits_per_cell)
        return np.concatenate([stored[:, 0::2] | stored[:, 1::2] << 8, masks], axis=1)

    def ordered(self, ranks: NDArray[np.intp]) -> Subdivided:
        """The same tiles with their members in the order that gives similar tiles equal words.

        Members of a heap are by ascending rank. Two of a descriptor alone begin with cell 0's.
        """
        keys = ranks[self.members]
        if self.mode.in_descriptor == self.members.shape[1]:
            keys = np.arange(self.members.shape[1]) ^ self.taken[:, :1]
        order = np.argsort(keys, axis=1, kind="stable")
        return replace(
            self,
            members=np.take_along_axis(self.members, order, axis=1),
            taken=np.take_along_axis(np.argsort(order, axis=1), self.taken, axis=1),
        )
