"""The tree of the C++ packer as arrays, for tests of its structure."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from colonnade import _core
from colonnade.design.manifest import Manifest, field_places
from colonnade.scene_image.header import TreeStatistics

EMPTY, NODE, LEAF = 0, 1, 2
TINY = Manifest.from_dict(json.loads((Path(__file__).parents[2] / "configs" / "golden" / "tiny.json").read_text()))


@dataclass(frozen=True)
class Bvh:
    """A tree of n nodes, l leaves and m triangles.

    A child's planes are ``origin + (low << exponent)`` and ``origin + (high << exponent)``, in vertex units.

    Attributes:
        origin: uint32 [n, 3], vertex units.
        exponent: uint8 [n, 3].
        kinds: uint8 [n, 4]: EMPTY, NODE or LEAF.
        low, high: uint16 [n, 4, 3].
        first_child: int64 [n], node index of the first NODE child; the others follow in slot order.
        first_triangles: int64 [n], leaf index of the first LEAF child; the others follow in slot order.
        leaf_first, leaf_count: uint32 [l], packed id of a leaf's first triangle, and number of its triangles.
        order: uint32 [m], face index of each packed id.
        statistics: Size and cost of the tree.
    """

    origin: npt.NDArray[np.uint32]
    exponent: npt.NDArray[np.uint8]
    kinds: npt.NDArray[np.uint8]
    low: npt.NDArray[np.uint16]
    high: npt.NDArray[np.uint16]
    first_child: npt.NDArray[np.int64]
    first_triangles: npt.NDArray[np.int64]
    leaf_first: npt.NDArray[np.uint32]
    leaf_count: npt.NDArray[np.uint32]
    order: npt.NDArray[np.uint32]
    statistics: TreeStatistics


def build_bvh(
    vertices: npt.NDArray[np.int32],
    faces: npt.NDArray[np.int32],
    *,
    children: int,
    box_bits: int,
    stack_depth: int,
) -> Bvh:
    """Build the tree over triangles with integer vertices.

    The order of the triangles depends on neither children nor box bits. The tree needs at most ``stack_depth`` entries,
    unless a balanced tree needs more. The caller must compare ``statistics.stack_bound``.

    Args:
        vertices: int32 [n, 3], vertex units, from 0.
        faces: int32 [m, 3], at least one.
        children: Most children of a node, 2 to 4.
        box_bits: Bits of a child's plane relative to its node.
        stack_depth: Entries of the traversal stack.
    """
    arrays: dict[str, Any] = _core.build_bvh(
        np.ascontiguousarray(vertices, dtype=np.int32),
        np.ascontiguousarray(faces, dtype=np.int32),
        children,
        box_bits,
        stack_depth,
        field_places(TINY.layouts),
        TINY.numbers["normalFraction"],
    )
    first, nodes, leaves = (arrays.pop(key) for key in ("first", "node_count", "leaf_children"))
    slots = np.arange(4)
    arrays["kinds"] = np.where(slots < nodes[:, None], NODE, np.where(slots < (nodes + leaves)[:, None], LEAF, EMPTY))
    arrays["first_child"] = np.searchsorted(arrays.pop("node_address"), first)
    arrays["first_triangles"] = np.searchsorted(arrays.pop("leaf_address"), first + nodes)
    statistics = TreeStatistics(
        nodes=len(arrays["kinds"]),
        leaves=len(arrays["leaf_first"]),
        depth=arrays.pop("depth"),
        stack_bound=arrays.pop("stack_bound"),
        cost=arrays.pop("cost"),
        height_limit=arrays.pop("height_limit"),
    )
    return Bvh(statistics=statistics, **arrays)
