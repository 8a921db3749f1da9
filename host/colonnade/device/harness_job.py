"""The files of the simulator's harness (harness.cpp): its job, its output, and the pixels of each frame."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from colonnade.common.framebuffer import Frame
from colonnade.design.manifest import Manifest

#: One pixel as the harness writes it (``struct PixelBytes``).
PIXEL = np.dtype(
    [
        ("colour", "<u2", 3),
        ("ratio", "<u2", 3),
        ("is_object", "u1"),
        ("is_seen", "u1"),
        ("triangle", "<u4"),
        ("instance", "<u4"),
        ("distance", "<f8"),
    ]
)


@dataclass(frozen=True)
class FrameOutput:
    """What the harness prints about one frame.

    Attributes:
        cycles: Simulated clock cycles.
        seconds: CPU seconds.
        values: Read-only registers by name, read after the frame.
    """

    cycles: int
    seconds: float
    values: dict[str, int] = field(default_factory=dict)


def frame_commands(manifest: Manifest, registers: Mapping[str, int], pixel_file: str) -> list[str]:
    """The commands of a job that write a frame's registers, render it, and read its read-only registers."""
    lines = []
    for name, value in registers.items():
        lines += [f"write {address} {word}" for address, word in manifest.registers[name].encode(value)]
    size = f"{registers['frame.width']} {registers['frame.height']}"
    start = manifest.registers["control.start"].address
    lines.append(f"frame {pixel_file} {size} {start} {registers['frame.watchdogCycles']}")
    readable = (register for register in manifest.registers.values() if register.access == "ro")
    return [*lines, *(f"read {register.name} {register.address} {register.words}" for register in readable)]


def parse_output(lines: Iterable[str]) -> list[FrameOutput]:
    """The output of the harness by frame; the last frame of a failed run may lack registers.

    Other lines are skipped, such as an assertion's of the hardware.
    """
    frames: list[FrameOutput] = []
    for words in filter(None, map(str.split, lines)):
        if words[0] == "simulated":
            frames.append(FrameOutput(int(words[1]), float(words[2])))
        elif words[0] == "value":
            frames[-1].values[words[1]] = int(words[2])
    return frames


def is_whole(registers: Mapping[str, int], pixel_file: Path) -> bool:
    """Whether the harness has written the pixels of a frame."""
    pixels = registers["frame.height"] * registers["frame.width"]
    return pixel_file.exists() and pixel_file.stat().st_size == pixels * PIXEL.itemsize


def read_frame(
    manifest: Manifest, registers: Mapping[str, int], pixel_file: Path, output: FrameOutput
) -> tuple[Frame, int]:
    """A frame, and its number of missing pixels, which are zero in the frame."""
    pixels = np.fromfile(pixel_file, dtype=PIXEL).reshape(registers["frame.height"], registers["frame.width"])
    is_object, values = pixels["is_object"] != 0, output.values
    frame = Frame(
        colour=np.ascontiguousarray(pixels["colour"]),
        is_object=is_object,
        triangle=np.where(is_object, pixels["triangle"].astype(np.int64), -1),
        instance=np.where(is_object, pixels["instance"].astype(np.int64), -1),
        distance=pixels["distance"] * 2.0 ** -manifest.numbers["gridFraction"],
        counters={name.removeprefix("counters."): n for name, n in values.items() if name.startswith("counters.")},
        errors=[name.removeprefix("errors.") for name, bit in values.items() if name.startswith("errors.") and bit],
        ratio=pixels["ratio"].copy() if registers.get("environment.enabled", 0) else None,
    )
    return frame, int((pixels["is_seen"] == 0).sum())
