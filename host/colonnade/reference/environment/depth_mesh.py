"""The triangle mesh of a room's depth map, the ground truth for the reconstructed room.

Triangles join neighbouring pixels except across a depth discontinuity: a depth ratio above `JUMP` that the normals of
the two pixels do not explain. So a wall at a grazing angle stays whole. Triangles face the camera; a hit from behind
is outside all maps.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats
from colonnade.reference.embree import RayTracer, Triangles
from colonnade.reference.environment.surface import Backdrop, BoundingSurface, SurfaceHits

if TYPE_CHECKING:
    from colonnade.environment.model import Environment


#: Neighbouring pixels with a larger ratio of depths may lie on different surfaces.
JUMP = 1.05
#: They do if the step between them leaves a pixel's tangent plane by more than this sine.
OFF_PLANE = 0.25


class DepthMesh:
    """The mesh of a room's depth map, in view space."""

    def __init__(self, environment: Environment, split: bool = True) -> None:
        """Build the mesh. With ``split`` false it joins all neighbours."""
        self._environment = environment
        self._tracer = RayTracer(triangles_of(environment, split))
        corners = self._tracer.corners
        self._normals: Floats = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])

    def intersect(self, origins: Floats, directions: Floats) -> SurfaceHits:
        """First hits of rays. A miss, and a triangle that is hit from behind, are outside."""
        faces = self._tracer.first_hits(origins, directions)
        hit = np.flatnonzero(faces >= 0)
        position = np.full((len(origins), 3), np.nan)
        position[hit] = self._tracer.surface_points(faces[hit], origins[hit], directions[hit]).position
        environment, z = self._environment, position[:, 2]
        outside = faces < 0
        outside[hit] = np.einsum("ni,ni->n", self._normals[faces[hit]], directions[hit]) >= 0
        u = position[:, 0] / z * environment.fx + environment.cx
        v = position[:, 1] / z * environment.fy + environment.cy
        return SurfaceHits(position, u, v, outside)


def triangles_of(environment: Environment, split: bool = True) -> Triangles:
    """The triangles of a room's depth map, in view space, metres. With ``split`` false they join all neighbours."""
    points = environment.points()
    return Triangles(points.reshape(-1, 3), _faces(points, environment.normals, split))


def full_backdrop(environment: Environment, bounding: BoundingSurface | None = None) -> Backdrop:
    """The room with its full maps and its depth mesh, the ground truth; ``bounding`` closes it."""
    return Backdrop(environment, DepthMesh(environment), environment.albedo, environment.normals, bounding=bounding)


def _faces(points: Floats, normals: Floats, split: bool) -> NDArray[np.int32]:
    """Two triangles for every four pixels, facing the camera, without those across a discontinuity; int32 [m, 3]."""
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
    """Whether neighbouring points p and q, float64 [..., 3], lie on one surface, bool [...]."""
    step = q - p
    length = np.linalg.norm(step, axis=-1)
    near, far = np.minimum(p[..., 2], q[..., 2]), np.maximum(p[..., 2], q[..., 2])
    off_plane = np.maximum(*(np.abs(np.einsum("...i,...i->...", n, step)) for n in (normals_p, normals_q)))
    return np.asarray((far <= JUMP * near) | (off_plane <= OFF_PLANE * length), dtype=np.bool_)
