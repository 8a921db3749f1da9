"""Cleaning of meshes: vertices are merged by position; faces without area, equal faces and unused vertices go.

Closed parts point outward, counter-clockwise, as glass needs to know its inside. A *part* is a set of faces that are
connected over edges of two faces; it is closed if each of its edges has two of its faces. The front of an open part is
whatever its author says. A part that points inward may be the wall of a cavity: it stays if it lies in an odd number of
other closed parts.

Corner normals are the normals of a face at its three corners. Two faces that share an edge have one normal at its ends
if the angle between their own normals is at most the crease angle. Across a sharper edge each face keeps the normal of
its side. So a cube keeps its edges, a cylinder is smooth around its axis, and its caps are flat.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from colonnade.common.types import Floats, Indices
from colonnade.mesh.geometry.topology import Faces

#: The crease angle of meshes without normals, degrees.
CREASE = 60.0


@dataclass(frozen=True)
class CleanMesh:
    """A clean mesh, and what was repaired.

    Attributes:
        vertices: float64 [n, 3].
        faces: int32 [m, 3].
        sources: The raw face of each face, int64 [m].
        normals: At the corners, of unit length, or 0 where the adjacent faces' normals cancel, float64 [m, 3, 3].
        reversed: Faces whose corners are their source's backwards, bool [m].
        is_open: Faces of open parts, bool [m].
        repairs: Closed parts whose faces disagreed, and parts that pointed inward; faces whose normals all pointed to
            their back, and were negated; corners whose normal pointed to the back of their face, and was computed
            anew; corners without a normal in a file that has some.
    """

    vertices: Floats
    faces: Faces
    sources: Indices
    normals: Floats
    reversed: npt.NDArray[np.bool_]
    is_open: npt.NDArray[np.bool_]
    repairs: tuple[int, int, int, int, int]


def clean(
    vertices: Floats, faces: Faces, authored: Floats | None, crease: float | None, source_count: int
) -> CleanMesh | str:
    """Clean raw vertices and faces; a string says why that cannot be, and begins with "the mesh".

    Args:
        vertices: float64 [n, 3].
        faces: int32 [m, 3].
        authored: The file's normals of any length, 0 where it has none, float64 [m, 3, 3]; None: it has none.
        crease: Crease angle, degrees; it replaces the file's normals. None: the file's, elsewhere `CREASE`.
        source_count: Number of the file's faces, for messages.
    """
    from colonnade import _core

    least_cosine = math.cos(math.radians(CREASE if crease is None else crease)) - 1e-9
    normals = None if crease is not None else authored
    cleaned = _core.clean(vertices, faces, normals, least_cosine, source_count)
    return cleaned if isinstance(cleaned, str) else CleanMesh(*cleaned)
