"""Winding of closed parts: counter-clockwise seen from outside, as glass needs to know its inside.

A *part* is a set of faces that are connected over edges of two faces. It is closed if each of its edges has two of its
faces. Open parts are left alone: their front is whatever their author says.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from colonnade.common import fixed_order
from colonnade.common.types import Floats, Indices
from colonnade.mesh.topology import Faces, edge_keys

#: Parts of a mesh for which it is tested whether they lie in another part.
_MAX_NESTED = 2000


@dataclass(frozen=True)
class Winding:
    """What a repair has to reverse.

    Attributes:
        reversed: Faces to reverse, bool [m].
        mixed: Closed parts whose faces disagreed.
        inverted: Closed parts whose faces agreed, but pointed inward.
        is_open: Faces of open parts, bool [m].
    """

    reversed: npt.NDArray[np.bool_]
    mixed: int
    inverted: int
    is_open: npt.NDArray[np.bool_]


def find_winding(vertices: Floats, faces: Faces) -> Winding:
    """Find the faces of closed parts to reverse, so that all point outward.

    A part whose faces agree and point inward may be the wall of a cavity: it is left alone if it lies in an odd number
    of other closed parts.

    Args:
        vertices: float64 [n, 3], merged by position.
        faces: int32 [m, 3], each with an area.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    count = len(faces)
    keys = edge_keys(faces)
    order = np.argsort(keys, kind="stable")
    ordered = keys[order]
    same = np.flatnonzero(ordered[1:] == ordered[:-1])
    # Of an edge of more than two faces, no pair connects a part
    crowded = np.zeros(len(same), dtype=np.bool_)
    adjacent = np.diff(same) == 1
    crowded[1:] |= adjacent
    crowded[:-1] |= adjacent
    one, other = order[same[~crowded]], order[same[~crowded] + 1]
    flat = faces.reshape(-1)
    agrees = flat[one] != flat[other]
    first, second = one // 3, other // 3

    def parts_of(a: Indices, b: Indices, nodes: int) -> Indices:
        graph = coo_matrix((np.ones(len(a), dtype=np.bool_), (a, b)), shape=(nodes, nodes))
        return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)

    part = parts_of(first, second, count)
    closed = _closed_parts(keys, part)
    # Each face twice, as it is and reversed; faces that agree share a side, others share opposite ones
    crossing = np.where(agrees, 0, count)
    matching = np.concatenate([second + crossing, second + count - crossing])
    side = parts_of(np.concatenate([first, first + count]), matching, 2 * count)
    orientable = np.ones(len(closed), dtype=np.bool_)
    orientable[part[side[:count] == side[count:]]] = False
    repairable = closed & orientable
    # Of both sides of a part, that of its first face counts as it is
    start = np.full(len(closed), count, dtype=np.int64)
    np.minimum.at(start, part, np.arange(count))
    is_reversed = (side[:count] != side[start[part]]) & repairable[part]
    mixed = np.zeros(len(closed), dtype=np.bool_)
    mixed[part[is_reversed]] = True
    volume = _volumes(vertices, faces, is_reversed, part, len(closed))
    inward = repairable & (volume < 0)
    alike = inward & ~mixed
    if alike.any():
        inward[alike] &= ~_is_cavity(vertices, faces, part, np.flatnonzero(repairable), np.flatnonzero(alike))
    is_reversed ^= inward[part]
    return Winding(is_reversed, int(mixed.sum()), int((inward & ~mixed).sum()), ~closed[part])


def _closed_parts(keys: Indices, part: Indices) -> npt.NDArray[np.bool_]:
    """Whether each part has two of its faces at each of its edges, bool [parts]."""
    owner = np.repeat(part, 3)
    order = np.lexsort((keys, owner))
    ordered = np.stack([owner[order], keys[order]], axis=1)
    begins = np.ones(len(ordered), dtype=np.bool_)
    begins[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    starts = np.flatnonzero(begins)
    counts = np.diff(np.append(starts, len(ordered)))
    closed = np.ones(int(part.max()) + 1, dtype=np.bool_)
    closed[ordered[starts[counts != 2], 0]] = False
    return closed


def _volumes(vertices: Floats, faces: Faces, is_reversed: npt.NDArray[np.bool_], part: Indices, parts: int) -> Floats:
    """Signed volume of each part, times 6, relative to its own centre, float64 [parts]."""
    scaled = vertices / float((vertices.max(axis=0) - vertices.min(axis=0)).max())
    corners = scaled[faces]
    size = np.maximum(np.bincount(part, minlength=parts), 1)
    centre = np.stack([np.bincount(part, corners[:, 0, axis], parts) / size for axis in range(3)], axis=1)
    corners -= centre[part][:, None, :]
    volume = fixed_order.dot(corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    return np.bincount(part, np.where(is_reversed, -volume, volume), parts).astype(np.float64)


def _is_cavity(vertices: Floats, faces: Faces, part: Indices, parts: Indices, inner: Indices) -> npt.NDArray[np.bool_]:
    """Whether each part of ``inner`` lies in an odd number of the other ``parts``, bool [inner]."""
    if len(parts) > _MAX_NESTED:
        return np.ones(len(inner), dtype=np.bool_)
    order = np.argsort(part, kind="stable")
    ends = np.cumsum(np.bincount(part))
    starts = ends - np.bincount(part)
    surfaces = {int(index): vertices[faces[order[starts[index] : ends[index]]]] for index in parts}
    boxes = {index: (corners.min(axis=(0, 1)), corners.max(axis=(0, 1))) for index, corners in surfaces.items()}
    found = []
    for index in inner:
        point, (low, high) = surfaces[int(index)][0, 0], boxes[int(index)]
        enclosing = [
            other
            for other, (other_low, other_high) in boxes.items()
            if other != index and (other_low <= low).all() and (high <= other_high).all()
        ]
        found.append(sum(_winding_number(point, surfaces[other]) for other in enclosing) % 2 == 1)
    return np.array(found, dtype=np.bool_)


def _winding_number(point: Floats, corners: Floats) -> int:
    """How often a closed surface, triangles float64 [m, 3, 3], goes around a point, without its sign."""
    a, b, c = np.moveaxis(corners - point, 1, 0)
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    triple = fixed_order.dot(a, np.cross(b, c))
    rest = la * lb * lc + fixed_order.dot(a, b) * lc + fixed_order.dot(b, c) * la + fixed_order.dot(c, a) * lb
    return abs(round(float(fixed_order.arctan2(triple, rest).sum() / (2 * np.pi))))
