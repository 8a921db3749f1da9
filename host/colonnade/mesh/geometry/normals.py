"""Normals of faces."""

from __future__ import annotations

import numpy as np

from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors
from colonnade.mesh.geometry.topology import Faces


def face_normals(vertices: Floats, faces: Faces) -> Floats:
    """Unit normals of faces by their winding, float64 [m, 3]."""
    corners = (vertices / float((vertices.max(axis=0) - vertices.min(axis=0)).max()))[faces]
    return unit_vectors(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
