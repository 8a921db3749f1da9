"""The passes of frames, by the RTL or by the model."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from colonnade.common.accumulation import FramePasses
from colonnade.common.framebuffer import Frame
from colonnade.common.progress import QUIET, Progress
from colonnade.design.generator import GeneratedDesign
from colonnade.render.host_frame import HostFrame

#: The registers of each pass of a frame.
Registers = list[dict[str, int]]
#: The passes of a frame, its seconds by step, and the RTL's simulated cycles per second.
Rendered = tuple[FramePasses, dict[str, float], float | None]


def rtl_passes(
    design: GeneratedDesign,
    frames: Sequence[HostFrame],
    registers: Sequence[Registers],
    progress: Progress = QUIET,
    waveform: Path | None = None,
) -> Iterator[Rendered]:
    """Render all passes of frames in one run of the simulator. Each frame reports an equal part of the run time.

    Args:
        design: The design.
        frames: With the image of the first one.
        registers: Of each frame.
        progress: Shows the run.
        waveform: VCD file of the signals.
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
    rate = simulate(design, frames[0].prepared.image, every, add, progress=progress, waveform=waveform)
    run = (time.perf_counter() - built) / len(registers)
    for sums in into:
        yield sums, {"build": built - begun, "run": run}, rate


def model_passes(
    frames: Sequence[HostFrame], registers: Sequence[Registers], progress: Progress = QUIET
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

                sums.add(model_frame(model, values, share), one.sample.layer)
        yield sums, {"run": time.perf_counter() - begun}, None
