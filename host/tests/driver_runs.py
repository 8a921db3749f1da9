"""Runs programs of the driver: alone, or against the Verilated shell, whose memory is a file."""

from __future__ import annotations

import functools
import subprocess
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from c_programs import DRIVER_FOLDER, compile_c, driver_objects, scratch
from numpy.typing import NDArray

from colonnade.design.generator import GeneratedDesign
from colonnade.device.shell_build import build_shell_simulator
from colonnade.integration.design_header import design_header
from colonnade.integration.register_table import register_table

PAGE, MEMORY = 4096, 1 << 22
UNWRITTEN = 0xA5
CACHE = {
    **{"lines": 8, "ways": 2, "misses": 4, "sharedLines": 16, "sharedWays": 2, "sharedMisses": 8},
    **{"busBytes": 32, "parity": True},
}


def run_silently(*command: str | Path) -> None:
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


#: Every error has its name, and no access is made that the shell refuses.


@functools.cache
def compiled_driver(program: str, header: str) -> Path:
    """A program of the tests, or the viewer of the examples, with the driver, for the design of a header."""
    folder = scratch()
    (folder / "colonnade_design.h").write_text(header)
    tests, examples = DRIVER_FOLDER / "tests", DRIVER_FOLDER / "examples"
    if program == "viewer":
        sources = [
            examples / "viewer.c",
            examples / "target.c",
            examples / "target_files.c",
            tests / "target_simulated.c",
        ]
        return compile_c([*sources, *driver_objects()], folder / "driver", f"-I{examples}", "-lm")
    return compile_c([tests / f"{program}.c", *driver_objects()], folder / "driver")


def run_driver(
    folder: Path, design: GeneratedDesign, files: Mapping[str, bytes], *arguments: str, program: str = "simulated"
) -> tuple[NDArray[np.uint8], list[list[str]]]:
    """Run the driver with files against the Verilated shell: the memory at the end, and the lines that it prints."""
    for name, content in files.items():
        (folder / name).write_bytes(content)
    driver = compiled_driver(program, design_header(register_table(design), design.manifest))
    options = {"bus": 16, "memory": MEMORY, "latency": 20, "stall": 10, "seed": 4, "shared": "ram"}
    (folder / "ram").write_bytes(bytes([UNWRITTEN]) * MEMORY)
    command = [
        build_shell_simulator(design),
        *(text for key, value in options.items() for text in (f"--{key}", str(value))),
    ]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "cwd": folder}
    with subprocess.Popen([*command, "-"], stderr=subprocess.PIPE, **pipes) as device:
        done = subprocess.run(
            [driver, *arguments], stdin=device.stdout, stdout=device.stdin, stderr=subprocess.PIPE, cwd=folder
        )
        assert device.stdin is not None and device.stderr is not None
        device.stdin.close()
        problems = device.stderr.read()
        assert (device.wait(), done.returncode, problems) == (0, 0, b""), done.stderr.decode()
    memory = np.frombuffer((folder / "memory").read_bytes(), dtype=np.uint8).copy()
    return memory, [line.split() for line in done.stderr.decode().splitlines()]
