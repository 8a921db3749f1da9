"""The reference backend: frames traced by Embree in floating point, without the hardware's rounding."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from colonnade.common.errors import UserError
from colonnade.common.progress import QUIET, Progress
from colonnade.common.types import Floats
from colonnade.design.manifest import Manifest
from colonnade.environment.encoded import layout_of
from colonnade.environment.encoding.cache import encoded_environment
from colonnade.environment.encoding.layout import AttributeLayout
from colonnade.mesh.load import load_mesh
from colonnade.reference.environment.decoded import BoundingPlanes
from colonnade.reference.environment.depth_mesh import full_backdrop
from colonnade.reference.environment.true_room import true_room
from colonnade.reference.render import ReferenceResult, render_reference
from colonnade.render.composite import composited
from colonnade.render.lit_room import LitRoom, lit_room, scene_room
from colonnade.render.report import FrameReport, MeshReport
from colonnade.render.result import RenderResult
from colonnade.scene.cameras import environment_camera
from colonnade.scene.model import Scene
from colonnade.scene.view import make_view

if TYPE_CHECKING:
    from colonnade.mesh.mesh import Mesh
    from colonnade.reference.environment.surface import Backdrop


def reference_frames(
    poses: Sequence[Scene],
    manifest: Manifest,
    size: tuple[int, int],
    progress: Progress,
    relit: bool = False,
    truth: Path | None = None,
) -> Iterator[RenderResult]:
    """Render a scene's poses along its motion, composited with the room's photo as the device's frames are.

    Args:
        poses: The scene at each progress, the first at rest.
        manifest: The design's manifest, for the number of lights and the layout of the room's maps.
        size: (width, height), pixels.
        progress: Shows the steps.
        relit: Show the room under the scene's lights, not its photo.
        truth: Mesh file of the room's real geometry, which replaces its depth map.
    """
    begun = time.perf_counter()
    mesh = load_mesh(poses[0].mesh_source)
    layout = None if manifest.config["physicalAttributeMemory"] is None else layout_of(manifest)
    max_lights = int(manifest.config["frame"]["lights"])
    for pose, traced in zip(
        poses, traced_frames(poses, mesh, size, max_lights, layout, relit, truth, progress), strict=True
    ):
        seconds = {"pack": time.perf_counter() - begun - traced.seconds, "build": None, "run": traced.seconds}
        report = FrameReport(
            backend="reference",
            config=manifest.config,
            mesh=MeshReport(mesh.name, len(mesh.faces), mesh.source_count),
            size=size,
            rays=traced.frame.rays,
            share=pose.motion_progress,
            seconds=seconds,
        )
        frame = traced.frame
        yield RenderResult(traced.image, frame.object_mask, frame.hit_triangles, frame.t, report)
        begun = time.perf_counter()


@dataclass(frozen=True)
class TracedFrame:
    """A frame of the reference: its picture, linear, float64 [height, width, 3], what was traced, and its seconds."""

    image: Floats
    frame: ReferenceResult
    seconds: float


def traced_frames(
    poses: Sequence[Scene],
    mesh: Mesh,
    size: tuple[int, int],
    max_lights: int,
    layout: AttributeLayout | None = None,
    relit: bool = False,
    truth: Path | None = None,
    progress: Progress = QUIET,
) -> Iterator[TracedFrame]:
    """Trace poses of a scene; without a ``layout`` the room's bounding planes are those of the default one."""
    maps = scene_room(poses[0])
    if maps is not None:
        environment_camera(maps, *size)
    room = lit_room(poses[0], maps, mesh.extent, max_lights, relit, progress)
    backdrop = room_backdrop(room, layout, truth, progress)
    for pose in poses:
        begun = time.perf_counter()
        view = make_view(room.scene.at(pose.motion_progress), mesh.extent, *size, mesh.materials, room.environment)
        frame = render_reference(mesh, view, progress, backdrop)
        image = frame.image
        if room.environment is not None and not relit:
            image = composited(image, frame.object_mask, frame.shadow_ratio, room.environment)
        yield TracedFrame(image, frame, time.perf_counter() - begun)


def room_backdrop(
    room: LitRoom, layout: AttributeLayout | None, truth: Path | None = None, progress: Progress = QUIET
) -> Backdrop | None:
    """The room of a scene as background: full maps, the device's bounding planes, and depth map or real geometry."""
    environment = room.environment
    if environment is None:
        if truth is not None:
            raise UserError("--truth is the real geometry of a room, but the scene has none: set background.room")
        return None
    if layout is None or (layout.width, layout.height) != (environment.width, environment.height):
        layout = AttributeLayout(environment.width, environment.height)
    with progress.step("finding the bounding planes"):
        bounding = BoundingPlanes(environment, encoded_environment(environment, layout))
    if truth is not None:
        assert room.albedo is not None
        return true_room(truth, environment, room.albedo.albedo, 1.0 / room.scene.headroom, bounding)
    return full_backdrop(environment, bounding)
