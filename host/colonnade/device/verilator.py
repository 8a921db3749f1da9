"""The RTL backend: runs the Verilator simulator of a design on a scene image."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from colonnade.common import cache, processes
from colonnade.common.atomic_files import replacing
from colonnade.common.errors import UserError
from colonnade.common.framebuffer import Frame
from colonnade.common.progress import QUIET, Progress, Report
from colonnade.common.temporary import temporary_folder
from colonnade.design.generator import GeneratedDesign
from colonnade.design.manifest import Manifest
from colonnade.device.harness_job import FrameOutput, frame_commands, is_whole, parse_output, read_frame
from colonnade.device.simulator_build import build_simulator
from colonnade.scene_image.file import SceneImage

#: Each cycle touches megabytes of simulator state; huge pages avoid TLB misses.
HUGE_PAGES = {"GLIBC_TUNABLES": "glibc.malloc.hugetlb=1"}

#: The harness's file of signals, in the folder of its job.
WAVEFORM = "waveform.vcd"


@dataclass(frozen=True)
class Stalls:
    """Random stalls at the device's ports, which must not change a frame, and the interval of coupling checks.

    Attributes:
        percent: Percentage of cycles in which the pixel sink is not ready, 0 to 99.
        seed: Random seed.
        memory_percent: Percentage of cycles in which each bank is stalled, 0 to 99; needs `is_holdable`.
        memory_burst: Longest stall of a bank, cycles; lengths are uniform from 1.
        check_interval: Cycles between checks of the coupling of the simulator's models.
        dram_latency: Cycles from a read to its first data, for designs with a cache; with `dram_banks`, of an open row.
        dram_interval: Cycles from a beat of DRAM to the next one.
        dram_banks: Banks of a DRAM with rows and refresh, a power of two; 0: every read takes the same latency.
        dram_random: Percentage of cycles in which DRAM accepts or delivers nothing; reads then overtake each other.
        dram_errors: Beats of 1024 that DRAM answers with an error in the first frame.
        dram_silent: Reads of the first frame after which DRAM answers no more until the frame has ended; 0: all.
    """

    percent: int = 0
    seed: int = 1
    memory_percent: int = 0
    memory_burst: int = 32
    check_interval: int = 64
    dram_latency: int = 100
    dram_interval: int = 1
    dram_banks: int = 0
    dram_random: int = 0
    dram_errors: int = 0
    dram_silent: int = 0

    def __post_init__(self) -> None:
        bursts = self.memory_burst >= 1 and self.check_interval >= 1
        if not (0 <= self.percent < 100 and 0 <= self.memory_percent < 100 and bursts):
            raise ValueError(f"stalls must be 0 to 99 percent, bursts and check intervals at least one cycle: {self}")

    @property
    def options(self) -> list[str]:
        """Command-line options of the harness."""
        dram = [
            *("--dram", str(self.dram_latency), "--dram-random", str(self.dram_random)),
            *("--dram-interval", str(self.dram_interval), "--dram-banks", str(self.dram_banks)),
            *("--dram-errors", str(self.dram_errors), "--dram-silent", str(self.dram_silent)),
        ]
        memory = ["--memory", str(self.memory_percent), "--burst", str(self.memory_burst)]
        sink = ["--stall", str(self.percent), "--seed", str(self.seed), "--check", str(self.check_interval)]
        return [*sink, *dram, *(memory if self.memory_percent else [])]


@dataclass(frozen=True)
class Simulated:
    """The frames of one simulator run.

    Attributes:
        frames: One frame per set of registers.
        cycles_per_second: Simulated clock cycles by a CPU second, without loading.
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
    """Render one frame per set of registers, as `simulate`, and keep all frames."""
    frames: list[Frame] = []
    rate = simulate(design, image, registers, frames.append, stalls, progress, through_port, waveform)
    return Simulated(frames, rate)


def simulate(
    design: GeneratedDesign,
    image: SceneImage,
    registers: list[Mapping[str, int]],
    each: Callable[[Frame], None],
    stalls: Stalls | None = None,
    progress: Progress = QUIET,
    through_port: bool = False,
    waveform: Path | None = None,
    early: Callable[[Frame], None] | None = None,
) -> float:
    """Render one frame per set of registers. The image is loaded once.

    Args:
        design: The design to simulate.
        image: The scene image to load.
        registers: All rw registers by name, one set per frame.
        each: Takes the frames in order; they are in memory one at a time.
        stalls: Random stalls; None: no stalls.
        progress: Shows the steps.
        through_port: Load records through the load port, one per cycle, and not directly into the memories.
        waveform: VCD file for the signals of the device, its first column and that column's first traversal unit.
        early: Takes the pixels of the first frame, without counters, while the others are simulated.

    Returns:
        Simulated clock cycles by a CPU second, without loading.

    Raises:
        UserError: The stalls include banks, and the design has no input for that.
        RuntimeError: The hardware is wrong: a pixel is missing, duplicate or outside the frame.
    """
    stalls = stalls or Stalls()
    if stalls.memory_percent and not is_holdable(design.manifest):
        raise UserError("this configuration cannot stall its memory: set columnBvhMemory.holdable=true")
    program = build_simulator(design, progress, waveform=waveform is not None)
    with temporary_folder() as folder:
        job, pixel_files = write_job(folder, design.manifest, image, registers, through_port)
        waiting = [early] if early is not None and len(registers) > 1 else []

        def advanced(fraction: float) -> None:
            report(fraction)
            if waiting and is_whole(registers[0], pixel_files[0]):
                waiting.pop()(read_frame(design.manifest, registers[0], pixel_files[0], FrameOutput(0, 0.0))[0])

        try:
            with progress.step("rendering in the simulator") as report:
                options = [*stalls.options, *(["--waveform", WAVEFORM] if waveform else [])]
                lines = run_program([str(program), *options, job.name], folder, advanced)
            outputs = parse_output(lines)
            for of_frame in zip(registers, pixel_files, outputs, strict=True):
                each(_frame(design.manifest, *of_frame))
        except RuntimeError:
            cache.discard(program.parent)
            raise
        if waveform is not None:
            with replacing(waveform) as stream, (folder / WAVEFORM).open("rb") as written:
                shutil.copyfileobj(written, stream)
    seconds = sum(output.seconds for output in outputs)
    cycles = sum(output.cycles for output in outputs)
    return cycles / seconds if seconds > 0 else 0.0


def write_job(
    folder: Path,
    manifest: Manifest,
    image: SceneImage,
    registers: list[Mapping[str, int]],
    through_port: bool = False,
) -> tuple[Path, list[Path]]:
    """Write a job of the harness for some frames of an image into `folder`.

    Returns:
        The job file, and the pixel file that each frame will write. The harness runs in `folder`.
    """
    (folder / "records").write_bytes(image.records.tobytes())
    load = "stream" if through_port else "load"
    lines = [f"{load} records {manifest.record_bits // 8} 0"]
    for section in image.attributes:
        (folder / section.memory).write_bytes(section.words.tobytes())
        target = manifest.memories[section.memory]["target"]
        lines.append(f"{load} {section.memory} {section.words.shape[1]} {target}")
    pixel_files = [folder / f"pixels{number}" for number in range(len(registers))]
    for values, pixel_file in zip(registers, pixel_files, strict=True):
        lines += frame_commands(manifest, values, pixel_file.name)
    job = folder / "job"
    job.write_text("\n".join(lines) + "\n")
    return job, pixel_files


def run_program(command: list[str], folder: Path, report: Report) -> list[str]:
    """Run the harness in `folder` and return the lines of its output, which ``folder/results`` also holds.

    Raises:
        RuntimeError: The exit status is not 0. The message names the first assertion of the hardware that failed.
    """
    messages: deque[str] = deque(maxlen=5)
    with (folder / "results").open("w") as output:
        environment = os.environ | HUGE_PAGES
        with processes.started(command, cwd=folder, env=environment, stdout=output, stderr=subprocess.PIPE) as process:
            assert process.stderr is not None
            for line in process.stderr:
                if line.startswith("progress "):
                    report(float(line.split()[1]))
                else:
                    messages.append(line.strip())
    lines = (folder / "results").read_text().splitlines()
    if process.returncode != 0:
        messages.extend([line for line in lines if "%Error" in line][:1])
        raise RuntimeError(f"the simulated hardware failed (status {process.returncode}): {'; '.join(messages)}")
    return lines


def _frame(manifest: Manifest, registers: Mapping[str, int], pixel_file: Path, output: FrameOutput) -> Frame:
    frame, missing = read_frame(manifest, registers, pixel_file, output)
    if missing and not frame.errors:
        raise RuntimeError(f"{missing:,} pixels of the frame are missing")
    return frame


def is_holdable(manifest: Manifest) -> bool:
    """Whether the design has an input that stalls the banks of its memory."""
    return bool(manifest.config["columnBvhMemory"].get("holdable", False))


def require_hits(manifest: Manifest) -> None:
    """Raise a `UserError` for a design whose pixel stream has no hit triangles."""
    if not manifest.config["frame"]["hits"]:
        raise UserError("this configuration's pixel stream has no hits: set frame.hits=true for --hits")
