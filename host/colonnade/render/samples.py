"""The samples of a frame: the named number, a default, or what a budget of time allows (docs/sampling.md)."""

from __future__ import annotations

from colonnade.common import notes
from colonnade.common.errors import UserError
from colonnade.common.progress import Progress
from colonnade.environment.model import Environment
from colonnade.render.budget import MAX_BUDGET_SAMPLES, Budget
from colonnade.render.request import RenderRequest
from colonnade.scene.model import Scene
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene.samples import PHOTO_SAMPLES

#: Name the defaults to who has not chosen.
_PHOTO = f"{PHOTO_SAMPLES} samples a pixel, the default in a room: --samples 1 takes a quarter of the time"
_REFERENCE = f"{MAX_BUDGET_SAMPLES} samples a pixel, the most of a budget, as the reference has no clock (--samples)"
#: Seconds of a frame unless the scene names them: thirty frames a second.
_SECONDS = 1 / 30


def with_requested_samples(scene: Scene, request: RenderRequest) -> tuple[Scene, str | None]:
    """The scene with the samples of the request, its own ones, or a default, and a line that names the default.

    With gathered light the default is what a budget allows; its ``frame.samples`` stays None until `within_budget`. In
    a room it is `PHOTO_SAMPLES`, otherwise 1. Frames with hits, a waveform, or a relit room have one sample.

    Raises:
        UserError: The request needs the rays of a single pass, or one sample hides what the scene asks for.
    """
    named = request.samples or scene.frame.samples
    single = request.relit or request.hits or request.waveform is not None
    if scene.frame.budget is not None and scene.paths.gather == 0:
        raise UserError("frame.budget is of frames that gather light, this one does not: give frame.samples")
    if named is None and not single and scene.paths.gather:
        if request.backend == "reference":
            return scene.with_samples(MAX_BUDGET_SAMPLES), _REFERENCE
        return scene, None
    if named is None and not single and scene.background.room is not None:
        return scene.with_samples(PHOTO_SAMPLES), _PHOTO
    if request.samples is None and scene.blurs and (named or 1) == 1:
        raise UserError(
            f"{scene.blurs[0]} shows only with several samples: give frame.samples or --samples;"
            " --samples 1 renders the middle"
        )
    for what, is_used in (("hits are", request.hits), ("a waveform is", request.waveform is not None)):
        if is_used and (named or 1) > 1:
            raise UserError(f"{what} of one sample a pixel, this frame has {named}: give --samples 1")
    return scene.with_samples(named or 1), None


def within_budget(
    prepared: DeviceScene, size: tuple[int, int], note: str | None, progress: Progress
) -> tuple[DeviceScene, str | None]:
    """The scene with as many samples as its budget allows, itself if it has a number; and the line that names defaults.

    Args:
        prepared: A scene from `with_requested_samples`, ready for the device.
        size: Width and height of frames, pixels.
        note: The beginning of the line.
        progress: Shows the pass that is measured.
    """
    scene = prepared.scene
    if scene.frame.samples is not None:
        return prepared, note
    with progress.step("estimating the time of a pass"):
        registers = prepared.registers(size, composited=True)

        def passes(samples: int) -> int:
            return len(prepared.passes(scene.with_samples(samples)))

        seconds = scene.frame.budget or _SECONDS
        budget = Budget.of(prepared.manifest, prepared.image, registers, seconds, passes)
    hidden = f"; {scene.blurs[0]} shows its middle" if scene.blurs else ""
    hidden += "; coats and highlights do not show" if passes(2) > 2 else ""
    missing = len(scene.lights) - scene.pass_lights if scene.pass_lights else 0
    hidden += f"; {missing} of {len(scene.lights)} lights do not show" if missing > 0 else ""
    note = joined(note, budget.note + (hidden if budget.samples == 1 else ""))
    return prepared.with_scene(scene.with_samples(budget.samples)), note


def tell_defaults(line: str | None, room: Environment | None) -> None:
    """Note the line that names defaults, with the other notes on a room, and show these."""
    if line is not None and room is not None:
        room.tell("defaults", line)
    elif line is not None:
        notes.tell(line)
    notes.flush()


def joined(*lines: str | None) -> str | None:
    """The lines that are not None, as one."""
    return "; ".join(line for line in lines if line is not None) or None
