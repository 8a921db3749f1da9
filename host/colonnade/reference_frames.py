"""Frames of a scene without any of the hardware's rounding, as `colonnade render --backend reference` has them."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence

from colonnade.depth_mesh import full_backdrop
from colonnade.manifest import Manifest
from colonnade.meshes import load_mesh
from colonnade.progress import Progress
from colonnade.reference import render_reference
from colonnade.render import RenderResult
from colonnade.room import load_room
from colonnade.scene import Scene
from colonnade.viewpoint import float_placement


def reference_frames(
    places: Sequence[Scene], manifest: Manifest, size: tuple[int, int], progress: Progress
) -> Iterator[RenderResult]:
    """Frames of one scene at several shares of its motion."""
    begun = time.perf_counter()
    scene = places[0]
    mesh = load_mesh(scene.mesh_source)
    room = backdrop = None
    if scene.background.room is not None:
        room = load_room(scene.background.room)
        backdrop = full_backdrop(room)
    views = [float_placement(place, mesh.extent, *size, mesh.materials, room) for place in places]
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
