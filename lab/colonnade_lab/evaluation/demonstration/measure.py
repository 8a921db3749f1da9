"""The frames of the demonstration by the model, and what each takes: encoder, registers, loads, rays, RTL cycles."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
from colonnade.common.framebuffer import Frame
from colonnade.common.progress import QUIET, Progress
from colonnade.design.generator import GeneratedDesign
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import loaded_model, model_frame
from colonnade.device.device import require_no_errors
from colonnade.device.verilator import render_rtl
from colonnade.environment.model import Environment
from colonnade.environment.sequence import Sequence
from colonnade.maps.encoded import layout_of
from colonnade.maps.image import AttributeImage
from colonnade.maps.live import LiveEncoder, LiveFrame
from colonnade.registers.target_view import TargetView
from colonnade.render.camera_look import CameraLook
from colonnade.render.host_frame import HostFrame
from colonnade.render.passes import model_passes
from colonnade.render.sequence_frames import sequence_scenes
from colonnade.scene.model import Scene
from colonnade.scene.passes import exposed
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene_image.device_image import load_cycles
from numpy.typing import NDArray

#: Registers are computed so often, and the least time counts.
_REPETITIONS = 20


@dataclass(frozen=True)
class FrameCost:
    """What a frame takes with one sample a pixel.

    Attributes:
        encode_ms: CPU time of the live encoder; 0 between keyframes.
        registers_ms: Time of `colonnade_view`; None between keyframes, whose registers the host computes.
        load_cycles: Of its maps; 0 between keyframes.
        rays_in_box: Rays that enter the object's box.
        march_steps: Of all rays.
        cycles: Of the RTL; None without it.
        differing: Pixels in which the RTL is not the model.
    """

    encode_ms: float
    registers_ms: float | None
    load_cycles: int
    rays_in_box: int
    march_steps: int
    cycles: int | None = None
    differing: int = 0


@dataclass(frozen=True)
class Demonstration:
    """What to render.

    Attributes:
        sequence: The camera's frames.
        scene: The object.
        design: Hardware for maps of the sequence's size.
        samples: Samples of a pixel in the pictures.
        rtl_frames: Frames that the RTL renders too, with one sample a pixel.
    """

    sequence: Sequence
    scene: Scene
    design: GeneratedDesign
    samples: int
    rtl_frames: Collection[int]


class TimedEncoder:
    """The live encoder for a design's maps of a sequence; `milliseconds` is the CPU time of the last frame."""

    def __init__(self, design: GeneratedDesign, sequence: Sequence) -> None:
        self._live = LiveEncoder(layout_of(design.manifest), sequence.content.depth_noise)
        self.milliseconds = 0.0

    def __call__(self, room: Environment) -> AttributeImage:
        """Encode the maps of a room."""
        frame = LiveFrame.of(room)
        begun = time.thread_time()
        image = self._live.encode(frame).image
        self.milliseconds = 1e3 * (time.thread_time() - begun)
        return image


def run(
    demonstration: Demonstration,
    every: int,
    take: Callable[[NDArray[np.uint8]], None],
    progress: Progress = QUIET,
) -> list[FrameCost]:
    """Render all frames, with maps of every so many frames.

    Args:
        demonstration: What to render.
        every: Number of frames from a keyframe to the next.
        take: Gets the frames, sRGB, uint8 [height, width, 3].
        progress: Shows the frames.
    """
    sequence, manifest = demonstration.sequence, demonstration.design.manifest
    size, encoder, costs = (
        (sequence.content.width, sequence.content.height),
        TimedEncoder(demonstration.design, sequence),
        [],
    )
    scene = exposed(demonstration.scene).with_samples(demonstration.samples)
    scenes = sequence_scenes(sequence, scene, manifest, size, encoder, every=every)
    with progress.step(f"rendering {len(sequence)} frames with maps of every {every}") as report:
        for number, prepared in enumerate(scenes):
            take(_picture(prepared, size, number))
            is_key = number % every == 0
            costs.append(_cost(prepared, size, encoder.milliseconds if is_key else None, demonstration, number))
            report((number + 1) / len(sequence))
    return costs


def _picture(prepared: DeviceScene, size: tuple[int, int], number: int) -> NDArray[np.uint8]:
    """A picture as `colonnade render --sequence` shows it."""
    look = CameraLook.of(prepared.scene, prepared.photo, size)
    frame = HostFrame(prepared, size, tuple(prepared.passes()), look=look, number=number)
    ((passes, _, _),) = model_passes([frame], [[frame.registers(one) for one in frame.passes]])
    require_no_errors(passes.frame.errors)
    return frame.pixels(passes)


def _cost(
    prepared: DeviceScene, size: tuple[int, int], encode_ms: float | None, demonstration: Demonstration, number: int
) -> FrameCost:
    manifest = prepared.manifest
    registers = prepared.registers(size, composited=True)
    frame = model_frame(loaded_model(manifest, prepared.image), registers)
    cycles, differing = None, 0
    if number in demonstration.rtl_frames:
        rtl = render_rtl(demonstration.design, prepared.image, [registers]).frames[0]
        require_no_errors(rtl.errors)
        cycles = rtl.counters["cycles"]
        differing = differing_pixels(rtl, frame)
    is_key = encode_ms is not None
    assert prepared.maps is not None
    return FrameCost(
        encode_ms or 0.0,
        _registers_ms(prepared.view_file(size, composited=True), manifest) if is_key else None,
        load_cycles(prepared.maps.image, manifest) if is_key else 0,
        frame.counters["raysInBox"],
        frame.counters["marchSteps"],
        cycles,
        differing,
    )


def differing_pixels(one: Frame, other: Frame) -> int:
    """Pixels that differ in colour, object or shadow."""
    assert one.ratio is not None and other.ratio is not None
    differs = (one.colour != other.colour).any(axis=2) | (one.is_object != other.is_object)
    return int((differs | (one.ratio != other.ratio).any(axis=2)).sum())


def _registers_ms(file: bytes, manifest: Manifest) -> float:
    """Time of reading a view file and computing its registers."""
    times = []
    for _ in range(_REPETITIONS):
        begun = time.perf_counter()
        TargetView(file, manifest).writes()
        times.append(1e3 * (time.perf_counter() - begun))
    return min(times)
