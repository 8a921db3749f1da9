"""Ray-mesh intersection with Embree, refined to float64.

Embree finds the first triangle of a ray in float32. Hit point and distance are computed here in float64.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats

#: Rays start this share of the box's longest edge before the box, which keeps float32 coordinates small.
_START_MARGIN = 1 / 64

#: Secondary rays start this share of the box's longest edge off the surface. Rounding to float32 moves a vertex and an
#: origin by at most √3 · 2^-26 of the edge each, so the start stays on its side with a margin of four.
_OFFSET = 2.0**-22


class Surface(Protocol):
    """A triangle surface, such as a `Mesh`: vertices float64 [n, 3], faces int32 [m, 3]."""

    @property
    def vertices(self) -> Floats:
        """Positions."""

    @property
    def faces(self) -> NDArray[np.int32]:
        """Rows of `vertices`."""


@dataclass(frozen=True)
class Triangles:
    """A surface that is not a mesh.

    Attributes:
        vertices: float64 [n, 3].
        faces: int32 [m, 3].
    """

    vertices: Floats
    faces: NDArray[np.int32]


@dataclass(frozen=True)
class SurfacePoints:
    """Hit points of rays on their triangles.

    Attributes:
        position: Mesh space, float64 [n, 3].
        weights: Barycentric coordinates, at least 0, with sum 1, float64 [n, 3].
        t: Distance in lengths of the ray's direction, float64 [n].
    """

    position: Floats
    weights: Floats
    t: Floats


class RayTracer:
    """Intersects rays with a mesh. All positions and directions are in mesh space, float64 [n, 3]."""

    def __init__(self, mesh: Surface) -> None:
        """Build Embree's scene in its robust (watertight) mode."""
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self.corners: Floats = mesh.vertices[mesh.faces]
        self.low: Floats = mesh.vertices.min(axis=0)
        self.high: Floats = mesh.vertices.max(axis=0)
        self._centre: Floats = (self.low + self.high) / 2
        self._edge = float((self.high - self.low).max())
        #: Distance from a surface at which rays that leave it start, mesh units.
        self.offset = self._edge * _OFFSET
        self._scene = EmbreeScene(robust=True)
        TriangleMesh(self._scene, self._scaled(mesh.vertices), np.ascontiguousarray(mesh.faces, dtype=np.int32))

    def _scaled(self, positions: Floats) -> NDArray[np.float32]:
        return np.ascontiguousarray((positions - self._centre) / self._edge, dtype=np.float32)

    def enters_box(
        self, origins: Floats, directions: Floats, t_max: float = np.inf
    ) -> tuple[NDArray[np.bool_], Floats]:
        """Whether each ray hits the mesh's bounding box before ``t_max``, bool [n], and its entry t, float64 [n]."""
        with np.errstate(divide="ignore", invalid="ignore"):
            planes = np.stack([(plane - origins) / directions for plane in (self.low, self.high)])
        # A ray that lies in a plane gives 0/0; that plane does not bound the ray.
        t_near = np.where(np.isnan(planes).any(axis=0), -np.inf, planes.min(axis=0)).max(axis=1)
        t_far = np.where(np.isnan(planes).any(axis=0), np.inf, planes.max(axis=0)).min(axis=1)
        t_entry = np.maximum(t_near, 0.0)
        return (t_entry <= t_far) & (t_entry <= t_max), t_entry

    def first_hits(self, origins: Floats, directions: Floats) -> NDArray[np.int64]:
        """Index of the first face that each ray hits, -1 for a miss, int64 [n]."""
        lengths = np.linalg.norm(directions, axis=1, keepdims=True)
        unit = directions / lengths
        _, t_entry = self.enters_box(origins, unit)
        advance = np.maximum(np.where(np.isfinite(t_entry), t_entry, 0.0) - self._edge * _START_MARGIN, 0.0)
        starts = self._scaled(origins + advance[:, None] * unit)
        return np.asarray(self._scene.run(starts, np.ascontiguousarray(unit, dtype=np.float32)), dtype=np.int64)

    def occluded(self, origins: Floats, segments: Floats) -> NDArray[np.bool_]:
        """Whether a triangle lies between each origin and origin + segment, bool [n]."""
        if len(origins) == 0:
            return np.zeros(0, dtype=np.bool_)
        ends = np.ascontiguousarray(segments / self._edge, dtype=np.float32)
        limits = np.ones(len(origins), dtype=np.float32)
        found = self._scene.run(self._scaled(origins), ends, limits, query="OCCLUDED")
        return np.asarray(found) >= 0

    def surface_points(self, faces: NDArray[np.int64], origins: Floats, directions: Floats) -> SurfacePoints:
        """Hit point of each ray on the triangle that `first_hits` returned for it, in float64."""
        relative = self.corners[faces] - origins[:, None, :]
        # Edge functions of the triangle projected along the ray, as signed volumes of the ray and each edge.
        following, last = np.roll(relative, -1, axis=1), np.roll(relative, -2, axis=1)
        edges = np.einsum("nij,nj->ni", np.cross(following, last), directions)
        total = edges.sum(axis=1, keepdims=True)
        edges = np.where(total < 0, -edges, edges).clip(min=0.0)
        total = edges.sum(axis=1, keepdims=True)
        weights = np.where(total > 0, edges / np.where(total > 0, total, 1.0), 1 / 3)
        offset = np.einsum("ni,nij->nj", weights, relative)
        t = np.einsum("nj,nj->n", offset, directions) / np.einsum("nj,nj->n", directions, directions)
        return SurfacePoints(origins + t[:, None] * directions, weights, t)
