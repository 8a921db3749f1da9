"""Clip files: what bends a mesh on a target (docs/driver.md)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from colonnade.scene_image.grid_clip import GridClip

Places = Mapping[str, Mapping[str, tuple[int, int, bool]]]
#: Of a leaf of one triangle, in place of its fourth vertex.
NO_VERTEX = 0xFFFFFFFF


@dataclass(frozen=True)
class ClipTree:
    """The records of a mesh that bends.

    Attributes:
        numbers: Bits of vertices, of deltas, of box planes and of addresses; records of a leaf.
        records: Nodes and leaves.
        depth: Nodes on the longest path from the root.
        leaves: The clip's vertices of each leaf, the fourth of a triangle −1, int64 [l, 4].
    """

    numbers: tuple[int, int, int, int, int]
    records: int
    depth: int
    leaves: npt.NDArray[np.int64]


def clip_file(
    clip: GridClip, tree: ClipTree, places: Places, format_words: Sequence[int], *, is_ordered: bool = False
) -> bytes:
    """A clip file (``cpp/packer/clip_file.hpp``).

    Args:
        clip: The clip.
        tree: The records whose leaves have its vertices.
        places: Fields of the records, by `colonnade.design.manifest.field_places`.
        format_words: The design's format hash.
        is_ordered: Vertices come as leaves need them first.
    """
    from colonnade import _core

    numbers = (clip.bones, clip.targets, clip.linear_shift, clip.shift)
    of_tree = (*tree.numbers, tree.records, tree.depth)
    arrays = (np.ascontiguousarray(part) for part in (clip.vertices, clip.changes, clip.times, clip.poses))
    leaves = np.ascontiguousarray(tree.leaves, dtype=np.int64)
    file = _core.clip_file(*arrays, numbers, of_tree, leaves, places, list(format_words), is_ordered)
    return bytes(file)
