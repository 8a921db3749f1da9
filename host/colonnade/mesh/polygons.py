"""Splits polygons into triangles. Concave ones are split by ear clipping, so that no triangle leaves its polygon.

This is our own code because trimesh splits all polygons as fans, and no library that we use clips ears in 3D.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from colonnade.common.errors import UserError
from colonnade.common.types import Floats, Indices

#: Corners of a concave polygon, at most.
MAX_CORNERS = 2000

#: A corner turns by no more than the rounding of its coordinates, radians.
_STRAIGHT = 1e-9


@dataclass(frozen=True)
class Triangles:
    """The triangles of polygons; those of a polygon are consecutive.

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
                fans[row] = outline[row][_clip_ears(points[outline[row]])]
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
    across = np.einsum("psx,px->ps", np.cross(before, after), normal)
    return np.asarray(np.arctan2(across, np.einsum("psx,psx->ps", before, after)), dtype=np.float64)


def _fan_corners(outlines: Floats) -> tuple[Indices, npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """How to split polygons of one size.

    Returns:
        The corner from which each is a fan, int64 [p]: the first of a convex polygon, that of a quadrilateral which is
        not convex; which polygons are none, bool [p]; and which cross themselves, bool [p]: all others turn once.
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


def _clip_ears(outline: Floats) -> Indices:
    """Split one polygon, float64 [size, 3], into triangles, int64 [size - 2, 3].

    An ear is a convex corner whose triangle contains no other corner; it is cut off, until a triangle remains. An
    outline that crosses itself may have no ear, then any corner is cut off.
    """
    if len(outline) > MAX_CORNERS:
        raise UserError(f"a concave polygon has {len(outline):,} corners: split it, {MAX_CORNERS:,} are supported")
    flat = _flattened(outline)
    remaining = list(range(len(outline)))
    triangles: list[tuple[int, int, int]] = []
    at = 0
    while len(remaining) > 3:
        count = len(remaining)
        ears = (k % count for k in range(at, at + count) if _is_ear(flat, _corner(remaining, k % count), remaining))
        k = next(ears, at % count)
        triangles.append(_corner(remaining, k))
        del remaining[k]
        at = k + 1  # not the next one, which makes slivers around one corner
    triangles.append(_corner(remaining, 1))
    return np.array(triangles, dtype=np.int64)


def _corner(remaining: list[int], k: int) -> tuple[int, int, int]:
    """A corner of what remains of a polygon, between its neighbours."""
    return remaining[k - 1], remaining[k], remaining[(k + 1) % len(remaining)]


def _flattened(outline: Floats) -> Floats:
    """A polygon's corners in its plane, counter-clockwise, float64 [size, 2]."""
    relative = outline - outline[0]
    relative = relative / max(float(np.abs(relative).max()), 1e-300)
    normal = np.cross(relative, np.roll(relative, -1, axis=0)).sum(axis=0)
    axis = int(np.abs(normal).argmax())
    plane = relative[:, [(axis + 1) % 3, (axis + 2) % 3]]
    return np.asarray(plane if normal[axis] >= 0 else plane * (-1.0, 1.0), dtype=np.float64)


def _is_ear(flat: Floats, ear: tuple[int, int, int], remaining: list[int]) -> bool:
    """Whether a corner is convex, and its triangle holds no other corner, not even on the cut."""
    a, b, c = flat[list(ear)]
    if _area(a, b, c) <= _STRAIGHT * float(np.linalg.norm(b - a) * np.linalg.norm(c - b)):
        return False
    others = flat[[index for index in remaining if index not in ear]]
    same = ((others == a) | (others == c)).all(axis=1) | (others == b).all(axis=1)
    others = others[~same]
    inside = (_area(a, b, others) >= 0) & (_area(b, c, others) >= 0) & (_area(c, a, others) >= 0)
    return not bool(inside.any())


def _area(a: Floats, b: Floats, c: Floats) -> npt.NDArray[np.float64]:
    """Twice the signed area of triangles; points float64 [..., 2]."""
    across, along = b - a, c - a
    return np.asarray(across[..., 0] * along[..., 1] - across[..., 1] * along[..., 0])
