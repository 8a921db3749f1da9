"""Corner normals: the normals of a face at its three corners, from the file or smoothed up to a crease angle.

Two faces that share an edge have one normal at its ends if the angle between their own normals is at most the crease
angle. Across a sharper edge each face keeps the normal of its side. So a cube keeps its edges, a cylinder is smooth
around its axis, and its caps are flat.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors
from colonnade.mesh.geometry.topology import Faces

#: The crease angle of meshes without normals, degrees.
CREASE = 60.0


@dataclass(frozen=True)
class CornerNormals:
    """Corner normals, and what was done with those of the file.

    Attributes:
        normals: Unit length, or 0 where the adjacent faces' normals cancel, float64 [m, 3, 3].
        flipped: Faces whose normals all pointed to their back, and were negated.
        replaced: Corners whose normal pointed to the back of their face, and was computed anew.
        missing: Corners without a normal in a file that has some.
    """

    normals: Floats
    flipped: int = 0
    replaced: int = 0
    missing: int = 0


def corner_normals(vertices: Floats, faces: Faces, authored: Floats | None, crease: float | None) -> CornerNormals:
    """The corner normals of a clean mesh.

    Args:
        vertices: float64 [n, 3], merged by position.
        faces: int32 [m, 3], each with an area.
        authored: The file's normals of any length, 0 where it has none, float64 [m, 3, 3]; None: it has none.
        crease: Crease angle, degrees; it replaces the file's normals. None: the file's, elsewhere `CREASE`.
    """
    if authored is None or crease is not None or not authored.any():
        return CornerNormals(crease_normals(vertices, faces, CREASE if crease is None else crease))
    from colonnade import _core

    return CornerNormals(*_core.corner_normals(vertices, faces, authored, _least_cosine(CREASE)))


def face_normals(vertices: Floats, faces: Faces) -> Floats:
    """Unit normals of faces by their winding, float64 [m, 3]."""
    corners = (vertices / float((vertices.max(axis=0) - vertices.min(axis=0)).max()))[faces]
    return unit_vectors(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


def crease_normals(vertices: Floats, faces: Faces, crease: float) -> Floats:
    """Corner normals float64 [m, 3, 3] smoothed up to a crease angle, degrees.

    A corner's normal is the sum of the face normals, weighted by their angle, over the faces around its vertex that
    are connected over edges that are not sharper than the crease angle; 0 where they cancel.
    """
    from colonnade import _core

    normals: Floats = _core.crease_normals(vertices, faces, _least_cosine(crease))
    return normals


def _least_cosine(crease: float) -> float:
    """That of the angle between two faces with a smooth edge."""
    return math.cos(math.radians(crease)) - 1e-9
