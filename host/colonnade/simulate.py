"""The RTL as a backend: the emitted Verilog under Verilator, built once per design and run on a scene image."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import tempfile
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from colonnade.errors import UserError
from colonnade.files import locked
from colonnade.frame import Frame
from colonnade.generator import GeneratedDesign
from colonnade.image import SceneImage
from colonnade.manifest import Manifest
from colonnade.progress import QUIET, Progress, Report
from colonnade.toolchain import cache_directory, project_root, require_simulator

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

VERILATOR_OPTIONS = (
    "--cc --exe --build -O3 --noassert --x-assign fast --x-initial fast --threads 1 "
    "--output-split 20000 --output-split-cfuncs 2000 -Wno-fatal --top-module Colonnade"
).split()

#: In a larger array the render unit is compiled once, not once a copy: Verilator makes some 170 MB of C++ of 80 copies.
MOST_FLAT_UNITS = 4


@dataclass(frozen=True)
class Stalls:
    """Disturbances of the harness that must not change a frame.

    Attributes:
        percent: Share of the cycles in which the pixel sink takes nothing, 0 to 99.
        seed: Of the choice of those cycles.
        memory_percent: Share of the cycles in which each bank is held, 0 to 99; for designs that are holdable.
        memory_burst: Longest hold of a bank, cycles; lengths from 1 on are equally frequent.
    """

    percent: int = 0
    seed: int = 1
    memory_percent: int = 0
    memory_burst: int = 32

    def __post_init__(self) -> None:
        if not (0 <= self.percent < 100 and 0 <= self.memory_percent < 100 and self.memory_burst >= 1):
            raise ValueError(f"stalls of 0 to 99 percent, in bursts of at least a cycle: not {self}")

    @property
    def options(self) -> list[str]:
        """What the harness is told."""
        memory = ["--memory", str(self.memory_percent), "--burst", str(self.memory_burst)]
        return ["--stall", str(self.percent), "--seed", str(self.seed), *(memory if self.memory_percent else [])]


@dataclass(frozen=True)
class Simulated:
    """Frames of one run of the simulator.

    Attributes:
        frames: One for each set of registers.
        cycles_per_second: Simulated clock cycles in a second of the host's time, while rendering.
    """

    frames: list[Frame]
    cycles_per_second: float


def build_simulator(design: GeneratedDesign, progress: Progress = QUIET) -> Path:
    """The simulator of a design: compiled once, kept by the content of the Verilog and of the harness."""
    verilator = require_simulator()
    harness = Path(__file__).parent / "harness" / "harness.cpp"
    parts = (" ".join(VERILATOR_OPTIONS).encode(), harness.read_bytes(), design.digest().encode())
    digest = hashlib.sha256(b"".join(f"{len(part)}:".encode() + part for part in parts))
    folder = cache_directory(project_root()) / "simulator" / digest.hexdigest()[:20]
    program = folder / "simulator"
    with locked(folder.parent / f"{folder.name}.lock"):
        if not program.is_file():
            with (
                progress.step("building the simulator"),
                tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}.") as place,
            ):
                built = _build(verilator, design, harness, Path(place), folder.parent)
                folder.mkdir(exist_ok=True)
                built.replace(program)
    os.utime(program)
    return program


def _build(verilator: Path, design: GeneratedDesign, harness: Path, place: Path, logs: Path) -> Path:
    config, sources = design.manifest.config, design.sources
    columns = int(config["array"]["columns"])
    each = " ".join(f"DO({column})" for column in range(columns))
    header = f"#pragma once\n#define EACH_COLUMN(DO) {each}\n" + _pixel_ports(sources)
    if is_holdable(design.manifest):
        header += f"#define MEMORY_BANKS {columns * int(config['columnBvhMemory']['banks'])}\n"
    (place / "columns.hpp").write_text(header)
    shutil.copy(harness, place / "harness.cpp")
    (place / "sources.f").write_text("\n".join(map(str, sources)) + "\n")
    command = [str(verilator), *VERILATOR_OPTIONS, "-j", "0", "--Mdir", str(place / "obj"), "-o", "simulator"]
    if columns * int(config["array"]["rows"]) > MOST_FLAT_UNITS:
        (place / "blocks.vlt").write_text('`verilator_config\nhier_block -module "RenderUnit"\n')
        command += ["--hierarchical", str(place / "blocks.vlt")]
    command += ["-CFLAGS", f"-O2 -I{place}", "-f", str(place / "sources.f"), str(place / "harness.cpp")]
    log = logs / f"{place.name.split('.')[1]}.log"
    with log.open("w") as stream:
        status = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=stream, stderr=subprocess.STDOUT, check=False)
    program = place / "obj" / "simulator"
    if status.returncode != 0 or not program.is_file():
        raise RuntimeError(f"the simulator does not build (status {status.returncode}): see {log}")
    return program


def _pixel_ports(sources: list[Path]) -> str:
    """Names of ports that end with their format, which the harness need not know; those that the stream has."""
    top = next(path for path in sources if path.stem == "Colonnade").read_text()
    macros = ""
    if match := re.search(r"io_pixels_0_bits_hit_distance_(\w+)", top):
        macros += f"#define HIT_DISTANCE(column) top_.io_pixels_##column##_bits_hit_distance_{match.group(1)}\n"
    if match := re.search(r"io_pixels_0_bits_ratio_r_(\w+)", top):
        port = f"top_.io_pixels_##column##_bits_ratio_##channel##_{match.group(1)}"
        macros += f"#define RATIO(column, channel) {port}\n"
    return macros


def render_rtl(
    design: GeneratedDesign,
    image: SceneImage,
    registers: list[Mapping[str, int]],
    stalls: Stalls | None = None,
    progress: Progress = QUIET,
) -> Simulated:
    """Renders frames, one for each set of registers; the image is loaded once.

    Raises:
        UserError: the stalls hold banks, and the design has no input for that.
        RuntimeError: the hardware misbehaves (a pixel missing, twice, or outside the frame).
    """
    stalls = stalls or Stalls()
    if stalls.memory_percent and not is_holdable(design.manifest):
        raise UserError("this configuration's memory cannot be held: set columnBvhMemory.holdable=true for such stalls")
    program = build_simulator(design, progress)
    with tempfile.TemporaryDirectory(prefix="colonnade-") as place:
        job, outputs = write_job(Path(place), design.manifest, image, registers)
        command = [str(program), *stalls.options, str(job)]
        with progress.step("rendering in the simulator") as report:
            lines = run_program(command, Path(place) / "results", report)
        return _collect(design.manifest, registers, outputs, lines)


def write_job(
    place: Path, manifest: Manifest, image: SceneImage, registers: list[Mapping[str, int]]
) -> tuple[Path, list[Path]]:
    """The harness's job file for some frames in the folder `place`, and the file of pixels that each will write."""
    records = place / "records"
    records.write_bytes(image.records.tobytes())
    lines = [f"load {records} {manifest.record_bits // 8}"]
    for section in image.attributes:
        words = place / section.memory
        words.write_bytes(section.words.tobytes())
        lines.append(f"load {words} {section.words.shape[1]} {manifest.memories[section.memory]['target']}")
    readable = [register for register in manifest.registers.values() if register.access == "ro"]
    start = manifest.registers["control.start"].address
    outputs = []
    for number, values in enumerate(registers):
        for name, value in values.items():
            lines += [f"write {address} {word}" for address, word in manifest.registers[name].encode(value)]
        outputs.append(place / f"pixels{number}")
        lines.append(f"frame {outputs[-1]} {values['frame.width']} {values['frame.height']} {start}")
        lines += [f"read {register.name} {register.address} {register.words}" for register in readable]
    job = place / "job"
    job.write_text("\n".join(lines) + "\n")
    return job, outputs


def run_program(command: list[str], results: Path, report: Report) -> list[str]:
    """Lines that the harness writes to the file ``results``; its progress goes to ``report``."""
    said: deque[str] = deque(maxlen=5)
    with (
        results.open("w") as output,
        subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.PIPE, text=True
        ) as process,
    ):
        assert process.stderr is not None
        for line in process.stderr:
            if line.startswith("progress "):
                report(float(line.split()[1]))
            else:
                said.append(line.strip())
    if process.returncode != 0:
        raise RuntimeError(f"the simulated hardware failed (status {process.returncode}): {'; '.join(said)}")
    return results.read_text().splitlines()


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
