"""The AXI4 shell in the simulator: loads a device image over the bus and renders frames into a memory."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from colonnade.common.framebuffer_formats import PIXEL_BYTES
from colonnade.common.progress import QUIET, Progress
from colonnade.common.temporary import temporary_folder
from colonnade.design.generator import GeneratedDesign
from colonnade.device.shell_build import build_shell_simulator
from colonnade.device.verilator import run_program
from colonnade.scene_image.device_image import device_image
from colonnade.scene_image.dram_image import PAGE_BYTES, dram_image
from colonnade.scene_image.file import SceneImage

_START, _LOAD = 1, 2
_MAX_CYCLES = 50_000_000


@dataclass(frozen=True)
class Bus:
    """The memory behind the shell.

    Attributes:
        latency: Cycles from a read or the end of a write to its answer.
        stall: Percentage of cycles in which a channel does not move, 0 to 99.
        order: When the address and the data of a write are taken, a number of `WriteOrder` of the testbench, 0 to 4.
        seed: Random seed of the stalls, and of the registers' values at power-up.
    """

    latency: int = 1
    stall: int = 0
    order: int = 0
    seed: int = 1


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


class ShellMap:
    """Addresses of a shell's registers, from its ``shell.json``."""

    def __init__(self, design: GeneratedDesign) -> None:
        shell = json.loads((design.dir / "shell.json").read_text())
        self.bus_bytes = int(shell["busBytes"])
        self.device_base = int(shell["deviceBase"])
        self._registers: dict[str, Any] = {register["name"]: register for register in shell["registers"]}

    def write(self, name: str, value: int) -> list[str]:
        """Commands that write a register."""
        register = self._registers[name]
        words = range(-(-int(register["width"]) // 32))
        return [f"write {register['address'] + 4 * word} {value >> 32 * word & 0xFFFFFFFF}" for word in words]

    def read(self, name: str) -> str:
        """The command that reads a register."""
        register = self._registers[name]
        return f"read {name} {register['address']} {-(-int(register['width']) // 32)}"


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
    """Render a frame for each set of registers, in the format of the same index, through the bus.

    With a cache the records lie behind the frames, and ``dram.page`` is set to their address.

    Args:
        design: A design with its shell (`generator.shell_design_for`).
        image: The scene image; it is loaded once.
        registers: All rw registers of the device, a set for each frame.
        formats: Codes of `FORMATS`.
        bus: The memory's timing.
        progress: Shows the steps.
        photo: Composited into the frames, which then have one size: sRGB, uint8 [height, width, 3].
        scene_errors: With a cache: for each frame, how many of 1024 beats of the scene's reads fail; none if empty.

    Raises:
        RuntimeError: The shell breaks a rule of AXI, refuses an access, leaves its windows, or hangs.
    """
    bus = bus or Bus()
    program = build_shell_simulator(design, progress)
    shell = ShellMap(design)
    tile = int(design.manifest.config["frame"]["tileSize"])
    data = device_image(image, design.manifest)
    base = _pages(len(data))
    places, end = [], base
    for values, code in zip(registers, formats, strict=True):
        stride = -(-values["frame.width"] // tile) * tile * PIXEL_BYTES[code]
        places.append((end, stride, values["frame.height"]))
        end += _pages(stride * values["frame.height"])
    with temporary_folder() as folder:
        (folder / "image").write_bytes(data)
        lines = ["store image 0", *_load(shell, len(data))]
        if photo is not None:
            stored = _photo_lines(photo, tile)
            (folder / "photo").write_bytes(stored.tobytes())
            lines += [f"store photo {end}", *_photo(shell, end, stored)]
            end += stored.size
        scene = {}
        if design.manifest.config["columnBvhMemory"]["cache"]:
            (folder / "scene").write_bytes(records := dram_image(image, design.manifest))
            end = _pages(end)
            lines.append(f"store scene {end}")
            scene = {"dram.page": end // PAGE_BYTES}
            end += len(records)
        for index, (values, code, place) in enumerate(zip(registers, formats, places, strict=True)):
            lines += [f"fail {scene_errors[index]}"] if scene_errors else []
            lines += _frame(shell, design, {**values, **scene}, code, place)
            lines.append(f"dump frame{index} {place[0]} {place[1] * place[2]}")
        (folder / "job").write_text("\n".join(lines) + "\n")
        options = {
            "bus": shell.bus_bytes,
            "memory": end,
            "latency": bus.latency,
            "stall": bus.stall,
            "order": bus.order,
            "seed": bus.seed,
        }
        arguments = [text for name, value in options.items() for text in (f"--{name}", str(value))]
        with progress.step("rendering through the bus") as report:
            output = run_program([str(program), *arguments, "job"], folder, report)
        return _frames(folder, output, places)


def _pages(size: int) -> int:
    """Bytes of the pages that hold so many bytes."""
    return -(-size // PAGE_BYTES) * PAGE_BYTES


def _photo_lines(photo: npt.NDArray[np.uint8], tile: int) -> npt.NDArray[np.uint8]:
    """A photo as XRGB8888, in lines of whole tile rows: uint8 [height, stride]."""
    height, width, _ = photo.shape
    lines = np.zeros((height, -(-width // tile) * tile, 4), np.uint8)
    lines[:, :width, :3] = photo[..., ::-1]
    return lines.reshape(height, -1)


def _photo(shell: ShellMap, base: int, lines: npt.NDArray[np.uint8]) -> list[str]:
    """Show the photo where the object is not, from a window of its size."""
    places = {"base": base, "windowBase": base, "windowEnd": base + lines.size, "stride": lines.shape[1], "enabled": 1}
    return [command for name, value in places.items() for command in shell.write(f"photo.{name}", value)]


def _load(shell: ShellMap, size: int) -> list[str]:
    """Load the image at address 0, in a window of its size."""
    lines = shell.write("interrupt.enable", 2)
    for name, value in {"base": 0, "bytes": size, "windowBase": 0, "windowEnd": size}.items():
        lines += shell.write(f"image.{name}", value)
    lines += [*shell.write("control", _LOAD), f"wait {_MAX_CYCLES}", *shell.write("interrupt.status", 7)]
    return [*lines, shell.read("image.errors"), *shell.write("interrupt.enable", 1)]


def _frame(
    shell: ShellMap, design: GeneratedDesign, values: Mapping[str, int], code: int, place: tuple[int, int, int]
) -> list[str]:
    """Render a frame into its place, in a window of its size, and read its registers."""
    base, stride, height = place
    lines = []
    for name, value in values.items():
        for address, word in design.manifest.registers[name].encode(value):
            lines.append(f"write {shell.device_base + 4 * address} {word}")
    window = {"base": base, "stride": stride, "format": code, "windowBase": base, "windowEnd": base + stride * height}
    for name, value in window.items():
        lines += shell.write(f"framebuffer.{name}", value)
    lines += [*shell.write("control", _START), f"wait {_MAX_CYCLES}", *shell.write("interrupt.status", 7)]
    lines.append(shell.read("framebuffer.errors"))
    for register in design.manifest.registers.values():
        if register.access == "ro":
            lines.append(f"read {register.name} {shell.device_base + 4 * register.address} {register.words}")
    return lines


def _frames(folder: Path, output: Sequence[str], places: Sequence[tuple[int, int, int]]) -> list[ShellFrame]:
    """The frames of a run; the first wait is that of the image."""
    waits, values = list[int](), list[dict[str, int]]()
    for line in output:
        kind, *words = line.split()
        if kind == "waited":
            waits.append(int(words[0]))
            values.append({})
        else:
            values[-1][words[0]] = int(words[1])
    if values[0]["image.errors"]:
        raise RuntimeError(f"the shell refused the image: image.errors is {values[0]['image.errors']:#x}")
    frames = []
    for index, (_, stride, height) in enumerate(places):
        lines = np.frombuffer((folder / f"frame{index}").read_bytes(), dtype=np.uint8).reshape(height, stride)
        of_frame = values[index + 1]
        frames.append(ShellFrame(lines, waits[index + 1], of_frame.pop("framebuffer.errors"), of_frame))
    return frames
