"""Splits polygons into triangles. Concave ones are split by ear clipping, so that no triangle leaves its polygon.

This is our own code because trimesh splits all polygons as fans, and because choices in numpy's float64 are the same on
every machine, unlike a compiled library's with fused multiply-add.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from colonnade.common import fixed_order
from colonnade.common.errors import UserError
from colonnade.common.types import Floats, Indices

#: Corners of a concave polygon, at most.
MAX_CORNERS = 2000

#: A corner turns by no more than the rounding of its coordinates, radians.
_STRAIGHT = 1e-9
#: Tests for ears of a polygon, at most, for each of its corners.
_TESTS = 20
#: What stands in the way of a corner that is cut off as an ear: nothing, not known yet, or its own angle.
_EAR, _UNKNOWN, _NOT_CONVEX = -1, -2, -3


@dataclass(frozen=True)
class Triangles:
    """The triangles of polygons; a polygon's are consecutive.

    Attributes:
        corners: Positions in the list of all polygons' corners, int64 [t, 3].
        polygons: Polygon of each triangle, int64 [t].
        short: Polygons of fewer than three corners, which have no triangle.
        crossed: Polygons whose outline crosses itself; their triangles may overlap.
    """

    corners: Indices
    polygons: Indices
    short: int = 0
    crossed: int = 0


def triangulate(points: Floats, sizes: Indices) -> Triangles:
    """Split polygons into triangles of the same winding.

    Args:
        points: Positions of all polygons' corners, one polygon after the other, float64 [k, 3].
        sizes: Corners of each polygon, int64 [p].

    Raises:
        UserError: A concave polygon has too many corners.
    """
    starts = np.cumsum(sizes) - sizes
    corners: list[Indices] = []
    polygons: list[Indices] = []
    crossed = 0
    for size in np.unique(sizes[sizes >= 3]):
        chosen = np.flatnonzero(sizes == size)
        outline = starts[chosen][:, None] + np.arange(size)
        if size == 3:
            fans = outline[:, None, :]
        else:
            first, needs_clipping, crosses = _fan_corners(points[outline])
            crossed += int(crosses.sum())
            turned = np.take_along_axis(outline, (first[:, None] + np.arange(size)) % size, axis=1)
            fans = np.stack(
                [np.stack([turned[:, 0], turned[:, k], turned[:, k + 1]], 1) for k in range(1, size - 1)], 1
            )
            for row in np.flatnonzero(needs_clipping):
                ears, is_crossed = _clip_ears(points[outline[row]])
                fans[row] = outline[row][ears]
                crossed += int(is_crossed and not crosses[row])
        corners.append(fans.reshape(-1, 3))
        polygons.append(np.repeat(chosen, size - 2))
    if not corners:
        return Triangles(np.zeros((0, 3), np.int64), np.zeros(0, np.int64), int((sizes < 3).sum()))
    owner = np.concatenate(polygons)
    order = np.argsort(owner, kind="stable")
    return Triangles(np.concatenate(corners)[order], owner[order], int((sizes < 3).sum()), crossed)


def _turns(outlines: Floats) -> Floats:
    """The angles by which polygons turn at their corners, positive where convex, radians, float64 [p, size]."""
    relative = outlines - outlines[:, :1]
    normal = np.cross(relative, np.roll(relative, -1, axis=1)).sum(axis=1)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal / np.where(length > 0, length, 1.0)
    after = np.roll(outlines, -1, axis=1) - outlines
    before = np.roll(after, 1, axis=1)
    across = fixed_order.dot(np.cross(before, after), normal[:, None])
    return fixed_order.arctan2(across, fixed_order.dot(before, after))


def _fan_corners(outlines: Floats) -> tuple[Indices, npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """How to split polygons of one size.

    Returns:
        The corner from which each is a fan, int64 [p]: the first of a convex polygon, in a quadrilateral the one
        that is not convex; which are none, bool [p]; and which cross themselves, bool [p]: all others turn once.
    """
    count, size = outlines.shape[:2]
    no = np.zeros(count, dtype=np.bool_)
    if not np.isfinite(outlines).all():
        return np.zeros(count, dtype=np.int64), no, no
    turns = _turns(outlines)
    is_bent, crosses = turns <= _STRAIGHT, np.abs(turns.sum(axis=1) - 2 * np.pi) > 1.0
    if size == 4:
        return np.where(is_bent.any(axis=1), turns.argmin(axis=1), 0), no, crosses
    return np.zeros(count, dtype=np.int64), is_bent.any(axis=1) | crosses, crosses


def _clip_ears(outline: Floats) -> tuple[Indices, bool]:
    """Split one polygon, float64 [size, 3], into triangles, int64 [size - 2, 3], and say whether it crosses itself.

    An ear is a convex corner whose triangle contains no other corner; it is cut off, until a triangle remains. A corner
    is tested again only when a neighbour or the corner in its way has gone, so a simple polygon takes some tests for
    each corner. An outline that crosses itself may have no ear, then any corner is cut off; after too many tests the
    rest becomes a fan.
    """
    count = len(outline)
    if count > MAX_CORNERS:
        raise UserError(f"a concave polygon has {count:,} corners: split it, {MAX_CORNERS:,} are supported")
    flat = _flattened(outline)
    before, after = [count - 1, *range(count - 1)], [*range(1, count), 0]
    obstacles = [_UNKNOWN] * count
    remains = np.ones(count, dtype=np.bool_)
    triangles: list[tuple[int, int, int]] = []
    at, tests, crosses = 0, 0, False
    while count > 3:
        for _ in range(count):
            obstacle = obstacles[at]
            if obstacle == _UNKNOWN or (obstacle >= 0 and not remains[obstacle]):
                obstacle = obstacles[at] = _obstacle(flat, (before[at], at, after[at]), remains)
                tests += 1
            if obstacle == _EAR:
                break
            at = after[at]
        else:
            crosses = crosses or _has_area(flat[remains])
        if tests > _TESTS * len(outline):
            crosses = True
            break
        low, high = before[at], after[at]
        triangles.append((low, at, high))
        remains[at] = False
        after[low], before[high] = high, low
        obstacles[low] = obstacles[high] = _UNKNOWN
        at = after[high]  # not the next one, which makes slivers around one corner
        count -= 1
    first = int(remains.argmax())
    at = after[first]
    while len(triangles) < len(outline) - 2:
        triangles.append((first, at, after[at]))
        at = after[at]
    return np.array(triangles, dtype=np.int64), crosses


def _has_area(flat: Floats) -> bool:
    """Whether a polygon, float64 [size, 2], has more area than rounding leaves."""
    relative = flat - flat[0]
    area = _area(np.zeros(2), relative[:-1], relative[1:]).sum()
    return abs(float(area)) > _STRAIGHT * float(np.abs(relative).max()) ** 2


def _flattened(outline: Floats) -> Floats:
    """A polygon's corners in its plane, counter-clockwise, float64 [size, 2]; exact for integers of up to 25 bits."""
    relative = outline - outline[0]
    relative = np.ldexp(relative, -int(np.frexp(np.abs(relative).max())[1]))
    normal = np.cross(relative, np.roll(relative, -1, axis=0)).sum(axis=0)
    axis = int(np.abs(normal).argmax())
    plane = relative[:, [(axis + 1) % 3, (axis + 2) % 3]]
    return np.asarray(plane if normal[axis] >= 0 else plane * (-1.0, 1.0), dtype=np.float64)


def _obstacle(flat: Floats, ear: tuple[int, int, int], remains: npt.NDArray[np.bool_]) -> int:
    """`_EAR` if a corner is convex, and its triangle holds no other corner, not even on the cut.

    Else `_NOT_CONVEX`, or the corner in the triangle that is farthest from the cut: it is concave in a simple polygon,
    so that it remains for long.
    """
    a, b, c = flat[list(ear)]
    sides = np.array([b - a, c - b])
    if _area(a, b, c) <= _STRAIGHT * np.sqrt(fixed_order.dot(sides, sides)).prod():
        return _NOT_CONVEX
    depth = _area(c, a, flat)
    inside = (depth >= 0) & (_area(a, b, flat) >= 0) & (_area(b, c, flat) >= 0) & remains
    found = np.flatnonzero(inside)
    found = found[~(flat[found][:, None] == flat[list(ear)]).all(axis=2).any(axis=1)]
    return int(found[depth[found].argmax()]) if len(found) else _EAR


def _area(a: Floats, b: Floats, c: Floats) -> npt.NDArray[np.float64]:
    """Twice the signed area of triangles; points float64 [..., 2]."""
    across, along = b - a, c - a
    return np.asarray(across[..., 0] * along[..., 1] - across[..., 1] * along[..., 0])
