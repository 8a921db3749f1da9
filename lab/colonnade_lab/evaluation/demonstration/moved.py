"""The frames of a scene whose objects move, by the model, and what each takes: refit, registers, rays, RTL cycles."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace

import numpy as np
from colonnade.common.progress import QUIET, Progress
from colonnade.design.generator import GeneratedDesign
from colonnade.device.bit_exact import loaded_model, model_frame
from colonnade.device.device import require_no_errors
from colonnade.device.scene import DeviceScene
from colonnade.device.verilator import render_rtl
from colonnade.render.history import History
from colonnade.render.host_frame import HostFrame
from colonnade.render.passes import model_passes
from colonnade.scene.model import Scene
from colonnade.scene.passes import exposed
from numpy.typing import NDArray

from colonnade_lab.evaluation.demonstration.measure import differing_pixels


@dataclass(frozen=True)
class MovedCost:
    """What a frame takes; rays, steps and cycles are of its first pass.

    Attributes:
        samples: Passes of the frame.
        refit_ms: Time of pose, vertices and records, by the driver's code on a core of the host.
        rays_in_box: Rays that enter the box of all objects.
        node_reads: Of all rays.
        march_steps: Of all rays.
        cycles: Of the RTL; None without it.
        differing: Pixels in which the RTL is not the model.
    """

    samples: int
    refit_ms: float
    rays_in_box: int
    node_reads: int
    march_steps: int
    cycles: int | None = None
    differing: int = 0


def run(
    scene: Scene,
    design: GeneratedDesign,
    size: tuple[int, int],
    frames: int,
    take: Callable[[NDArray[np.uint8]], None],
    rtl_frames: Collection[int] = (),
    progress: Progress = QUIET,
) -> tuple[int, list[MovedCost]]:
    """Render frames of a scene's motion; answers its triangles, and what each frame takes.

    Args:
        scene: The scene; it names its samples.
        design: The hardware.
        size: Of the frames, pixels.
        frames: Their number.
        take: Gets the frames, sRGB, uint8 [height, width, 3].
        rtl_frames: Numbers of frames whose first pass the RTL renders too.
        progress: Shows the frames.
    """
    with progress.step("packing the scene"):
        prepared = DeviceScene.of(exposed(scene), design.manifest, size=size)
    history, costs = History(), []
    with progress.step(f"rendering {frames} frames of {prepared.image.header.mesh}") as report:
        for number, (posed, seconds) in enumerate(_posed(prepared, frames)):
            passes = tuple(posed.passes(posed.scene, scene.opening(frames), number))
            frame = HostFrame(posed, size, passes, denoise="atrous", number=number, history=history)
            registers = [frame.registers(one) for one in passes]
            ((found, _, _),) = model_passes([frame], [registers])
            require_no_errors(found.frame.errors)
            take(frame.pixels(found))
            costs.append(_cost(posed, design, registers, 1e3 * seconds, number in rtl_frames))
            report((number + 1) / frames)
    return prepared.image.header.triangles, costs


def _posed(prepared: DeviceScene, frames: int) -> Iterator[tuple[DeviceScene, float]]:
    """The scene at each frame, and the seconds that its records took."""
    for share in prepared.scene.frame_progress(frames):
        pose, begun = prepared.scene.at(share), time.perf_counter()
        prepared.image.posed(share)
        seconds = time.perf_counter() - begun
        yield replace(prepared.lit_at(pose), scene=pose), seconds


def _cost(
    posed: DeviceScene, design: GeneratedDesign, registers: list[dict[str, int]], refit_ms: float, has_rtl: bool
) -> MovedCost:
    frame = model_frame(loaded_model(posed.manifest, posed.image), registers[0])
    cycles, differing = None, 0
    if has_rtl:
        rtl = render_rtl(design, posed.image, [registers[0]]).frames[0]
        require_no_errors(rtl.errors)
        cycles, differing = rtl.counters["cycles"], differing_pixels(rtl, frame)
    counters = frame.counters
    return MovedCost(
        len(registers),
        refit_ms,
        counters["raysInBox"],
        counters["nodeReads"],
        counters["marchSteps"],
        cycles,
        differing,
    )
