"""Renders the frames of a scene with the requested backend."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from colonnade.common import notes
from colonnade.common.arguments import checked
from colonnade.common.errors import UserError
from colonnade.common.extras import require_extra
from colonnade.common.frame_size import Size
from colonnade.common.limits import MAX_WAVEFORM_PIXELS
from colonnade.common.progress import QUIET, Progress
from colonnade.design.frame_limits import check_size
from colonnade.design.generator import manifest_for
from colonnade.design.manifest import Manifest
from colonnade.render.device_frames import device_frames
from colonnade.render.host_frame import require_filter
from colonnade.render.request import RenderRequest
from colonnade.render.result import RenderResult
from colonnade.render.room_defaults import with_room_defaults
from colonnade.render.samples import joined, with_requested_samples
from colonnade.render.sequence_frames import check_sequence, sequence_frames
from colonnade.scene.model import Scene
from colonnade.scene.parser import load_scene
from colonnade.scene.passes import exposed


def render(request: RenderRequest, progress: Progress = QUIET) -> RenderResult:
    """Render one frame, the first of `render_frames`."""
    (result,) = render_frames(replace(request, frames=1), progress)
    return result


@checked
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
    room = request.background if request.sequence is None else request.sequence.path.parent
    if not isinstance(request.scene, Scene):
        scene = load_scene(request.scene, room, request.animation)
    else:
        scene = request.scene if room is None else request.scene.with_environment(room)
    if isinstance(request.mesh, str):
        scene = scene.with_mesh(request.mesh)
    elif request.mesh is not None:
        scene.require_one_object("a mesh replaces that of a single object")
    if request.simplify is not None:
        scene = scene.with_simplified_mesh(request.simplify)
    denoise = scene.frame.denoise if request.denoise is None else request.denoise
    if request.backend == "reference" and not request.denoise:
        if denoise:
            notes.tell("frame.denoise is of the model and the RTL: frames of the reference are not filtered")
        denoise = False
    is_single = request.relit or request.hits or request.waveform is not None
    scene = replace(scene, frame=replace(scene.frame, denoise=denoise), names_gather=scene.names_gather or is_single)
    in_sequence = request.sequence is not None
    manifest = manifest_for(request.config, request.overrides, progress).manifest
    scene, defaults = with_room_defaults(scene, request.config, manifest, in_sequence)
    scene, note = with_requested_samples(scene, request)
    scene = exposed(scene)
    request = replace(request, denoise=scene.frame.denoise or False)
    size = (scene.frame.width, scene.frame.height) if request.size is None else request.size
    check_size(size, manifest)
    _check_frames(request, scene, size, manifest)
    note = joined(defaults, note)
    if request.sequence is not None:
        return sequence_frames(request, request.sequence, scene, manifest, size, note, progress)
    frames = _reference_frames if request.backend == "reference" else device_frames
    return frames(request, scene, manifest, size, note, progress)


def _check_frames(request: RenderRequest, scene: Scene, size: Size, manifest: Manifest) -> None:
    """Raise a `UserError` for what the backend cannot show."""
    if request.sequence is not None:
        check_sequence(request, request.sequence, scene)
    elif request.backend == "reference" and scene.is_animated:
        raise UserError(
            "mesh.animation and object.motion are for the rtl and the model backend: leave them out for the reference"
        )
    elif request.frames > 1 and scene.objects and scene.is_still:
        raise UserError(
            f"nothing moves in these {request.frames} frames, since several objects stand still: give object.motion to"
            " one, motion.light, or motion.turn or motion.translate, which move all of them"
        )
    if request.waveform is not None:
        _check_waveform(request, size)
    if request.denoise:
        if request.backend == "reference":
            raise UserError("--denoise is for the rtl and the model backend: give the reference more --samples")
        require_filter(scene, manifest, request.denoise)
    if request.truth is not None and request.backend != "reference":
        raise UserError(f"--truth is for --backend reference: the {request.backend} backend sees the room's maps only")
    if request.encoder is not None and request.backend == "reference":
        raise UserError("--encoder is for the rtl and the model backend: the reference sees the full maps")
    if request.hits and request.backend == "rtl":
        from colonnade.device.verilator import require_hits

        require_hits(manifest)


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


def _reference_frames(
    request: RenderRequest, scene: Scene, manifest: Manifest, size: Size, note: str | None, progress: Progress
) -> Iterator[RenderResult]:
    from colonnade.render.reference_frames import ReferenceOptions, reference_frames

    options = ReferenceOptions(scene.opening(request.frames), request.relit, request.truth, note)
    poses = [scene.at(fraction) for fraction in scene.frame_progress(request.frames)]
    mesh = None if isinstance(request.mesh, str) else request.mesh
    yield from reference_frames(poses, manifest, size, progress, options, mesh)
