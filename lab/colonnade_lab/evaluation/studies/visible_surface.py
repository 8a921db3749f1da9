"""The real surface of a synthetic room as the truth of rays, in place of the mesh of its depth map.

The mesh has no surfaces behind others, so a ray goes through it where the real room stops the ray.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from colonnade.common.types import Floats, Indices
from colonnade.reference.embree import RayTracer, Triangles
from colonnade.reference.environment.surface import SurfaceHits

if TYPE_CHECKING:
    from colonnade_lab.evaluation.studies.synthetic_attic import SyntheticRoom

#: A point is in the maps if nothing lies in front of it by more than this, metres.
VISIBLE = 0.01


class VisibleSurface:
    """The surface of a synthetic room, in view space. Hits that the camera does not see are outside."""

    def __init__(self, made: SyntheticRoom) -> None:
        """Move the room's surface to view space."""
        self._environment = made.environment
        to_world = made.environment.camera_to_world
        in_view = (made.surface.vertices - to_world[:, 3]) @ to_world[:, :3]
        self._tracer = RayTracer(Triangles(in_view, made.surface.faces))

    def intersect(self, origins: Floats, directions: Floats) -> SurfaceHits:
        """First hits of rays, float64 [n, 3] each. The camera and the ray must see the same side."""
        faces, position = self._hits(origins, directions)
        environment = self._environment
        with np.errstate(divide="ignore", invalid="ignore"):
            u = position[:, 0] / position[:, 2] * environment.fx + environment.cx
            v = position[:, 1] / position[:, 2] * environment.fy + environment.cy
        in_picture = (position[:, 2] > 0) & (u >= 0) & (u < environment.width) & (v >= 0) & (v < environment.height)
        inside = np.flatnonzero(in_picture)
        _, nearest = self._hits(np.zeros((len(inside), 3)), position[inside])
        hidden_by = np.linalg.norm(position[inside], axis=1) - np.linalg.norm(nearest, axis=1)
        corners = self._tracer.corners[faces[inside]]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        sides = [np.einsum("ni,ni->n", normals, rays[inside]) for rays in (position, directions)]
        outside = np.ones(len(faces), dtype=np.bool_)
        outside[inside] = ~((hidden_by < VISIBLE) & (sides[0] * sides[1] > 0))
        return SurfaceHits(position, u, v, outside)

    def _hits(self, origins: Floats, directions: Floats) -> tuple[Indices, Floats]:
        """Faces, -1 for a miss, and positions, NaN for a miss."""
        faces = self._tracer.first_hits(origins, directions)
        hit = np.flatnonzero(faces >= 0)
        position: Floats = np.full((len(faces), 3), np.nan)
        position[hit] = self._tracer.surface_points(faces[hit], origins[hit], directions[hit]).position
        return faces, position
