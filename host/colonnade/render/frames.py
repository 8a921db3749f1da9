"""Renders the frames of a scene with the requested backend."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from colonnade.common.accumulation import WHITE, Accumulation, FramePasses
from colonnade.common.errors import UserError
from colonnade.common.extras import require_extra
from colonnade.common.limits import MAX_WAVEFORM_PIXELS
from colonnade.common.progress import QUIET, Progress
from colonnade.design.frame_limits import check_size
from colonnade.design.generator import design_for, manifest_for
from colonnade.design.manifest import Manifest
from colonnade.device.device import require_no_errors
from colonnade.device.scene import DeviceScene
from colonnade.environment.model import Environment
from colonnade.environment.sequence import Sequence
from colonnade.maps.cache import encoded_environment
from colonnade.maps.encoded import Encode, layout_of
from colonnade.maps.encoders import Encoder
from colonnade.maps.image import AttributeImage
from colonnade.maps.layout import AttributeLayout
from colonnade.maps.live import STILL_ROUNDS, LiveEncoder, LiveFrame
from colonnade.mesh.mesh import Mesh
from colonnade.render.camera_look import CameraLook
from colonnade.render.composite import composited
from colonnade.render.passes import model_passes, rtl_passes
from colonnade.render.report import FrameReport, frame_report
from colonnade.render.request import RenderRequest
from colonnade.render.result import RenderResult
from colonnade.render.samples import with_requested_samples, within_budget
from colonnade.scene.model import Scene
from colonnade.scene.parser import load_scene
from colonnade.scene.view import View
from colonnade.scene_image.file import SceneImage
from colonnade.scene_image.inspect import coarse_line

Size = tuple[int, int]

#: The device's number for the colour 1.0 where light is gathered, as a factor: a ray may bring more than the mean.
_GATHER_EXPOSURE = 0.5
#: What keyframes cost.
_BETWEEN = "between keyframes, where their maps show nothing, a frame is its photo without the object's shadow"


def render(request: RenderRequest, progress: Progress = QUIET) -> RenderResult:
    """Render one frame, the first of `render_frames`."""
    (result,) = render_frames(replace(request, frames=1), progress)
    return result


def render_frames(request: RenderRequest, progress: Progress = QUIET) -> Iterator[RenderResult]:
    """Render the frames of a scene's motion. Mesh and environment are loaded once.

    Args:
        request: What to render.
        progress: Shows the steps.

    Raises:
        UserError: The input is wrong, or the hardware raised an error bit.
    """
    if request.backend == "reference":
        require_extra("reference", "the reference backend")
    scene = request.scene if isinstance(request.scene, Scene) else load_scene(request.scene)
    if request.background is not None:
        scene = scene.with_environment(request.background)
    if request.sequence is not None:
        scene = scene.with_environment(request.sequence.path.parent)
    if isinstance(request.mesh, str):
        scene = scene.with_mesh(request.mesh)
    elif request.mesh is not None:
        scene.require_one_object("a mesh replaces that of a single object")
    scene, note = with_requested_samples(scene, request)
    if scene.frame.denoise and request.backend != "reference":
        request = replace(request, denoise=True)
    if scene.paths.gather:
        scene = replace(scene, exposure=_GATHER_EXPOSURE)
    size = request.size or (scene.frame.width, scene.frame.height)
    manifest = manifest_for(request.config, request.overrides, progress).manifest
    check_size(size, manifest)
    _check_frames(request, scene, size, manifest)
    if request.sequence is not None:
        return _sequence_frames(request, request.sequence, scene, manifest, size, note, progress)
    frames = _reference_frames if request.backend == "reference" else _device_frames
    return frames(request, scene, manifest, size, note, progress)


def _check_frames(request: RenderRequest, scene: Scene, size: Size, manifest: Manifest) -> None:
    """Raise a `UserError` for what the backend cannot show."""
    if request.sequence is not None:
        _check_sequence(request, request.sequence, scene)
    elif request.frames > 1 and scene.objects and scene.motion.is_still:
        raise UserError(
            f"nothing moves in these {request.frames} frames, since several objects stand still: give motion.light, or"
            " motion.turn or motion.translate, which move all of them"
        )
    if request.waveform is not None:
        _check_waveform(request, size)
    if request.denoise:
        _check_denoise(request, scene, manifest)
    if request.truth is not None and request.backend != "reference":
        raise UserError(f"--truth is for --backend reference: the {request.backend} backend sees the room's maps only")
    if request.encoder == "live" and request.backend == "reference":
        raise UserError("--encoder is for the rtl and the model backend: the reference sees the full maps")
    if request.hits and request.backend == "rtl":
        from colonnade.device.verilator import require_hits

        require_hits(manifest)


def _check_denoise(request: RenderRequest, scene: Scene, manifest: Manifest) -> None:
    """Raise a `UserError` if there is no noise to filter, or no depth to guide the filter."""
    if scene.paths.gather == 0:
        raise UserError("denoise filters the noise of gathered light: the scene has none, set paths.gather = 1")
    if request.backend == "reference":
        raise UserError("--denoise is for the rtl and the model backend: give the reference more --samples")
    if not manifest.config["frame"]["hits"]:
        raise UserError("denoise needs the depth of pixels, which this hardware lacks: set frame.hits=true")


def _check_sequence(request: RenderRequest, sequence: Sequence, scene: Scene) -> None:
    """Raise a `UserError` for what does not go with a sequence."""
    if request.backend == "reference":
        raise UserError("--sequence is for the rtl and the model backend: render single rooms with the reference")
    if request.background is not None:
        raise UserError("--sequence and --background both replace the scene's background: give one of them")
    if request.frames > len(sequence):
        raise UserError(f"{sequence.path} has {len(sequence)} frames, fewer than the {request.frames} of --frames")
    if scene.places_camera and not scene.motion.camera:
        raise UserError("each frame of a sequence has its own camera: leave out [camera]")
    if not scene.motion.is_closed or scene.motion.shutter > 0:
        raise UserError("the camera moves in a sequence, the object and lights stay in the world: leave out [motion]")


def _reference_frames(
    request: RenderRequest, scene: Scene, manifest: Manifest, size: Size, note: str | None, progress: Progress
) -> Iterator[RenderResult]:
    from colonnade.render.reference_frames import ReferenceOptions, reference_frames

    options = ReferenceOptions(scene.motion.exposure(request.frames), request.relit, request.truth)
    poses = [scene.at(fraction) for fraction in scene.motion.frame_progress(request.frames)]
    for index, result in enumerate(reference_frames(poses, manifest, size, progress, options, _mesh_of(request))):
        if note is not None and index == 0:
            progress.note(note)
        yield result


def _device_frames(
    request: RenderRequest, scene: Scene, manifest: Manifest, size: Size, note: str | None, progress: Progress
) -> Iterator[RenderResult]:
    """The frames of the model or the RTL."""
    begun = time.perf_counter()
    with progress.step("packing the scene"):
        prepared = DeviceScene.of(
            scene,
            manifest,
            _mesh_of(request),
            size=size,
            relit=request.relit,
            encoder=request.encoder,
            progress=progress,
        )
        if (line := coarse_line(prepared.image.header)) is not None:
            progress.note(line)
    prepared = within_budget(prepared, size, progress)
    with progress.step("computing the registers"):
        motion = scene.motion
        poses = [prepared.scene.at(fraction) for fraction in motion.frame_progress(request.frames)]
        exposure = motion.exposure(request.frames)
        passes = [[*pose.passes(exposure), *prepared.coat_passes(pose, exposure)] for pose in poses]
        registers = [
            [prepared.registers(size, one, composited=not request.relit) for one in of_frame] for of_frame in passes
        ]
        if note is not None:
            progress.note(note)
    seconds = {"pack": time.perf_counter() - begun, "build": None}
    results = _rendered(request, prepared, size, passes, registers, progress)
    if scene.paths.gather and len(poses) > 1:  # Each has a light cube of its own
        results = itertools.chain.from_iterable(
            _rendered(request, prepared.lit_at(pose, request.relit), size, [own], [values], progress, number)
            for number, (pose, own, values) in enumerate(zip(poses, passes, registers, strict=True))
        )
    for pose, result in zip(poses, results, strict=True):
        report = replace(result.report, share=pose.motion_progress, seconds=seconds | dict(result.report.seconds))
        yield replace(result, report=report)


def _sequence_frames(
    request: RenderRequest,
    sequence: Sequence,
    scene: Scene,
    manifest: Manifest,
    size: Size,
    note: str | None,
    progress: Progress,
) -> Iterator[RenderResult]:
    """The frames of a sequence: each with its camera and photo, and with its own maps or those of the last keyframe."""
    every = request.keyframes or sequence.content.maps.every
    encode = _encoder_of(request, sequence, layout_of(manifest))
    relit, encoder = request.relit, request.encoder
    scenes = sequence_scenes(
        sequence, scene, manifest, size, encode, _mesh_of(request), every=every, relit=relit, encoder=encoder,
        progress=progress,
    )  # fmt: skip
    samples = scene.frame.samples
    for number in range(request.frames):
        title = f"frame {number + 1} of {request.frames}"
        begun = time.perf_counter()
        try:
            with progress.step(f"{title}: reading and encoding"):
                prepared = next(scenes)
                if samples is not None:
                    prepared = replace(prepared, scene=prepared.scene.with_samples(samples))
            prepared = within_budget(prepared, size, progress)
            samples = prepared.scene.frame.samples
            with progress.step(f"{title}: computing the registers"):
                passes = [*prepared.scene.passes(), *prepared.coat_passes()]
                registers = [prepared.registers(size, one, composited=not request.relit) for one in passes]
            for line in (note, _BETWEEN if every > 1 else None):
                if line is not None and number == 0:
                    progress.note(line)
            seconds = {"maps": time.perf_counter() - begun}
            (result,) = _rendered(request, prepared, size, [passes], [registers], progress.of(title), number)
        except UserError as error:
            raise UserError(f"frame {number} of {sequence.path}: {error}") from None
        report = replace(
            result.report, time=sequence.content.frame[number].time, seconds=seconds | dict(result.report.seconds)
        )
        yield replace(result, report=report)


def sequence_scenes(
    sequence: Sequence,
    scene: Scene,
    manifest: Manifest,
    size: Size,
    encode: Encode,
    mesh: Mesh | None = None,
    *,
    every: int = 1,
    relit: bool = False,
    encoder: Encoder = "live",
    progress: Progress = QUIET,
) -> Iterator[DeviceScene]:
    """A scene in each frame of a sequence: with its camera and photo, and the maps of the last keyframe.

    Args:
        sequence: The frames.
        scene: The scene; object and lights stay where the first frame has them.
        manifest: The design's manifest.
        size: Width and height of frames, pixels.
        encode: Encodes the maps of each keyframe, in their order.
        mesh: As in `DeviceScene.of`.
        every: Number of frames from a keyframe to the next.
        relit: As in `DeviceScene.of`.
        encoder: Of textures.
        progress: Shows the fit of lights.
    """
    prepared = DeviceScene.of(
        scene,
        manifest,
        mesh,
        size=size,
        relit=relit,
        encoder=encoder,
        room=sequence.room(0),
        encode=encode,
        progress=progress,
    )
    yield prepared
    for number in range(1, len(sequence)):
        if number % every == 0:
            prepared = prepared.seen_in(sequence.room(number), encode, relit)
        else:
            prepared = prepared.seen_by(sequence.cameras[number], sequence.photo(number))
        yield prepared


def _mesh_of(request: RenderRequest) -> Mesh | None:
    """The mesh in place of that which the scene names."""
    return None if isinstance(request.mesh, str) else request.mesh


def _encoder_of(request: RenderRequest, sequence: Sequence, layout: AttributeLayout) -> Encode:
    """The encoder of a sequence's maps. The live encoder begins as with a still."""
    if request.encoder == "offline":
        return lambda room: encoded_environment(room, layout)
    live = LiveEncoder(layout, sequence.content.depth_noise)
    rounds = iter([STILL_ROUNDS])

    def encode(room: Environment) -> AttributeImage:
        frame = LiveFrame.of(room)
        for _ in range(next(rounds, 1)):
            maps = live.encode(frame)
        return maps.image

    return encode


def _rendered(
    request: RenderRequest,
    prepared: DeviceScene,
    size: Size,
    passes: list[list[Scene]],
    registers: list[list[dict[str, int]]],
    progress: Progress,
    first: int = 0,
) -> Iterator[RenderResult]:
    """Render the passes of each frame, from the number ``first`` on, with the model or the RTL."""
    look = None if request.relit else CameraLook.of(prepared.scene, prepared.photo, size)
    if look is not None and look.note is not None and first == 0:
        progress.note(look.note)
    white = WHITE * prepared.scene.exposure
    frames = [
        (FramePasses(has_squares=request.denoise, white=white), [one.sample.is_coat for one in of_frame])
        for of_frame in passes
    ]
    if request.backend == "rtl":
        design = design_for(request.config, request.overrides, progress)
        rendered = rtl_passes(design, prepared.image, registers, frames, progress, request.waveform)
    else:
        rendered = model_passes(prepared.manifest, prepared.image, registers, frames, progress)
    for number, (of_frame, (rendered_passes, seconds, rate)) in enumerate(zip(passes, rendered, strict=True), first):
        require_no_errors(rendered_passes.frame.errors)
        report = replace(
            frame_report(request.backend, prepared.manifest, prepared.image.header, rendered_passes.frame),
            seconds=seconds,
            simulated_cycles_per_second=rate,
            bytes=None if prepared.maps is None else prepared.maps.image.byte_counts(),
            samples=rendered_passes.sums.samples,
        )
        view = prepared.view(size, of_frame[0])
        result = _result(rendered_passes, prepared.image, view, report)
        if request.denoise:
            result = _denoised(result, rendered_passes, view)
        elif rendered_passes.coats is not None:
            result = _with_sums(result, result.sums.coated(rendered_passes.coats.sums))
        yield result if request.relit else _composited(result, prepared, look, number)


def _check_waveform(request: RenderRequest, size: Size) -> None:
    """Raise a `UserError` if the request cannot write a waveform: wrong backend, several frames, or a large frame."""
    if request.backend != "rtl":
        raise UserError(f"the {request.backend} backend has no signals: use --backend rtl for --waveform")
    if request.frames != 1:
        raise UserError("a waveform shows one frame: leave out --frames or --waveform")
    if size[0] * size[1] > MAX_WAVEFORM_PIXELS:
        raise UserError(
            f"a waveform of {size[0]}x{size[1]} pixels would fill the disk: "
            f"use a --size of at most {MAX_WAVEFORM_PIXELS:,} pixels, e.g. 8x8"
        )


def render_model(scene: Scene, mesh: Mesh, manifest: Manifest, size: Size, progress: Progress = QUIET) -> RenderResult:
    """Render one frame of one sample with the model.

    The scene's own mesh is not read, and error bits only appear in the report.
    """
    with progress.step("packing the scene"):
        prepared = DeviceScene.of(scene, manifest, mesh, progress=progress)
        registers = prepared.registers(size, composited=True)
    ((passes, _, _),) = model_passes(manifest, prepared.image, [[registers]], [(FramePasses(), [False])], progress)
    report = frame_report("model", manifest, prepared.image.header, passes.frame)
    return _composited(_result(passes, prepared.image, prepared.view(size), report), prepared)


def _composited(
    result: RenderResult, prepared: DeviceScene, look: CameraLook | None = None, number: int = 0
) -> RenderResult:
    """The result in the photo of its room, with the look of its camera; as it is without a room."""
    if prepared.environment is None:
        return result
    return replace(result, image=composited(result.sums, prepared.photo, prepared.strength, look, number))


def _denoised(result: RenderResult, passes: FramePasses, view: View) -> RenderResult:
    """The result with filtered colours of the object; `view` is that of the first pass."""
    from colonnade.render.denoise import Guide, denoised

    x, y = np.arange(view.width)[None, :, None], np.arange(view.height)[:, None, None]
    position = view.origin + result.t[..., None] * (view.direction + x * view.step_x + y * view.step_y)

    def filtered(layer: FramePasses) -> Accumulation:
        sums, count = layer.sums, layer.sums.coverage[..., None]
        colours = sums.objects / np.maximum(count, 1) / sums.white
        found = denoised(colours, layer.object_variance(), Guide.of(position, result.object_mask & (count[..., 0] > 0)))
        return replace(sums, objects=found * sums.white * count)

    sums = filtered(passes)
    return _with_sums(result, sums if passes.coats is None else sums.coated(filtered(passes.coats)))


def _with_sums(result: RenderResult, sums: Accumulation) -> RenderResult:
    return replace(result, sums=sums, image=sums.image())


def _result(passes: FramePasses, image: SceneImage, view: View, report: FrameReport) -> RenderResult:
    """The result of a frame; `view` is that of its first pass."""
    frame, sums = passes.frame, passes.sums
    source = np.append(image.source_faces.astype(np.int64), -1)
    x, y = np.arange(view.width)[None, :, None], np.arange(view.height)[:, None, None]
    longest = np.abs(view.direction + x * view.step_x + y * view.step_y).max(axis=2)
    depth = frame.distance / (image.header.frame.scale * longest)
    return RenderResult(
        image=sums.image(),
        object_mask=frame.is_object,
        hit_triangles=source[np.where(frame.is_object, frame.triangle, -1)],
        t=np.where(frame.is_object, depth, np.nan),
        report=report,
        sums=sums,
        ratio=frame.ratio,
        parts=image.header.parts,
    )
