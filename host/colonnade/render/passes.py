"""The passes of frames, by the RTL or by the model."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from colonnade.common.accumulation import FramePasses
from colonnade.common.framebuffer import Frame
from colonnade.common.progress import QUIET, Progress
from colonnade.common.types import Floats
from colonnade.design.generator import GeneratedDesign
from colonnade.render.host_frame import HostFrame

#: The registers of each pass of a frame.
Registers = list[dict[str, int]]
#: Takes a picture, linear, float64 [height, width, 3].
Preview = Callable[[Floats], None]
#: The passes of a frame, its seconds by step, and the RTL's simulated cycles per second.
Rendered = tuple[FramePasses, dict[str, float], float | None]


def rtl_passes(
    design: GeneratedDesign,
    frames: Sequence[HostFrame],
    registers: Sequence[Registers],
    progress: Progress = QUIET,
    waveform: Path | None = None,
    preview: Preview | None = None,
) -> Iterator[Rendered]:
    """Render all passes of frames in one run of the simulator. Each frame reports an equal part of the run time.

    Args:
        design: The design.
        frames: With the image of the first one.
        registers: Of each frame.
        progress: Shows the run.
        waveform: VCD file of the signals.
        preview: Takes the picture of the first sample of the first frame.
    """
    from colonnade.device.simulator_build import build_simulator
    from colonnade.device.verilator import simulate

    begun = time.perf_counter()
    build_simulator(design, progress, waveform=waveform is not None)
    built = time.perf_counter()
    into = [frame.no_passes() for frame in frames]
    places = iter([(sums, one) for sums, frame in zip(into, frames, strict=True) for one in frame.passes])

    def add(frame: Frame) -> None:
        sums, one = next(places)
        sums.add(frame, one.sample.layer)

    every: list[Mapping[str, int]] = [one for of_frame in registers for one in of_frame]
    early = None if preview is None else lambda frame: preview(_picture(frames[0], frame))
    image = frames[0].prepared.image
    rate = simulate(design, image, every, add, progress=progress, waveform=waveform, early=early)
    run = (time.perf_counter() - built) / len(registers)
    for sums in into:
        yield sums, {"build": built - begun, "run": run}, rate


def model_passes(
    frames: Sequence[HostFrame],
    registers: Sequence[Registers],
    progress: Progress = QUIET,
    preview: Preview | None = None,
) -> Iterator[Rendered]:
    """Render pass by pass with a model that is loaded once. Arguments are as in `rtl_passes`."""
    from colonnade.device.bit_exact import loaded_model, model_frame

    first = frames[0].prepared
    model = loaded_model(first.manifest, first.image)
    for frame, of_frame in zip(frames, registers, strict=True):
        begun, sums = time.perf_counter(), frame.no_passes()
        with progress.step("rendering in the model") as report:
            for index, (one, values) in enumerate(zip(frame.passes, of_frame, strict=True)):

                def share(done: int, total: int, before: int = index, passes: int = len(of_frame)) -> None:
                    report((before + done / total) / passes)

                frame_of_pass = model_frame(model, values, share)
                sums.add(frame_of_pass, one.sample.layer)
                if preview is not None and index == 0 and frame is frames[0] and len(of_frame) > 1:
                    preview(_picture(frame, frame_of_pass))
        yield sums, {"run": time.perf_counter() - begun}, None


def _picture(frame: HostFrame, first: Frame) -> Floats:
    """The picture of the first pass of a frame, not filtered."""
    passes = replace(frame, denoise=False).no_passes()
    passes.add(first)
    return frame.image(passes.whole)
