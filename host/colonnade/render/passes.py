"""The passes of frames, by the RTL or by the model."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

from colonnade.common.accumulation import FramePasses
from colonnade.common.framebuffer import Frame
from colonnade.common.progress import Progress
from colonnade.design.generator import GeneratedDesign
from colonnade.design.manifest import Manifest
from colonnade.scene_image.file import SceneImage

#: Where the passes of a frame are added, and which of them are of coats.
Passes = tuple[FramePasses, list[bool]]
#: The passes of a frame, its seconds by step, and the RTL's simulated cycles per second.
Rendered = tuple[FramePasses, dict[str, float], float | None]


def rtl_passes(
    design: GeneratedDesign,
    image: SceneImage,
    registers: list[list[dict[str, int]]],
    frames: list[Passes],
    progress: Progress,
    waveform: Path | None = None,
) -> Iterator[Rendered]:
    """Render all passes of all frames in one run of the simulator. Each frame reports an equal part of the run time."""
    from colonnade.device.simulator_build import build_simulator
    from colonnade.device.verilator import simulate

    begun = time.perf_counter()
    build_simulator(design, progress, waveform=waveform is not None)
    built = time.perf_counter()
    places = iter([(frame, is_coat) for frame, are_coats in frames for is_coat in are_coats])

    def add(frame: Frame) -> None:
        passes, is_coat = next(places)
        passes.add(frame, is_coat)

    every = [one for of_frame in registers for one in of_frame]
    rate = simulate(design, image, list(every), add, progress=progress, waveform=waveform)
    run = (time.perf_counter() - built) / len(registers)
    for frame, _ in frames:
        yield frame, {"build": built - begun, "run": run}, rate


def model_passes(
    manifest: Manifest,
    image: SceneImage,
    registers: list[list[dict[str, int]]],
    frames: list[Passes],
    progress: Progress,
) -> Iterator[Rendered]:
    """Render pass by pass with a model that is loaded once."""
    from colonnade.device.bit_exact import loaded_model, model_frame

    model = loaded_model(manifest, image)

    def one(of_frame: list[dict[str, int]], into: Passes) -> Rendered:
        begun = time.perf_counter()
        passes, are_coats = into
        with progress.step("rendering in the model") as report:
            for index, values in enumerate(of_frame):

                def share(done: int, total: int, before: int = index) -> None:
                    report((before + done / total) / len(of_frame))

                passes.add(model_frame(model, values, share), are_coats[index])
        return passes, {"run": time.perf_counter() - begun}, None

    yield from map(one, registers, frames)
