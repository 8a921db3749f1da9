"""Compiles the RTL of a design to WebAssembly: the C++ that Verilator makes of it, and a bench (rtl.cpp)."""

from __future__ import annotations

import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from colonnade.common.progress import for_terminal
from colonnade.design.generator import design_for
from colonnade.device.simulator_build import simulator_tools
from colonnade.device.simulator_sources import both_edges
from module import OBJECTS, TARGET, zig

HERE = Path(__file__).parent
OPTIONS = (
    "--cc -O3 --noassert --x-assign fast --x-initial fast --threads 1 --no-timing --top-module Colonnade"
    " --output-split 20000 -Wno-fatal"
)
EXPORTS = (
    "rtl_read",
    "rtl_write",
    "rtl_load",
    "rtl_begin",
    "rtl_run",
    "rtl_colours",
    "rtl_triangles",
    "malloc",
    "free",
)


def compile_rtl(config: str, output: Path) -> None:
    """Write the module of a preset.

    Raises:
        UserError: A program is missing.
        subprocess.CalledProcessError: A compiler found an error; it has printed it.
    """
    design, tools = design_for(config, (), for_terminal()), simulator_tools()
    folder = OBJECTS / config
    folder.mkdir(parents=True, exist_ok=True)
    for path in design.sources:
        (folder / path.name).write_text(both_edges(path.read_text(encoding="utf-8")), encoding="utf-8")
    sources = [path.name for path in design.sources]
    command = [str(tools.verilator), *OPTIONS.split(), "--Mdir", "cpp", *sources]
    subprocess.run(command, check=True, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    root = subprocess.run([tools.verilator, "--getenv", "VERILATOR_ROOT"], check=True, capture_output=True, text=True)
    include = Path(root.stdout.strip()) / "include"
    options = [f"-I{folder / 'cpp'}", f"-I{include}", f"-I{include / 'vltstd'}", "-include", str(HERE / "threads.hpp")]
    options += ["-std=gnu++17", "-fno-exceptions", "-w", "-DVL_IGNORE_UNKNOWN_ARCH", "-Dthread_local="]
    files = [*sorted((folder / "cpp").glob("*.cpp")), include / "verilated.cpp", HERE / "rtl.cpp"]

    def compiled(source: Path) -> str:
        target = folder / f"{source.stem}.o"
        zig("c++", *TARGET, *options, "-c", str(source), "-o", str(target))
        return str(target)

    with ThreadPoolExecutor() as pool:
        objects = list(pool.map(compiled, files))
    exports = [f"-Wl,--export={name}" for name in EXPORTS]
    zig("c++", *TARGET, "-mexec-model=reactor", "-s", *objects, *exports, "-o", str(output))
