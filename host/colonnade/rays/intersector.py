"""Rays with trimesh's interface: ``mesh.ray = RayMeshIntersector(mesh)``."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from colonnade.common.types import Floats
from colonnade.design.config_name import Overrides
from colonnade.rays.scene import Backend, Hits, Scene

Indices = NDArray[np.int64]


class RayMeshIntersector:
    """The ray queries of a ``trimesh.Trimesh``, as its `ray_pyembree` and `ray_triangle` have them.

    Args:
        geometry: The mesh; when it changes, the next query packs it anew.
        config: The design, as of `Scene`.
        overrides: Its settings.
        scale_to_box: Ignored; a scene has its own scale.
        backend: As of `Scene`.
    """

    def __init__(
        self,
        geometry: Any,
        config: str | None = None,
        overrides: Overrides = (),
        scale_to_box: bool = True,
        backend: Backend = "model",
    ) -> None:
        self.mesh = geometry
        self._design = partial(Scene, config=config, overrides=overrides, backend=backend)
        self._packed: tuple[int, Scene] | None = None

    @property
    def scene(self) -> Scene:
        """The mesh, packed."""
        key = hash(self.mesh)
        if self._packed is None or self._packed[0] != key:
            self._packed = key, self._design(self.mesh.vertices, self.mesh.faces)
        return self._packed[1]

    def intersects_id(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        max_hits: int = 20,
        return_locations: bool = False,
    ) -> tuple[NDArray[Any], ...]:
        """Faces and rays of the hits, and with `return_locations` where they are, float64 [n, 3].

        Where a ray meets an edge or a vertex, one face of it is a hit.
        """
        rays = _rays_of(ray_origins, ray_directions)
        hits = self.scene.all(rays) if multiple_hits else _chosen(first := self.scene.closest(rays), first.face >= 0)
        if multiple_hits and len(hits.ray):
            hits = self._without_equal_places(hits, max_hits)
        if return_locations:
            return hits.face, hits.ray, rays[hits.ray, :3] + hits.t[:, None] * rays[hits.ray, 4:7]
        return hits.face, hits.ray

    def _without_equal_places(self, hits: Hits, max_hits: int) -> Hits:
        step = np.diff(hits.t, prepend=-np.inf) > self.scene.unit / 1024
        keep = step | (np.diff(hits.ray, prepend=-1) != 0)
        hits = _chosen(hits, keep)
        first = np.searchsorted(hits.ray, hits.ray)
        return _chosen(hits, np.arange(len(first)) - first < max_hits)

    def intersects_location(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, multiple_hits: bool = True
    ) -> tuple[Floats, Indices, Indices]:
        """Where rays hit, float64 [n, 3], the rays and the faces."""
        faces, rays, locations = self.intersects_id(ray_origins, ray_directions, multiple_hits, return_locations=True)
        return locations, rays, faces

    def intersects_first(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> Indices:
        """The face that each ray hits first; -1 for a miss."""
        return self.scene.closest(_rays_of(ray_origins, ray_directions)).face

    def intersects_any(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> NDArray[np.bool_]:
        """Whether each ray hits a face."""
        return self.scene.occluded(_rays_of(ray_origins, ray_directions))

    def contains_points(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Whether points are inside the mesh, which must be closed."""
        from trimesh.ray.ray_util import contains_points

        inside: NDArray[np.bool_] = contains_points(self, points)
        return inside


def _chosen(hits: Hits, keep: NDArray[np.bool_]) -> Hits:
    return Hits(**{name: values[keep] for name, values in vars(hits).items()})


def _rays_of(origins: ArrayLike, directions: ArrayLike) -> Floats:
    """Rays [n, 8] without limits; their directions have length 1."""
    start, way = np.asarray(origins, dtype=np.float64), np.asarray(directions, dtype=np.float64)
    if start.shape != way.shape or start.ndim != 2 or start.shape[1] != 3:
        raise ValueError(f"origins {start.shape} and directions {way.shape} must both be (n, 3)")
    length = np.linalg.norm(way, axis=1, keepdims=True)
    way = np.divide(way, length, out=np.zeros_like(way), where=length > 0)
    ends = np.zeros((len(start), 1))
    return np.hstack([start, ends, way, ends + np.inf])
