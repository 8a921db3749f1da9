"""Programs of driver/tests that print a hash on this machine and on an RV32IM."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from c_programs import DRIVER, DRIVER_FOLDER, RISCV, WARNINGS

MACHINE = ["-march=rv32im", "-mabi=ilp32", "-ffreestanding", "-nostdlib"]
QEMU = "qemu-riscv32"
NEEDS_QEMU = pytest.mark.skipif(shutil.which(QEMU) is None, reason=f"no {QEMU}: apt-get install qemu-user")


def build(compiler: str, folder: Path, name: str, test: str, *options: str) -> Path:
    """Compile a program of driver/tests, with the driver and the headers in a folder, into it."""
    program = folder / name
    sources = [DRIVER_FOLDER / "tests" / f"{test}.c", *DRIVER]
    includes = [f"-I{DRIVER_FOLDER / 'include'}", f"-I{folder}"]
    libraries = ["-lgcc"] if compiler == RISCV else []
    command = [compiler, *WARNINGS, *includes, *options, *map(str, sources), *libraries, "-o", str(program)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return program


def hash_of(*command: str | Path) -> str:
    """What a program prints."""
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert re.fullmatch(r"[0-9a-f]{8}\n", done.stdout)
    return done.stdout.strip()


def executed(program: Path, folder: Path) -> Iterator[str]:
    """The function of each instruction that an RV32IM executes."""
    log = folder / f"{program.name}.log"
    step = "-one-insn-per-tb" if "one-insn-per-tb" in subprocess.getoutput(f"{QEMU} -h") else "-singlestep"
    hash_of(QEMU, step, "-d", "exec,nochain", "-D", log, program)
    return (line.split()[-1] for line in log.read_text().splitlines() if line.startswith("Trace"))
