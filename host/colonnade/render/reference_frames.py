"""The reference backend: frames traced by Embree in floating point, without the hardware's rounding."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence

from colonnade.common.progress import Progress
from colonnade.design.manifest import Manifest
from colonnade.environment.load import load_environment
from colonnade.reference.environment.depth_mesh import full_backdrop
from colonnade.reference.render import render_reference
from colonnade.render.report import FrameReport, MeshReport
from colonnade.render.result import RenderResult
from colonnade.scene.model import Scene
from colonnade.scene.object_mesh import object_mesh
from colonnade.scene.view import make_view


def reference_frames(
    poses: Sequence[Scene], manifest: Manifest, size: tuple[int, int], progress: Progress
) -> Iterator[RenderResult]:
    """Render a scene's poses along its motion. `size` is (width, height), pixels."""
    begun = time.perf_counter()
    scene = poses[0]
    mesh = object_mesh(scene, int(manifest.config["frame"]["materials"]))
    environment = backdrop = None
    if scene.background.room is not None:
        environment = load_environment(scene.background.room)
        backdrop = full_backdrop(environment)
    views = [make_view(pose, mesh.extent, *size, mesh.materials, environment) for pose in poses]
    packed = time.perf_counter() - begun
    for pose, view in zip(poses, views, strict=True):
        begun = time.perf_counter()
        reference = render_reference(mesh, view, progress, backdrop)
        report = FrameReport(
            backend="reference",
            config=manifest.config,
            mesh=MeshReport(mesh.name, len(mesh.faces), mesh.source_count),
            size=size,
            rays=reference.rays,
            share=pose.motion_progress,
            seconds={"pack": packed, "build": None, "run": time.perf_counter() - begun},
        )
        yield RenderResult(reference.image, reference.object_mask, reference.hit_triangles, reference.t, report)
