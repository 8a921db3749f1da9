"""A plugin of pytest: `colonnade.rays` in place of both of trimesh's intersectors."""

from __future__ import annotations

import os

import trimesh.ray.ray_pyembree
import trimesh.ray.ray_triangle
from colonnade.rays import RayMeshIntersector

_BACKEND = os.environ.get("COLONNADE_RAYS_BACKEND", "model")
_CONFIG = os.environ.get("COLONNADE_RAYS_CONFIG", "edge")
_OVERRIDES = tuple(os.environ.get("COLONNADE_RAYS_OVERRIDES", "").split())


class Intersector(RayMeshIntersector):
    """The device's rays, with the arguments of trimesh's two classes."""

    def __init__(self, mesh: object = None, geometry: object = None, **options: bool) -> None:
        of = mesh if mesh is not None else geometry
        super().__init__(of, _CONFIG, _OVERRIDES, backend=_BACKEND, **options)


trimesh.ray.ray_pyembree.RayMeshIntersector = Intersector
trimesh.ray.ray_triangle.RayMeshIntersector = Intersector
