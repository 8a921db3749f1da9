"""Frames of a scene without any of the hardware's rounding, as `colonnade render --backend reference` has them."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence

from colonnade.common.progress import Progress
from colonnade.design.manifest import Manifest
from colonnade.environment.load import load_environment
from colonnade.mesh.load import load_mesh
from colonnade.reference.environment.depth_mesh import full_backdrop
from colonnade.reference.render import render_reference
from colonnade.render.result import RenderResult
from colonnade.scene.model import Scene
from colonnade.scene.view import make_view


def reference_frames(
    places: Sequence[Scene], manifest: Manifest, size: tuple[int, int], progress: Progress
) -> Iterator[RenderResult]:
    """Frames of one scene at several shares of its motion."""
    begun = time.perf_counter()
    scene = places[0]
    mesh = load_mesh(scene.mesh_source)
    environment = backdrop = None
    if scene.background.room is not None:
        environment = load_environment(scene.background.room)
        backdrop = full_backdrop(environment)
    views = [make_view(place, mesh.extent, *size, mesh.materials, environment) for place in places]
    packed = time.perf_counter() - begun
    for place, view in zip(places, views, strict=True):
        begun = time.perf_counter()
        reference = render_reference(mesh, view, progress, backdrop)
        report = {
            "backend": "reference",
            "config": manifest.config,
            "mesh": {"name": mesh.name, "triangles": len(mesh.faces), "source_triangles": mesh.source_count},
            "size": list(size),
            "cycles": None,
            "rays": reference.rays,
            "rays_per_cycle": None,
            "rays_per_cycle_in_box": None,
            "counters": {},
            "errors": [],
            "share": place.share,
            "seconds": {"pack": packed, "build": None, "run": time.perf_counter() - begun},
        }
        yield RenderResult(reference.image, reference.object_mask, reference.hit_triangles, reference.t, report)
