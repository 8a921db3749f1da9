"""The reference backend: frames traced by Embree in floating point, without the hardware's rounding."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence

from colonnade.common.accumulation import Accumulation
from colonnade.common.progress import Progress
from colonnade.design.manifest import Manifest
from colonnade.environment.load import load_environment
from colonnade.reference.environment.depth_mesh import full_backdrop
from colonnade.reference.render import ReferenceResult, render_reference
from colonnade.render.report import FrameReport, MeshReport
from colonnade.render.result import RenderResult
from colonnade.scene.model import Scene
from colonnade.scene.object_mesh import object_mesh
from colonnade.scene.view import make_view


def reference_frames(
    poses: Sequence[Scene], manifest: Manifest, size: tuple[int, int], progress: Progress, exposure: float = 0.0
) -> Iterator[RenderResult]:
    """Render a scene's poses along its motion, at the samples of the device's frames.

    Args:
        poses: The scene at the beginning of each frame.
        manifest: Of the design, for its configuration.
        size: Width and height, pixels.
        progress: Shows the steps.
        exposure: Progress of the motion during a frame (`Motion.exposure`).
    """
    begun = time.perf_counter()
    scene = poses[0]
    mesh = object_mesh(scene, int(manifest.config["frame"]["materials"]))
    environment = backdrop = None
    if scene.background.room is not None:
        environment = load_environment(scene.background.room)
        backdrop = full_backdrop(environment)
    views = [
        [make_view(one, mesh.extent, *size, mesh.materials, environment) for one in pose.passes(exposure)]
        for pose in poses
    ]
    packed = time.perf_counter() - begun
    for pose, of_frame in zip(poses, views, strict=True):
        begun = time.perf_counter()
        first = render_reference(mesh, of_frame[0], progress, backdrop)
        sums, rays = _accumulated(first), first.rays
        for view in of_frame[1:]:
            other = render_reference(mesh, view, progress, backdrop)
            sums += _accumulated(other)
            rays = {kind: count + other.rays[kind] for kind, count in rays.items()}
        report = FrameReport(
            backend="reference",
            config=manifest.config,
            mesh=MeshReport(mesh.name, len(mesh.faces), mesh.source_count),
            size=size,
            rays=rays,
            share=pose.motion_progress,
            seconds={"pack": packed, "build": None, "run": time.perf_counter() - begun},
            samples=len(of_frame),
        )
        yield RenderResult(sums.image(), first.object_mask, first.hit_triangles, first.t, report, sums)


def _accumulated(frame: ReferenceResult) -> Accumulation:
    return Accumulation.of_pixels(frame.image, frame.object_mask, frame.shadow_ratio)
