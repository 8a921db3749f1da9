"""Frames of the AXI4 shell in the simulator, at any timing of its memory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from colonnade.common.framebuffer_formats import PIXEL_BYTES
from colonnade.common.progress import QUIET, Progress
from colonnade.design.generator import GeneratedDesign
from colonnade.device.shell_device import ShellDevice
from colonnade.device.shell_simulator import Bus, SimulatedTransport
from colonnade.integration.register_table import read_shell
from colonnade.scene_image.dram_image import PAGE_BYTES
from colonnade.scene_image.file import SceneImage

_MAX_CYCLES = 50_000_000


@dataclass(frozen=True)
class ShellFrame:
    """A frame in the memory.

    Attributes:
        lines: uint8 [height, stride]; bytes that the shell has not written are 0xA5.
        cycles: Cycles from the start to the interrupt.
        errors: `framebuffer.errors`.
        values: Read-only registers of the device, by name.
    """

    lines: npt.NDArray[np.uint8]
    cycles: int
    errors: int
    values: Mapping[str, int]


def render_shell(
    design: GeneratedDesign,
    image: SceneImage,
    registers: Sequence[Mapping[str, int]],
    formats: Sequence[int],
    bus: Bus | None = None,
    progress: Progress = QUIET,
    photo: npt.NDArray[np.uint8] | None = None,
    scene_errors: Sequence[int] = (),
) -> list[ShellFrame]:
    """Render a frame for each set of registers, in the format of the same index, each in memory of its own.

    Args:
        design: A design with its shell (`generator.shell_design_for`).
        image: The scene image; it is loaded once.
        registers: All rw registers of the device, a set for each frame.
        formats: Codes of `FORMATS`.
        bus: The memory's timing.
        progress: Shows the steps.
        photo: Composited into the frames, which then have one size; as in `Device.set_frame`.
        scene_errors: With a cache: for each frame, how many of 1024 beats of the scene's reads fail; none if empty.

    Raises:
        RuntimeError: The shell breaks a rule of AXI, refuses an access, leaves its windows, or hangs.
    """
    shell = read_shell(design.dir)
    errors = next(int(one["address"]) for one in shell["registers"] if one["name"] == "framebuffer.errors")
    readable = [name for name, register in design.manifest.registers.items() if register.access == "ro"]
    tile = int(design.manifest.config["frame"]["tileSize"])
    transport = SimulatedTransport(design, bus=bus or Bus(), progress=progress)
    end = transport.base + transport.size
    frames = []
    with ShellDevice(transport, design) as device, progress.step("rendering through the bus"):
        device.load(image)
        for index, (values, code) in enumerate(zip(registers, formats, strict=True)):
            if scene_errors:
                transport.fail(scene_errors[index])
            device.set_frame(values, photo)
            size = -(-values["frame.width"] // tile) * tile * values["frame.height"] * PIXEL_BYTES[code]
            end -= -(-size // PAGE_BYTES) * PAGE_BYTES
            device.start(code, end)
            cycles = _to_the_interrupt(transport)
            device.wait_for_end()
            of_frame = {name: device.register(name) for name in readable}
            frames.append(ShellFrame(device.lines(), cycles, transport.read32(errors), of_frame))
    return frames


def _to_the_interrupt(transport: SimulatedTransport) -> int:
    cycles = 0
    while cycles < _MAX_CYCLES:
        cycles += (now := transport.wait())
        if now < transport.SLICE:
            return cycles
    raise RuntimeError(f"no interrupt after {_MAX_CYCLES:,} cycles")
