"""Rays against a float mesh with Embree, made exact where its 32 bits are not.

Embree says which triangle a ray meets first; where on it, and how far, is computed here in 64 bits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats

#: Rays start this share of the box's edge before the box, so that 32-bit coordinates stay small.
_RUN_UP = 1 / 64


class Surface(Protocol):
    """Triangles: vertices float64 [n, 3], faces int32 [m, 3]; a mesh is one."""

    @property
    def vertices(self) -> Floats:
        """Positions."""

    @property
    def faces(self) -> NDArray[np.int32]:
        """Rows of `vertices`."""


@dataclass(frozen=True)
class Triangles:
    """A surface without more.

    Attributes:
        vertices: float64 [n, 3].
        faces: int32 [m, 3].
    """

    vertices: Floats
    faces: NDArray[np.int32]


@dataclass(frozen=True)
class SurfacePoints:
    """Where rays meet their triangles.

    Attributes:
        position: float64 [n, 3], mesh space.
        weights: float64 [n, 3], barycentric, none negative, their sum is 1.
        t: float64 [n], in lengths of the ray's direction.
    """

    position: Floats
    weights: Floats
    t: Floats


class RayTracer:
    """A mesh that rays can be aimed at. All positions and directions are in mesh space, float64 [n, 3]."""

    def __init__(self, mesh: Surface) -> None:
        """Build Embree's scene of ``mesh``, in its robust (watertight) mode."""
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self.corners: Floats = mesh.vertices[mesh.faces]
        self.low: Floats = mesh.vertices.min(axis=0)
        self.high: Floats = mesh.vertices.max(axis=0)
        self._centre: Floats = (self.low + self.high) / 2
        self._edge = float((self.high - self.low).max())
        self._scene = EmbreeScene(robust=True)
        TriangleMesh(self._scene, self._scaled(mesh.vertices), np.ascontiguousarray(mesh.faces, dtype=np.int32))

    def _scaled(self, positions: Floats) -> NDArray[np.float32]:
        return np.ascontiguousarray((positions - self._centre) / self._edge, dtype=np.float32)

    def enters_box(
        self, origins: Floats, directions: Floats, limit: float = np.inf
    ) -> tuple[NDArray[np.bool_], Floats]:
        """Whether each ray meets the mesh's box before ``limit`` directions, and where it enters, float64 [n]."""
        with np.errstate(divide="ignore", invalid="ignore"):
            planes = np.stack([(plane - origins) / directions for plane in (self.low, self.high)])
        # A ray inside a plane and along it: 0/0; that plane does not bound the ray.
        near = np.where(np.isnan(planes).any(axis=0), -np.inf, planes.min(axis=0)).max(axis=1)
        far = np.where(np.isnan(planes).any(axis=0), np.inf, planes.max(axis=0)).min(axis=1)
        entry = np.maximum(near, 0.0)
        return (entry <= far) & (entry <= limit), entry

    def first_hits(self, origins: Floats, directions: Floats) -> NDArray[np.int64]:
        """Row in the mesh's faces of the first triangle that each ray meets, int64 [n]; -1 where it meets none."""
        lengths = np.linalg.norm(directions, axis=1, keepdims=True)
        unit = directions / lengths
        _, entry = self.enters_box(origins, unit)
        advance = np.maximum(np.where(np.isfinite(entry), entry, 0.0) - self._edge * _RUN_UP, 0.0)
        starts = self._scaled(origins + advance[:, None] * unit)
        return np.asarray(self._scene.run(starts, np.ascontiguousarray(unit, dtype=np.float32)), dtype=np.int64)

    def occluded(self, origins: Floats, segments: Floats) -> NDArray[np.bool_]:
        """Whether anything lies between each origin and origin + segment, bool [n]."""
        if len(origins) == 0:
            return np.zeros(0, dtype=np.bool_)
        ends = np.ascontiguousarray(segments / self._edge, dtype=np.float32)
        limits = np.ones(len(origins), dtype=np.float32)
        found = self._scene.run(self._scaled(origins), ends, limits, query="OCCLUDED")
        return np.asarray(found) >= 0

    def surface_points(self, faces: NDArray[np.int64], origins: Floats, directions: Floats) -> SurfacePoints:
        """Where each ray meets the triangle that `first_hits` named for it, in 64 bits."""
        relative = self.corners[faces] - origins[:, None, :]
        # Signed volumes of the ray and each edge: the edge functions of a projection along the ray.
        following, last = np.roll(relative, -1, axis=1), np.roll(relative, -2, axis=1)
        edges = np.einsum("nij,nj->ni", np.cross(following, last), directions)
        total = edges.sum(axis=1, keepdims=True)
        edges = np.where(total < 0, -edges, edges).clip(min=0.0)
        total = edges.sum(axis=1, keepdims=True)
        weights = np.where(total > 0, edges / np.where(total > 0, total, 1.0), 1 / 3)
        offset = np.einsum("ni,nij->nj", weights, relative)
        t = np.einsum("nj,nj->n", offset, directions) / np.einsum("nj,nj->n", directions, directions)
        return SurfacePoints(origins + t[:, None] * directions, weights, t)
