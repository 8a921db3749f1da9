"""Rays of applications, and their hits in double."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from colonnade.mesh.load import load_mesh

Floats = NDArray[np.float64]
#: 24 bits a coordinate of a vertex, 32 of a triangle test.
EXACT = ("geometry.vertexBits=24", "geometry.triangleBits=32")


def rays_of(origins: Any, directions: Any, near: Any = 0.0, far: Any = np.inf) -> Floats:
    parts = (origins, near, directions, far)
    columns = [
        np.broadcast_to(np.asarray(part, float).reshape(-1, w), (len(origins), w))
        for part, w in zip(parts, (3, 1, 3, 1), strict=True)
    ]
    return np.hstack(columns)


def outside_rays(vertices: Floats, count: int, seed: int, distance: float = 2.0) -> Floats:
    """Rays from a sphere of so many edges of the box to places in it; float32 values."""
    random = np.random.default_rng(seed)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    way = random.normal(size=(count, 3))
    start = (low + high) / 2 + distance * (high - low).max() * way / np.linalg.norm(way, axis=1, keepdims=True)
    aim = low + random.random((count, 3)) * (high - low) - start
    return rays_of(start, aim / np.linalg.norm(aim, axis=1, keepdims=True)).astype(np.float32).astype(np.float64)


def plane_hits(vertices: Floats, faces: NDArray[np.int64], rays: Floats) -> tuple[Floats, Floats]:
    """t of each ray with each face's plane, and the least weight of a corner there, in double [rays, faces]."""
    corners, start, way = vertices[faces], rays[:, :3], rays[:, 4:7]
    lines = np.hstack([way, np.cross(start, way)])
    volumes = []
    for k in range(3):
        one, other = corners[:, (k + 1) % 3], corners[:, (k + 2) % 3]
        volumes.append(lines @ np.hstack([np.cross(one, other), other - one]).T)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        total = way @ normals.T
        t = ((corners[:, 0] * normals).sum(axis=1) - start @ normals.T) / total
        return t, np.min([volume / total for volume in volumes], axis=0)


def truth(vertices: Floats, faces: NDArray[np.int64], rays: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Face (-1: a miss) and t of the closest hits, by all faces in double."""
    found, ts = [], []
    for part in np.array_split(rays, max(1, len(rays) * len(faces) // 1_000_000)):
        t, least = plane_hits(vertices, faces, part)
        t = np.where((least >= 0) & (t >= part[:, 3:4]) & (t <= part[:, 7:]), t, np.inf)
        nearest = t.argmin(axis=1)
        ts.append(t[np.arange(len(part)), nearest].astype(float))
        found.append(np.where(np.isfinite(ts[-1]), nearest, -1))
    return np.concatenate(found), np.concatenate(ts)


def mesh_of(name: str) -> tuple[Floats, NDArray[np.int64]]:
    mesh = load_mesh(name)
    return mesh.vertices.astype(np.float32).astype(np.float64), mesh.faces.astype(np.int64)
