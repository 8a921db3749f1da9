"""Errors of hits against double, by design and kind of ray; units are 1/65,535 of the box's longest edge."""

from __future__ import annotations

import numpy as np
import pytest
from exact_rays import EXACT, Floats, mesh_of, outside_rays, rays_of, truth
from numpy.typing import NDArray

from colonnade.rays import Scene

#: Design; kind of ray; bounds: share of wrong hits or misses, of other faces, t (half, 99 %), u and v (99 %).
BOUNDS = (
    ((), "outside", 0.002, 0.01, 0.5, 8, 2e-2),
    (EXACT, "outside", 0.0005, 0.0005, 0.005, 0.03, 5e-5),
    ((), "surface", 0.002, 0.02, 0.6, 8, 2e-2),
    (EXACT, "surface", 0.0005, 0.0005, 0.003, 0.06, 5e-5),
    ((), "far", 0.002, 0.01, 0.5, 8, 2e-2),
    (EXACT, "far", 0.0005, 0.001, 0.01, 0.06, 5e-5),
)


def rays_by_kind(kind: str, vertices: Floats, faces: NDArray[np.int64], count: int) -> Floats:
    if kind != "surface":
        return outside_rays(vertices, count, seed=11, distance={"outside": 2, "far": 500}[kind])
    random = np.random.default_rng(12)
    chosen = random.integers(len(faces), size=count)
    corners = vertices[faces[chosen]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    start = (random.dirichlet([1, 1, 1], size=count)[:, :, None] * corners).sum(axis=1)
    way = random.normal(size=(count, 3))
    rays = rays_of(
        start + 1e-3 * np.ptp(vertices) * normals, way / np.linalg.norm(way, axis=1, keepdims=True) + normals
    )
    return rays.astype(np.float32).astype(np.float64)


def errors_of(mesh: str, count: int, kind: str, overrides: tuple[str, ...]) -> tuple[float, float, float, float, float]:
    """What `BOUNDS` bounds, of unrefined hits."""
    vertices, faces = mesh_of(mesh)
    rays = rays_by_kind(kind, vertices, faces, count)
    face, t = truth(vertices, faces, rays)
    hits = Scene(vertices, faces, overrides=overrides, refine=False).closest(rays)
    both, same = (hits.face >= 0) & (face >= 0), (hits.face == face) & (face >= 0)
    unit = np.ptp(vertices, axis=0).max() / 65535
    half, high = np.percentile(np.abs(hits.t[both] - t[both]) / unit, (50, 99))
    corners = vertices[faces[face[same]]]
    places = rays[same, :3] + t[same, None] * rays[same, 4:7]
    edges = corners[:, 1:] - corners[:, :1]
    exact = np.linalg.solve(edges @ edges.transpose(0, 2, 1), edges @ (places - corners[:, 0])[:, :, None])[:, :, 0]
    differs = ((hits.face >= 0) != (face >= 0)).mean()
    return (
        differs,
        (both & ~same).sum() / both.sum(),
        half,
        high,
        float(np.percentile(np.abs(hits.uv[same] - exact), 99)),
    )


@pytest.mark.parametrize(("overrides", "kind", "bounds"), [(each[0], each[1], each[2:]) for each in BOUNDS])
@pytest.mark.parametrize(("mesh", "count"), (("torus", 600), pytest.param("teapot", 4000, marks=pytest.mark.matrix)))
def test_errors_of_hits_are_within_the_bounds_of_the_design(
    mesh: str, count: int, overrides: tuple[str, ...], kind: str, bounds: tuple[float, ...]
) -> None:
    found = errors_of(mesh, count, kind, overrides)
    assert all(error <= bound for error, bound in zip(found, bounds, strict=True)), found
