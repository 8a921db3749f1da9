"""The reference backend: frames traced by Embree in floating point, without the hardware's rounding."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from colonnade.common.accumulation import Accumulation
from colonnade.common.errors import UserError
from colonnade.common.progress import QUIET, Progress
from colonnade.common.types import Floats
from colonnade.design.manifest import Manifest
from colonnade.environment.light_cube import LightCube
from colonnade.maps.cache import encoded_environment
from colonnade.maps.encoded import layout_of
from colonnade.maps.layout import AttributeLayout
from colonnade.reference.environment.decoded import BoundingPlanes
from colonnade.reference.environment.depth_mesh import full_backdrop
from colonnade.reference.environment.true_room import true_room
from colonnade.reference.render import ReferenceResult, render_reference
from colonnade.render.camera_look import CameraLook
from colonnade.render.composite import composited
from colonnade.render.report import FrameReport, MeshReport
from colonnade.render.result import RenderResult
from colonnade.render.samples import tell_defaults
from colonnade.render.sky import sky_of
from colonnade.scene.cameras import check_camera
from colonnade.scene.lit_room import LitRoom, lit_room, scene_room, view_photo
from colonnade.scene.model import Scene
from colonnade.scene.object_mesh import SurfaceFeatures, object_mesh, with_materials
from colonnade.scene.object_pose import Placed
from colonnade.scene.passes import frame_passes
from colonnade.scene.prepared.gathered_light import scene_cube
from colonnade.scene.view import make_view, rendered_materials, with_overrides

if TYPE_CHECKING:
    from colonnade.environment.model import Environment
    from colonnade.mesh.materials.mesh import Mesh
    from colonnade.reference.environment.surface import Backdrop


@dataclass(frozen=True)
class ReferenceOptions:
    """Options of the reference's frames.

    Attributes:
        exposure: Progress of the motion during a frame (`Scene.opening`).
        relit: Show the room under the scene's lights, not its photo.
        truth: Mesh file of the room's real geometry, which replaces its depth map.
        note: The line that names defaults; None without any.
    """

    exposure: float = 0.0
    relit: bool = False
    truth: Path | None = None
    note: str | None = None


def reference_frames(
    poses: Sequence[Scene],
    manifest: Manifest,
    size: tuple[int, int],
    progress: Progress,
    options: ReferenceOptions = ReferenceOptions(),
    mesh: Mesh | None = None,
) -> Iterator[RenderResult]:
    """Render a scene's poses along its motion, at the samples of the device's frames and composited as these are.

    Args:
        poses: The scene at the beginning of each frame, the first at rest.
        manifest: The design's manifest, for the number of lights and the layout of the room's maps.
        size: Width and height, pixels.
        progress: Shows the steps.
        options: Further options.
        mesh: A mesh that replaces the scene's own, which is not read.
    """
    begun = time.perf_counter()
    maps = scene_room(poses[0])
    mesh = mesh or object_mesh(poses[0], maps, manifest.corner_colours)
    mesh = with_materials(poses[0], mesh, SurfaceFeatures.of(manifest))
    layout = None if manifest.config["physicalAttributeMemory"] is None else layout_of(manifest)
    max_lights = int(manifest.config["frame"]["lights"])
    for pose, traced in zip(
        poses, traced_frames(poses, mesh, maps, size, max_lights, layout, options, progress), strict=True
    ):
        report = FrameReport(
            backend="reference",
            config=manifest.config,
            mesh=MeshReport(mesh.name, len(mesh.faces), mesh.source_count),
            size=size,
            rays=traced.rays,
            share=pose.motion_progress,
            seconds={"pack": time.perf_counter() - begun - traced.seconds, "build": None, "run": traced.seconds},
            samples=traced.sums.samples,
        )
        first = traced.first
        yield RenderResult(
            traced.image, first.object_mask, first.hit_triangles, first.t, report, traced.sums, parts=mesh.parts
        )
        begun = time.perf_counter()


@dataclass(frozen=True)
class TracedFrame:
    """A frame of the reference.

    Attributes:
        image: Linear, float64 [height, width, 3].
        first: The first pass.
        sums: Sums over all passes.
        rays: Rays of all passes, by kind.
        seconds: Time of tracing.
    """

    image: Floats
    first: ReferenceResult
    sums: Accumulation
    rays: dict[str, int]
    seconds: float


def traced_frames(
    poses: Sequence[Scene],
    mesh: Mesh,
    maps: Environment | None,
    size: tuple[int, int],
    max_lights: int,
    layout: AttributeLayout | None = None,
    options: ReferenceOptions = ReferenceOptions(),
    progress: Progress = QUIET,
) -> Iterator[TracedFrame]:
    """Trace poses of a scene in the room ``maps``, with bounding planes of ``layout`` or else of the default one."""
    check_camera(poses[0], maps, size)
    photo = None if options.relit else view_photo(poses[0], maps, size)
    look = CameraLook.of(poses[0], photo, size)
    if look is not None:
        look.tell(maps)
    surfaces = rendered_materials(mesh.materials, poses[0])
    room = lit_room(Placed(poses[0], mesh.extent, maps), max_lights, options.relit, progress, surfaces)
    backdrop = room_backdrop(room, layout, options.truth, progress)
    for number, pose in enumerate(poses):
        begun = time.perf_counter()
        lit = room.with_scene(room.scene.at(pose.motion_progress))
        cube = _light_cube(lit, layout, options.relit, number == 0)
        if number == 0:
            tell_defaults(options.note, maps)
        materials = with_overrides(mesh.materials, lit.scene.material)
        passes = frame_passes(lit.scene, materials, options.exposure)
        first: ReferenceResult | None = None
        layers: dict[str, Accumulation] = {}
        rays: Counter[str] = Counter()
        for one in passes:
            view = make_view(lit.placed.with_scene(one), *size, mesh.materials)
            if cube is not None and view.gather is not None:
                view = replace(view, gather=replace(view.gather, cube=cube))
            found = render_reference(mesh, view, progress, backdrop)
            first = first or found
            rays.update(found.rays)
            sums = Accumulation.of_pixels(found.image, found.object_mask, found.shadow_ratio, lit.scene.exposure)
            layer = one.sample.layer
            layers[layer] = layers[layer] + sums if layer in layers else sums
        assert first is not None
        sums = layers.pop("surface").with_layers(layers.values())
        image = composited(sums, photo, room.strength, look, number, sky_of(lit.placed, passes, size))
        yield TracedFrame(image, first, sums, dict(rays), time.perf_counter() - begun)


def _light_cube(room: LitRoom, layout: AttributeLayout | None, relit: bool, is_noted: bool) -> LightCube | None:
    environment = room.environment
    image = None
    if room.scene.paths.gather and environment is not None:
        image = encoded_environment(environment, _layout_for(environment, layout), encoder=None)
    return scene_cube(room, image, relit, is_noted)


def _layout_for(environment: Environment, layout: AttributeLayout | None) -> AttributeLayout:
    """The layout, or else the default one of the room's size."""
    if layout is None or (layout.width, layout.height) != (environment.width, environment.height):
        return AttributeLayout(environment.width, environment.height)
    return layout


def room_backdrop(
    room: LitRoom, layout: AttributeLayout | None, truth: Path | None = None, progress: Progress = QUIET
) -> Backdrop | None:
    """The room of a scene as background: full maps, and depth map or real geometry.

    Without gathered light it has the device's bounding planes.
    """
    environment = room.environment
    if environment is None:
        if truth is not None:
            raise UserError("--truth is the real geometry of a room, but the scene has none: set background.room")
        return None
    bounding = None
    if room.scene.paths.gather == 0:
        with progress.step("finding the bounding planes"):
            bounding = BoundingPlanes(
                environment, encoded_environment(environment, _layout_for(environment, layout), encoder=None)
            )
    if truth is not None:
        assert room.albedo is not None
        return true_room(truth, environment, room.albedo.albedo, 1.0 / room.scene.headroom, bounding)
    return full_backdrop(environment, bounding)
