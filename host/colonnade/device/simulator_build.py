"""Builds the simulator of a design, cached by the content of Verilog and harness and by the tool versions."""

from __future__ import annotations

import hashlib
import os
import re
import shlex
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from colonnade.common import cache, processes
from colonnade.common.errors import UserError
from colonnade.common.progress import QUIET, Progress
from colonnade.common.temporary import temporary_folder
from colonnade.design.generator import GeneratedDesign
from colonnade.design.manifest import Manifest
from colonnade.design.toolchain import cache_directory, project_root, require_program
from colonnade.device.compiler import (
    SAFE,
    clean_environment,
    require_compiler,
    require_right_compiler,
    require_verilator,
)
from colonnade.device.simulator_sources import DEVICE, large_parts, write_sources

PROGRAM = "simulator"

#: Options of all models. Models are flattened, so that one structure holds the variables of the coupling.
_VERILATOR_OPTIONS = (
    "--cc --build -j 0 -O3 --flatten --noassert --x-assign fast --x-initial fast --threads 1 "
    "--output-split-cfuncs 2000 -Wno-fatal"
).split()

#: Options of a simulator that writes waveforms. Records are wider than the default limit of Verilator.
WAVEFORM_OPTIONS = ("--trace", "--trace-max-width", "1024", "-CFLAGS", "-DWAVEFORM")


@dataclass(frozen=True)
class Optimisation:
    """How the C++ of a simulator is compiled.

    Attributes:
        flag: The compiler's level.
        split: Size of Verilator's files. Each of them includes large headers.
    """

    flag: str
    split: int


#: Instead of -Os of Verilator's makefile, which is a third slower; -O2 is 2 % slower.
FAST = Optimisation("-O3", 20000)

#: For frames so small that compiling takes longer than simulating.
QUICK = Optimisation("-O0", 2**31 - 1)

_HARNESS = ("array.hpp", "still.hpp", "dram.hpp", "dram_timing.hpp")

#: Paths that make and the shell take as one word.
_PLAIN_PATH = re.compile(r"[\w/.+@%,-]+", re.ASCII)

_PURPOSE = "the rtl backend (--backend model needs no simulator)"


@dataclass(frozen=True)
class Tools:
    """The programs that build a simulator, and their versions."""

    verilator: Path
    compiler: Path
    versions: tuple[str, str]


def simulator_tools() -> Tools:
    """The programs that build a simulator; raises a `UserError` if one is missing or too old."""
    require_program("make", _PURPOSE)
    compiler, compiler_version = require_compiler(_PURPOSE)
    verilator, verilator_version = require_verilator(_PURPOSE)
    return Tools(verilator, compiler, (verilator_version, compiler_version))


def optimisation() -> Optimisation:
    """`FAST`, or `QUICK` if ``COLONNADE_QUICK_SIMULATORS`` is set."""
    return QUICK if os.environ.get("COLONNADE_QUICK_SIMULATORS") else FAST


def build_simulator(design: GeneratedDesign, progress: Progress = QUIET, waveform: bool = False) -> Path:
    """The simulator of a design, built unless `cache.entry` has it.

    Args:
        design: The design to simulate.
        progress: Shows the build.
        waveform: Build a slower simulator that can write waveforms.

    Raises:
        UserError: A program is missing, too old, or compiles wrongly.
        RuntimeError: The simulator does not build.
    """
    tools = simulator_tools()
    harness = Path(__file__).parent / "harness"
    here = Path(__file__).parent
    names = harness_of(design.manifest)
    recipe = [here / "simulator_build.py", here / "simulator_sources.py", *(harness / name for name in names)]
    parts = [*tools.versions, *(path.read_text() for path in recipe), *verilator_command(tools), design.digest()]
    parts += ["waveform"] if waveform else []
    key = hashlib.sha256("".join(f"{len(part)}:{part}" for part in parts).encode()).hexdigest()[:20]
    folder = cache_directory(project_root()) / "simulator" / key
    with cache.entry(folder, "simulator", progress) as empty:
        if empty is not None:
            with progress.step("building the simulator"):
                require_right_compiler(tools.compiler, (optimisation().flag, *SAFE))
                _build(tools, design, harness, empty, folder.with_suffix(".log"), waveform)
    return folder / PROGRAM


def harness_of(manifest: Manifest) -> tuple[str, ...]:
    """The sources of a design's harness, its program first."""
    return ("rays.cpp" if manifest.has_queries else "harness.cpp", *_HARNESS)


def _build(
    tools: Tools, design: GeneratedDesign, harness: Path, output: Path, log: Path, waveform: bool = False
) -> None:
    """Build in a temporary folder, since make does not accept spaces in paths, and move the program to `output`."""
    with temporary_folder() as work:
        if not _PLAIN_PATH.fullmatch(str(work)):
            raise UserError(f"make cannot build a simulator in {work.parent.parent}: set TMPDIR to a plain path")
        # A waveform has the column's signals in one place
        models = write_sources(design.sources, work, () if waveform else large_parts(design.sources))
        (work / "ports.hpp").write_text(ports_header(design.manifest, design.sources))
        program, *_ = names = harness_of(design.manifest)
        for name in names:
            shutil.copy(harness / name, work / name)
        commands = [_verilate(tools, top, [path.relative_to(work) for path in paths]) for top, paths in models.items()]
        if waveform:
            commands = [[*command, *WAVEFORM_OPTIONS] for command in commands]
        inner = [top for top in models if top != DEVICE]
        commands[-1] += ["--exe", "-o", PROGRAM, program, "-CFLAGS", " ".join(f"-I../obj_{top}" for top in inner)]
        commands[-1] += ["-CFLAGS", "-I..", "-LDFLAGS", " ".join(f"../obj_{top}/V{top}__ALL.a" for top in inner)]
        with log.open("w") as stream:
            for command in commands:
                done = processes.run(command, cwd=work, env=build_environment(), stdout=stream, stderr=stream)
                if done.returncode != 0:
                    raise RuntimeError(f"the simulator does not build (status {done.returncode}): see {log}")
        shutil.move(work / f"obj_{DEVICE}" / PROGRAM, output / PROGRAM)
    log.unlink()


def build_environment() -> dict[str, str]:
    """The environment of Verilator: its own runtime is compiled once for all simulators."""
    root = project_root()
    compiles = f"bash {shlex.quote(str(root / 'tools' / 'verilated-object'))}"
    return {
        **clean_environment(),
        "OBJCACHE": compiles,
        "COLONNADE_VERILATED": str(cache_directory(root) / "verilated"),
    }


def verilator_command(tools: Tools) -> list[str]:
    """Verilator with the options of all models, as it translates and compiles one."""
    level = optimisation()
    return [
        *(str(tools.verilator), *_VERILATOR_OPTIONS, "--output-split", str(level.split)),
        *("-CFLAGS", " ".join(SAFE), "-MAKEFLAGS", f"CXX={tools.compiler}"),
        *("-MAKEFLAGS", f"OPT_FAST={level.flag}", "-MAKEFLAGS", f"OPT_GLOBAL={level.flag}"),
    ]


def _verilate(tools: Tools, top: str, sources: Sequence[Path]) -> list[str]:
    """The Verilator command of one model, in the folder ``obj_TOP``."""
    return [*verilator_command(tools), "--top-module", top, "--Mdir", f"obj_{top}", *map(str, sources)]


def ports_header(manifest: Manifest, sources: Sequence[Path]) -> str:
    """``ports.hpp``: macros with the port names and counts of this design, for the harness."""
    columns = int(manifest.config["array"]["columns"])
    header = "#pragma once\n#define EACH_COLUMN(DO) " + " ".join(f"DO({column})" for column in range(columns)) + "\n"
    top = next((path.read_text() for path in sources if path.stem == "Colonnade"), "")
    # These port names end with their number format
    if match := re.search(r"io_pixels_0_bits_hit_distance_(\w+)", top):
        header += f"#define HIT_DISTANCE(column) top_.io_pixels_##column##_bits_hit_distance_{match.group(1)}\n"
    if "io_pixels_0_bits_hit_instance" in top:
        header += "#define HAS_INSTANCES\n"
    if match := re.search(r"io_pixels_0_bits_ratio_r_(\w+)", top):
        port = f"top_.io_pixels_##column##_bits_ratio_##channel##_{match.group(1)}"
        header += f"#define RATIO(column, channel) {port}\n"
    if cache := manifest.config["columnBvhMemory"]["cache"]:
        line = manifest.memories["columnBvh"]["line"]
        header += f"#define DRAM_BUS_BYTES {cache['busBytes']}\n#define DRAM_LINE_RECORDS {line['records']}\n"
        header += f"#define DRAM_LINE_PITCH {line['pitch']}\n"
    if manifest.config["columnBvhMemory"].get("holdable", False):
        header += f"#define MEMORY_BANKS {columns * int(manifest.config['columnBvhMemory']['banks'])}\n"
    return header
