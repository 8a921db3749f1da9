"""A room's depth map as a mesh of triangles: what the rebuilt room is measured against.

Neighbouring pixels are joined unless the depth jumps between them: then nothing is known of what lies behind, and no
sheet is drawn from the front to the back. A jump is a ratio of depths beyond `JUMP` that not both pixels' normals
explain: a wall seen along itself stays whole, for there both do. Triangles face the camera; whoever meets one from
behind sees what no map knows.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats
from colonnade.reference.embree import RayTracer, Triangles
from colonnade.reference.environment.surface import Backdrop, Meetings

if TYPE_CHECKING:
    from colonnade.environment.model import Environment


#: Neighbours of which one is farther than this many times the other may lie on different things …
JUMP = 1.05
#: … and do unless the step between them is within this sine of both pixels' tangent planes.
OFF_PLANE = 0.25


class DepthMesh:
    """The mesh of a room's depth map, in view space."""

    def __init__(self, environment: Environment, split: bool = True) -> None:
        """Build it; ``split`` false joins all neighbours."""
        self._environment = environment
        points = environment.points()
        faces = _faces(points, environment.normals, split)
        self._tracer = RayTracer(Triangles(points.reshape(-1, 3), faces))
        corners = self._tracer.corners
        self._normals: Floats = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])

    def meet(self, origins: Floats, directions: Floats) -> Meetings:
        """Where rays meet it first; a triangle met from behind is outside, as is nothing at all."""
        faces = self._tracer.first_hits(origins, directions)
        met = np.flatnonzero(faces >= 0)
        position = np.full((len(origins), 3), np.nan)
        position[met] = self._tracer.surface_points(faces[met], origins[met], directions[met]).position
        environment, z = self._environment, position[:, 2]
        outside = faces < 0
        outside[met] = np.einsum("ni,ni->n", self._normals[faces[met]], directions[met]) >= 0
        u = position[:, 0] / z * environment.fx + environment.cx
        v = position[:, 1] / z * environment.fy + environment.cy
        return Meetings(position, u, v, outside)


def full_backdrop(environment: Environment) -> Backdrop:
    """The room with its full maps and its depth map as geometry: the truth that everything else is held against."""
    return Backdrop(environment, DepthMesh(environment), environment.albedo, environment.normals)


def _faces(points: Floats, normals: Floats, split: bool) -> NDArray[np.int32]:
    """Two triangles for every four pixels, facing the camera, less those across a jump; int32 [m, 3]."""
    height, width = points.shape[:2]
    index = np.arange(height * width, dtype=np.int32).reshape(height, width)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
    faces = np.stack([np.stack([a, c, b], axis=2), np.stack([b, c, d], axis=2)], axis=2)
    if split:
        across = _joined(points[:, :-1], points[:, 1:], normals[:, :-1], normals[:, 1:])
        along = _joined(points[:-1], points[1:], normals[:-1], normals[1:])
        diagonal = _joined(points[:-1, 1:], points[1:, :-1], normals[:-1, 1:], normals[1:, :-1])
        upper = across[:-1] & along[:, :-1] & diagonal
        lower = across[1:] & along[:, 1:] & diagonal
        return np.ascontiguousarray(faces[np.stack([upper, lower], axis=2)])
    return np.ascontiguousarray(faces.reshape(-1, 3))


def _joined(p: Floats, q: Floats, normals_p: Floats, normals_q: Floats) -> NDArray[np.bool_]:
    """Whether neighbouring points lie on one surface."""
    step = q - p
    length = np.linalg.norm(step, axis=-1)
    near, far = np.minimum(p[..., 2], q[..., 2]), np.maximum(p[..., 2], q[..., 2])
    off = np.maximum(*(np.abs(np.einsum("...i,...i->...", n, step)) for n in (normals_p, normals_q)))
    return np.asarray((far <= JUMP * near) | (off <= OFF_PLANE * length), dtype=np.bool_)
