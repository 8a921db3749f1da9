"""Programs in C with the driver, compiled under the sanitizers."""

from __future__ import annotations

import atexit
import functools
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest

from colonnade.design import toolchain

DRIVER_FOLDER = toolchain.project_root() / "driver"
DRIVER = sorted((DRIVER_FOLDER / "src").glob("*.c"))
WARNINGS = "-std=c11 -Wall -Wextra -Wconversion -Wsign-conversion -Wshadow -Werror -pedantic".split()
SANITIZERS = "-g -fsanitize=address,undefined -fno-sanitize-recover=all".split()
RISCV = "riscv64-unknown-elf-gcc"
NEEDS_RISCV = pytest.mark.skipif(
    shutil.which(RISCV) is None, reason=f"no {RISCV}: apt-get install gcc-riscv64-unknown-elf"
)


def scratch() -> Path:
    """A folder until the end of the tests."""
    folder = Path(tempfile.mkdtemp(prefix="colonnade-driver-"))
    atexit.register(shutil.rmtree, folder)
    return folder


def compile_c(sources: list[Path], program: Path, *options: str) -> Path:
    includes = [f"-I{DRIVER_FOLDER / 'include'}", f"-I{program.parent}"]
    command = ["gcc", "-O1", *WARNINGS, *SANITIZERS, *includes, *map(str, sources), *options, "-o", str(program)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return program


@functools.cache
def driver_objects() -> list[Path]:
    """The driver, compiled once."""
    folder = scratch()
    return [compile_c([source], folder / f"{source.stem}.o", "-c") for source in DRIVER]


def compile_test(*names: str, options: tuple[str, ...] = ()) -> Path:
    """Files of driver/tests, with the driver."""
    sources = [DRIVER_FOLDER / "tests" / f"{name}.c" for name in names]
    return compile_c([*sources, *driver_objects()], scratch() / names[0], *options)
