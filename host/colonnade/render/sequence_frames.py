"""The frames of a camera that moves through a room, by the model or the RTL."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

from colonnade.common import notes
from colonnade.common.errors import UserError
from colonnade.common.frame_size import Size
from colonnade.common.progress import QUIET, Progress
from colonnade.design.manifest import Manifest
from colonnade.environment.model import Environment
from colonnade.environment.sequence import Sequence
from colonnade.maps.cache import encoded_environment
from colonnade.maps.encoded import Encode, layout_of
from colonnade.maps.encoders import Encoder
from colonnade.maps.image import AttributeImage
from colonnade.maps.layout import AttributeLayout
from colonnade.maps.live import STILL_ROUNDS, LiveEncoder, LiveFrame
from colonnade.mesh.materials.mesh import Mesh
from colonnade.render.device_frames import host_frames, rendered
from colonnade.render.history import History
from colonnade.render.request import RenderRequest
from colonnade.render.result import RenderResult
from colonnade.render.samples import tell_defaults, within_budget
from colonnade.scene.model import Scene
from colonnade.scene.prepared.device_scene import DeviceScene

#: What keyframes cost.
_BETWEEN = (
    "between keyframes, where their maps show nothing, a frame is its photo without the object's shadow: --keyframes 1"
    " gives each frame its own maps"
)


def check_sequence(request: RenderRequest, sequence: Sequence, scene: Scene) -> None:
    """Raise a `UserError` for what does not go with a sequence."""
    if request.backend == "reference":
        raise UserError("--sequence is for the rtl and the model backend: render single rooms with the reference")
    if request.background is not None:
        raise UserError("--sequence and --background both replace the scene's background: give one of them")
    if request.frames > len(sequence):
        raise UserError(f"{sequence.path} has {len(sequence)} frames, fewer than the {request.frames} of --frames")
    if scene.places_camera:
        key = "[[motion.camera]]" if scene.motion.camera else "[camera]"
        raise UserError(f"each frame of a sequence has its own camera: leave out {key}")


def sequence_frames(
    request: RenderRequest,
    sequence: Sequence,
    scene: Scene,
    manifest: Manifest,
    size: Size,
    note: str | None,
    progress: Progress,
) -> Iterator[RenderResult]:
    """The frames of a sequence: each with its camera and photo, and with its own maps or the last keyframe's.

    Object and light move as in other frames of a motion, but the object does not turn unless the scene says so.
    """
    every = request.keyframes or sequence.content.maps.every
    encode = _encoder_of(request, sequence, layout_of(manifest))
    relit, encoder = request.relit, request.encoder
    mesh = None if isinstance(request.mesh, str) else request.mesh
    scene = replace(scene, motion=replace(scene.motion, turn=scene.motion.turn or 0.0))
    scenes = sequence_scenes(
        sequence, scene, manifest, size, encode, mesh, every=every, relit=relit, encoder=encoder,
        progress=progress,
    )  # fmt: skip
    samples = scene.frame.samples
    history = History.of(request.denoise or False, request.frames)
    for number, share in enumerate(scene.frame_progress(request.frames)):
        title = f"frame {number + 1} of {request.frames}"
        begun = time.perf_counter()
        try:
            with progress.step(f"{title}: reading and encoding"):
                prepared = next(scenes)
                if samples is not None:
                    prepared = prepared.with_scene(prepared.scene.with_samples(samples))
            prepared, note = within_budget(prepared, size, note, progress)
            samples = prepared.scene.frame.samples
            with progress.step(f"{title}: computing the registers"):
                pose = prepared.scene.at(share)
                lit = prepared if scene.is_still else prepared.lit_at(pose, relit)
                frames = host_frames(
                    request, lit, size, [pose], scene.opening(request.frames), progress, number, history
                )
                registers = [frames[0].registers(one) for one in frames[0].passes]
            if number == 0:
                tell_defaults(note, prepared.environment)
            if every > 1:
                notes.tell(_BETWEEN)
            seconds = {"maps": time.perf_counter() - begun}
            (result,) = rendered(request, frames, [registers], progress.of(title))
        except UserError as error:
            raise UserError(f"frame {number} of {sequence.path}: {error}") from None
        time_of = sequence.content.frame[number].time
        report = replace(
            result.report,
            time=time_of,
            share=None if scene.is_still else share,
            seconds=seconds | dict(result.report.seconds),
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
    encoder: Encoder | None = None,
    progress: Progress = QUIET,
) -> Iterator[DeviceScene]:
    """A scene in each frame of a sequence: with its camera and photo, and the maps of the last keyframe.

    Args:
        sequence: The frames.
        scene: The scene; object and lights stay where the first frame has them, or move from there.
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


def _encoder_of(request: RenderRequest, sequence: Sequence, layout: AttributeLayout) -> Encode:
    """The encoder of a sequence's maps. The live encoder begins as with a still."""
    if request.encoder == "offline" or (request.encoder is None and not LiveEncoder.writes(layout)):
        return lambda room: encoded_environment(room, layout)
    live = LiveEncoder(layout, sequence.content.depth_noise)
    rounds = iter([STILL_ROUNDS])

    def encode(room: Environment) -> AttributeImage:
        frame = LiveFrame.of(room)
        for _ in range(next(rounds, 1)):
            maps = live.encode(frame)
        return maps.image

    return encode
