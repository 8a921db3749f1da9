"""Rays of applications: kinds of rays, and how many of them model and Embree answer a second."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np
from colonnade.common.types import Floats
from colonnade.design.generator import manifest_for
from colonnade.mesh.materials.mesh import Mesh
from colonnade.rays import Scene

#: Counters of what rays read.
READS = ("nodeReads", "triangleTests")
#: Kinds of rays; "shuffled" ones have no order, the others `Scene.order`.
KINDS = ("outside", "outside, shuffled", "off the surface", "off the surface, shuffled", "occlusion")


@dataclass(frozen=True)
class RayRates:
    """Rays of a kind.

    Attributes:
        kind: One of `KINDS`.
        hits: Rays that hit, of the model.
        embree_hits: Rays that hit, of Embree; None without embreex.
        model: Rays a second of the model.
        embree: Rays a second of Embree; None without embreex.
        node_reads: Nodes that a ray reads.
        triangle_tests: Triangles that a ray tests.
        dram_bytes: Bytes that the design's caches read for a ray; None without caches.
    """

    kind: str
    hits: int
    embree_hits: int | None
    model: float
    embree: float | None
    node_reads: float
    triangle_tests: float
    dram_bytes: float | None


def rays_of_kind(kind: str, mesh: Mesh, count: int) -> Floats:
    """Rays [count, 8] of a kind, float32 values; a name's are always the same."""
    random = np.random.default_rng(len(kind.partition(",")[0]))
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    edge, way = (high - low).max(), random.normal(size=(count, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    if kind.startswith("outside"):
        start = (low + high) / 2 + 2 * edge * way
        way = low + random.random((count, 3)) * (high - low) - start
    else:
        corners = mesh.vertices[mesh.faces[random.integers(len(mesh.faces), size=count)]]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        start = (random.dirichlet([1, 1, 1], size=count)[:, :, None] * corners).sum(axis=1) + 1e-3 * edge * normals
        way = way + normals
    ends = np.zeros((count, 1))
    return np.hstack([start, ends, way, ends + np.inf]).astype(np.float32).astype(np.float64)


def measured(mesh: Mesh, config: str, overrides: tuple[str, ...], count: int) -> Iterator[RayRates]:
    """Rates of each kind; the time of Embree has its conversion from arrays, as the model's has."""
    scene, embree = Scene(mesh.vertices, mesh.faces, config, overrides), embree_of(mesh)
    has_caches = manifest_for(config, overrides).manifest.config["columnBvhMemory"]["cache"] is not None
    for kind in KINDS:
        rays = rays_of_kind(kind, mesh, count)
        if not kind.endswith("shuffled"):
            rays = rays[scene.order(rays)]
        before = scene.counters()
        is_occlusion = kind == "occlusion"
        answer, seconds = _timed(partial(scene.occluded if is_occlusion else scene.closest, rays))
        hits = answer if is_occlusion else answer.face >= 0
        reads = {name: scene.counters()[name] - before[name] for name in READS}
        other = embree_hits = None
        if embree is not None:
            parts = rays[:, :3].astype(np.float32), rays[:, 4:7].astype(np.float32)
            run = partial(embree.run, query="OCCLUDED" if is_occlusion else "INTERSECT")
            run(*(part[:1] for part in parts))  # its first call builds the tree
            found, other_seconds = _timed(partial(run, *parts))
            other, embree_hits = count / other_seconds, int((found >= 0).sum())
        dram_bytes = scene.traffic(rays, is_occlusion).bytes / count if has_caches else None
        yield RayRates(
            kind,
            int(hits.sum()),
            embree_hits,
            count / seconds,
            other,
            reads["nodeReads"] / count,
            reads["triangleTests"] / count,
            dram_bytes,
        )


def report(rates: list[RayRates]) -> list[dict[str, Any]]:
    """Rates as JSON."""
    return [asdict(each) for each in rates]


def embree_of(mesh: Mesh) -> Any:
    """Embree's scene of a mesh, by embreex; None without it."""
    try:
        from embreex import rtcore_scene
        from embreex.mesh_construction import TriangleMesh
    except ImportError:
        return None
    scene = rtcore_scene.EmbreeScene()
    TriangleMesh(scene=scene, vertices=mesh.vertices.astype(np.float32), indices=mesh.faces.astype(np.int32))
    return scene


def _timed(call: Callable[[], Any]) -> tuple[Any, float]:
    begin = time.perf_counter()
    result = call()
    return result, time.perf_counter() - begin
