"""Splits polygons into triangles. Concave ones are split by ear clipping, so that no triangle leaves its polygon.

This is our own code because trimesh splits all polygons as fans (``cpp/mesh/files/polygons.hpp``).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colonnade.common.errors import UserError
from colonnade.common.types import Floats, Indices


@dataclass(frozen=True)
class Triangles:
    """The triangles of polygons; those of a polygon are consecutive.

    Attributes:
        corners: Positions in the list of all polygons' corners, int64 [t, 3].
        polygons: Polygon of each triangle, int64 [t].
        short: Polygons of fewer than three corners, which have no triangle.
        crossed: Polygons whose outline crosses itself; their triangles may overlap.
        tests: Tests for ears.
    """

    corners: Indices
    polygons: Indices
    short: int = 0
    crossed: int = 0
    tests: int = 0


def triangulate(points: Floats, sizes: Indices) -> Triangles:
    """Split polygons into triangles of the same winding.

    Args:
        points: Positions of all polygons' corners, one polygon after the other, float64 [k, 3].
        sizes: Corners of each polygon, int64 [p], none negative, k together.

    Raises:
        UserError: A concave polygon has too many corners.
    """
    from colonnade import _core

    corners, polygons, *counts, error = _core.triangulate(np.ascontiguousarray(points, np.float64), sizes)
    if error:
        raise UserError(error)
    if corners is None:
        corners, polygons = np.zeros((0, 3), np.int64), np.zeros(0, np.int64)
    return Triangles(corners, polygons, *counts)
