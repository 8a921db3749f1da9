"""The frames of a scene's motion by the model or the RTL."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace

from colonnade.common import notes
from colonnade.common.frame_size import Size
from colonnade.common.progress import QUIET, Progress
from colonnade.design.generator import design_for
from colonnade.design.manifest import Manifest
from colonnade.device.device import require_no_errors
from colonnade.mesh.materials.mesh import Mesh
from colonnade.render.camera_look import CameraLook
from colonnade.render.history import History
from colonnade.render.host_frame import HostFrame
from colonnade.render.passes import Registers, model_passes, rtl_passes
from colonnade.render.report import frame_report
from colonnade.render.request import RenderRequest
from colonnade.render.result import RenderResult
from colonnade.render.samples import tell_defaults, within_budget
from colonnade.scene.model import Scene
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene_image.inspect import coarse_line, dense_line, lost_line


def device_frames(
    request: RenderRequest, scene: Scene, manifest: Manifest, size: Size, note: str | None, progress: Progress
) -> Iterator[RenderResult]:
    """Render the frames of a scene's motion.

    Args:
        request: What to render.
        scene: Its scene, with the samples of `with_requested_samples`.
        manifest: The design's manifest.
        size: Width and height, pixels.
        note: A line on the samples.
        progress: Shows the steps.
    """
    begun = time.perf_counter()
    with progress.step("packing the scene"):
        mesh = None if isinstance(request.mesh, str) else request.mesh
        relit, encoder = request.relit, request.encoder
        prepared = DeviceScene.of(scene, manifest, mesh, size=size, relit=relit, encoder=encoder, progress=progress)
        if (line := coarse_line(prepared.image.header)) is not None:
            notes.tell(line)
        if (line := lost_line(prepared.image.header)) is not None:
            notes.report([line])
    prepared, note = within_budget(prepared, size, note, progress)
    with progress.step("computing the registers"):
        poses = [prepared.scene.at(fraction) for fraction in scene.frame_progress(request.frames)]
        exposure, history = scene.opening(request.frames), History.of(request.denoise or False, request.frames)
        frames = host_frames(request, prepared, size, poses, exposure, progress, history=history)
        registers = [[frame.registers(one) for one in frame.passes] for frame in frames]
        tell_defaults(note, prepared.environment)
    seconds = {"pack": time.perf_counter() - begun, "build": None}
    results, has_places = rendered(request, frames, registers, progress), bool(prepared.image.header.instances)
    # Each has a light cube, or records, of its own, and instances their places in the registers
    if (scene.paths.gather or prepared.image.moves is not None) and len(poses) > 1:
        results = itertools.chain.from_iterable(
            rendered(request, [one], [[*map(one.registers, one.passes)] if has_places else values], progress)
            for frame, pose, values in zip(frames, poses, registers, strict=True)
            for one in [replace(frame, prepared=prepared.lit_at(pose, relit))]
        )
    for pose, result in zip(poses, results, strict=True):
        report = replace(result.report, share=pose.motion_progress, seconds=seconds | dict(result.report.seconds))
        yield replace(result, report=report)


def host_frames(
    request: RenderRequest,
    prepared: DeviceScene,
    size: Size,
    poses: Sequence[Scene],
    exposure: float,
    progress: Progress,
    first: int = 0,
    history: History | None = None,
) -> list[HostFrame]:
    """The frames of poses of a scene, numbered from ``first``; the first of all notes what the object gets."""
    denoise = request.denoise or False
    look = None if request.relit else CameraLook.of(prepared.scene, prepared.photo, size)
    if look is not None and first == 0:
        look.tell(prepared.environment)
    found = []
    for number, pose in enumerate(poses, first):
        passes = prepared.passes(pose, exposure, number if history is not None else 0)
        found.append(HostFrame(prepared, size, tuple(passes), request.relit, denoise, look, number, history))
    return found


def rendered(
    request: RenderRequest, frames: Sequence[HostFrame], registers: Sequence[Registers], progress: Progress
) -> Iterator[RenderResult]:
    """Render frames that have one image, with the registers of each of their passes."""
    if request.backend == "rtl":
        assert request.config is not None
        design = design_for(request.config, request.overrides, progress)
        found = rtl_passes(design, frames, registers, progress, request.waveform, request.preview)
    else:
        found = model_passes(frames, registers, progress, request.preview)
    for frame, (passes, seconds, rate) in zip(frames, found, strict=True):
        require_no_errors(passes.frame.errors)
        maps, header = frame.prepared.maps, frame.prepared.image.header
        pixels = int(passes.frame.is_object.sum())
        if pixels == 0:
            notes.tell("a frame has no pixel of the object: it lies behind the room, or the camera looks elsewhere")
        if (line := dense_line(header, pixels)) is not None:
            notes.tell(line)
        report = replace(
            frame_report(request.backend, frame.prepared.manifest, header, passes.frame),
            seconds=seconds,
            simulated_cycles_per_second=rate,
            bytes=None if maps is None else maps.image.byte_counts(),
            samples=passes.sums.samples,
        )
        yield frame.result(passes, report)


def render_model(scene: Scene, mesh: Mesh, manifest: Manifest, size: Size, progress: Progress = QUIET) -> RenderResult:
    """Render one frame of one sample with the model.

    The scene's own mesh is not read, and error bits only appear in the report.
    """
    with progress.step("packing the scene"):
        prepared = DeviceScene.of(scene.with_samples(1), manifest, mesh, progress=progress)
        frame = HostFrame(prepared, size, tuple(prepared.passes()), look=CameraLook.of(scene, prepared.photo, size))
        registers = [frame.registers(one) for one in frame.passes]
    ((passes, _, _),) = model_passes([frame], [registers], progress)
    return frame.result(passes, frame_report("model", manifest, prepared.image.header, passes.frame))
