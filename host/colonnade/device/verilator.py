"""The RTL as a backend: runs the simulator of a design on a scene image."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from colonnade.common import cache, processes
from colonnade.common.atomic_files import replacing
from colonnade.common.errors import UserError
from colonnade.common.framebuffer import Frame
from colonnade.common.progress import QUIET, Progress, Report
from colonnade.common.temporary import temporary_folder
from colonnade.design.generator import GeneratedDesign
from colonnade.design.manifest import Manifest
from colonnade.device.simulator_build import build_simulator
from colonnade.scene_image.file import SceneImage

#: The state of an array is megabytes that each cycle passes over: with small pages it misses the TLB.
HUGE_PAGES = {"GLIBC_TUNABLES": "glibc.malloc.hugetlb=1"}

#: The harness's file of signals, in the folder of its job.
WAVEFORM = "waveform.vcd"

#: One pixel as the harness writes it (``struct PixelBytes``).
PIXEL = np.dtype(
    [
        ("colour", "<u2", 3),
        ("ratio", "<u2", 3),
        ("is_object", "u1"),
        ("is_seen", "u1"),
        ("triangle", "<u4"),
        ("distance", "<f8"),
    ]
)


@dataclass(frozen=True)
class Stalls:
    """Disturbances of the harness that must not change a frame.

    Attributes:
        percent: Share of the cycles in which the pixel sink takes nothing, 0 to 99.
        seed: Of the choice of those cycles.
        memory_percent: Share of the cycles in which each bank is held, 0 to 99; for designs that are holdable.
        memory_burst: Longest hold of a bank, cycles; lengths from 1 on are equally frequent.
        check_interval: The coupling of the simulator's models is checked in each of so many cycles.
    """

    percent: int = 0
    seed: int = 1
    memory_percent: int = 0
    memory_burst: int = 32
    check_interval: int = 64

    def __post_init__(self) -> None:
        bursts = self.memory_burst >= 1 and self.check_interval >= 1
        if not (0 <= self.percent < 100 and 0 <= self.memory_percent < 100 and bursts):
            raise ValueError(f"stalls of 0 to 99 percent, in bursts of at least a cycle: not {self}")

    @property
    def options(self) -> list[str]:
        """What the harness is told."""
        memory = ["--memory", str(self.memory_percent), "--burst", str(self.memory_burst)]
        sink = ["--stall", str(self.percent), "--seed", str(self.seed), "--check", str(self.check_interval)]
        return [*sink, *(memory if self.memory_percent else [])]


@dataclass(frozen=True)
class Simulated:
    """Frames of one run of the simulator.

    Attributes:
        frames: One for each set of registers.
        cycles_per_second: Simulated clock cycles in a second of the host's time, while rendering.
    """

    frames: list[Frame]
    cycles_per_second: float


def render_rtl(
    design: GeneratedDesign,
    image: SceneImage,
    registers: list[Mapping[str, int]],
    stalls: Stalls | None = None,
    progress: Progress = QUIET,
    through_port: bool = False,
    waveform: Path | None = None,
) -> Simulated:
    """Renders frames, one for each set of registers; the image is loaded once.

    Args:
        design: what is simulated.
        image: what is loaded.
        registers: one set for each frame.
        stalls: disturbances.
        progress: shows the steps.
        through_port: the records take the hardware's load port, cycle by cycle, and not the harness's short cut.
        waveform: a file for the signals of the device, its first column and that column's first render unit, as VCD.

    Raises:
        UserError: the stalls hold banks, and the design has no input for that.
        RuntimeError: the hardware misbehaves (a pixel missing, twice, or outside the frame).
    """
    stalls = stalls or Stalls()
    if stalls.memory_percent and not is_holdable(design.manifest):
        raise UserError("this configuration's memory cannot be held: set columnBvhMemory.holdable=true for such stalls")
    program = build_simulator(design, progress, waveform=True) if waveform else build_simulator(design, progress)
    with temporary_folder() as place:
        job, outputs = write_job(place, design.manifest, image, registers, through_port)
        try:
            with progress.step("rendering in the simulator") as report:
                options = [*stalls.options, *(["--waveform", WAVEFORM] if waveform else [])]
                lines = run_program([str(program), *options, job.name], place, report)
            simulated = _collect(design.manifest, registers, outputs, lines)
        except RuntimeError:
            cache.discard(program.parent)
            raise
        if waveform is not None:
            with replacing(waveform) as stream, (place / WAVEFORM).open("rb") as written:
                shutil.copyfileobj(written, stream)
        return simulated


def write_job(
    place: Path,
    manifest: Manifest,
    image: SceneImage,
    registers: list[Mapping[str, int]],
    through_port: bool = False,
) -> tuple[Path, list[Path]]:
    """The harness's job file for some frames in the folder `place`, and the file of pixels that each will write.

    The harness runs in that folder: the job names files without it.
    """
    (place / "records").write_bytes(image.records.tobytes())
    load = "stream" if through_port else "load"
    lines = [f"{load} records {manifest.record_bits // 8} 0"]
    for section in image.attributes:
        (place / section.memory).write_bytes(section.words.tobytes())
        target = manifest.memories[section.memory]["target"]
        lines.append(f"{load} {section.memory} {section.words.shape[1]} {target}")
    readable = [register for register in manifest.registers.values() if register.access == "ro"]
    start = manifest.registers["control.start"].address
    outputs = []
    for number, values in enumerate(registers):
        for name, value in values.items():
            lines += [f"write {address} {word}" for address, word in manifest.registers[name].encode(value)]
        outputs.append(place / f"pixels{number}")
        size = f"{values['frame.width']} {values['frame.height']}"
        lines.append(f"frame {outputs[-1].name} {size} {start} {values['frame.watchdogCycles']}")
        lines += [f"read {register.name} {register.address} {register.words}" for register in readable]
    job = place / "job"
    job.write_text("\n".join(lines) + "\n")
    return job, outputs


def run_program(command: list[str], place: Path, report: Report) -> list[str]:
    """What the harness prints when it runs in the folder `place`, as lines; its progress goes to `report`."""
    said: deque[str] = deque(maxlen=5)
    with (place / "results").open("w") as output:
        environment = os.environ | HUGE_PAGES
        with processes.started(command, cwd=place, env=environment, stdout=output, stderr=subprocess.PIPE) as process:
            assert process.stderr is not None
            for line in process.stderr:
                if line.startswith("progress "):
                    report(float(line.split()[1]))
                else:
                    said.append(line.strip())
        if process.returncode != 0:
            raise RuntimeError(f"the simulated hardware failed (status {process.returncode}): {'; '.join(said)}")
    return (place / "results").read_text().splitlines()


def _collect(
    manifest: Manifest, registers: list[Mapping[str, int]], outputs: list[Path], lines: list[str]
) -> Simulated:
    values: list[dict[str, int]] = []
    cycles, seconds = 0, 0.0
    for line in lines:
        words = line.split()
        if words[0] == "simulated":
            values.append({})
            cycles += int(words[1])
            seconds += float(words[2])
        elif words[0] == "value":
            values[-1][words[1]] = int(words[2])
    frames = [
        _frame(manifest, settings, output, value)
        for settings, output, value in zip(registers, outputs, values, strict=True)
    ]
    return Simulated(frames, cycles / seconds if seconds > 0 else 0.0)


def _frame(manifest: Manifest, registers: Mapping[str, int], output: Path, values: Mapping[str, int]) -> Frame:
    shape = registers["frame.height"], registers["frame.width"]
    pixels = np.fromfile(output, dtype=PIXEL).reshape(shape)
    errors = [name.removeprefix("errors.") for name, value in values.items() if name.startswith("errors.") and value]
    missing = int((pixels["is_seen"] == 0).sum())
    if missing and not errors:
        raise RuntimeError(f"{missing:,} pixels of the frame never came")
    is_object = pixels["is_object"] != 0
    step = 2.0 ** -manifest.numbers["gridFraction"]
    return Frame(
        colour=np.ascontiguousarray(pixels["colour"]),
        is_object=is_object,
        triangle=np.where(is_object, pixels["triangle"].astype(np.int64), -1),
        distance=pixels["distance"] * step,
        counters={
            name.removeprefix("counters."): value for name, value in values.items() if name.startswith("counters.")
        },
        errors=errors,
        ratio=pixels["ratio"].copy() if registers.get("room.isThere", 0) else None,
    )


def is_holdable(manifest: Manifest) -> bool:
    """The design has an input that holds banks of its memory."""
    return bool(manifest.config["columnBvhMemory"].get("holdable", False))


def require_hits(manifest: Manifest) -> None:
    """Refuse what needs hit triangles of a design whose pixel stream carries none."""
    if not manifest.config["frame"]["hits"]:
        raise UserError("this configuration's pixel stream carries no hits: set frame.hits=true for --hits")
