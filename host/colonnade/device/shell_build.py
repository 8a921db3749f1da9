"""Builds the simulator of the AXI4 shell."""

from __future__ import annotations

import hashlib
import shutil
import subprocess
from pathlib import Path

from colonnade.common import cache, processes
from colonnade.common.progress import QUIET, Progress
from colonnade.common.temporary import temporary_folder
from colonnade.design.generator import GeneratedDesign
from colonnade.design.toolchain import cache_directory, project_root
from colonnade.device.compiler import SAFE, require_right_compiler
from colonnade.device.simulator_build import (
    PROGRAM,
    Tools,
    build_environment,
    optimisation,
    ports_header,
    simulator_tools,
    verilator_command,
)

_TOP = "ColonnadeAxi"
_SEQUENCES = (
    "axi_rules.hpp",
    "axi_slave.hpp",
    "axi_bench.hpp",
    "sequences.hpp",
    "frame_sequences.hpp",
    "batch_sequences.hpp",
)
_HARNESS = ("shell.cpp", "shell_memory.hpp", "bus_bytes.hpp", "dram.hpp", "dram_timing.hpp", *_SEQUENCES)


def build_shell_simulator(design: GeneratedDesign, progress: Progress = QUIET) -> Path:
    """The simulator of a design in its shell, one model, built unless the cache has it."""
    tools = simulator_tools()
    harness = [Path(__file__).parent / "harness" / name for name in _HARNESS]
    ports = ports_header(design.manifest, design.sources)
    if "m_axi_refit_awvalid" in next(path.read_text() for path in design.sources if path.stem == _TOP):
        ports += "#define HAS_REFIT\n"
    parts = [
        *tools.versions,
        Path(__file__).read_text(),
        *(file.read_text() for file in harness),
        ports,
        *verilator_command(tools),
        design.digest(),
    ]
    key = hashlib.sha256("".join(f"{len(part)}:{part}" for part in parts).encode()).hexdigest()[:20]
    folder = cache_directory(project_root()) / "simulator" / key
    with cache.entry(folder, "simulator", progress) as empty:
        if empty is not None:
            with progress.step("building the simulator of the shell"), temporary_folder() as work:
                _build(tools, design, harness, ports, work, folder.with_suffix(".log"))
                shutil.move(work / "obj" / PROGRAM, empty / PROGRAM)
    return folder / PROGRAM


def _build(tools: Tools, design: GeneratedDesign, harness: list[Path], ports: str, work: Path, log: Path) -> None:
    """Build `PROGRAM` in ``work/obj``."""
    require_right_compiler(tools.compiler, (optimisation().flag, *SAFE))
    for source in [*design.sources, *harness]:
        shutil.copy(source, work / source.name)
    (work / "ports.hpp").write_text(ports)
    # Registers begin with random values, as at power-up
    command = [*verilator_command(tools), "--x-initial", "unique", "--top-module", _TOP, "--Mdir", "obj"]
    command += ["--exe", "-o", PROGRAM, harness[0].name, *(source.name for source in design.sources)]
    with log.open("w") as stream:
        done = processes.run(command, cwd=work, env=build_environment(), stdout=stream, stderr=subprocess.STDOUT)
    if done.returncode != 0:
        raise RuntimeError(f"the simulator does not build (status {done.returncode}): see {log}")
    log.unlink()
