"""The C++ compiler and Verilator: versions, flags, environment, and a check for a known miscompilation.

Debian 12's g++ 12.2 miscompiles Verilator's population counts, sums of ``1U == x``, when it vectorises straight-line
code. `SAFE` disables that optimisation, and `require_right_compiler` compiles and runs the pattern.
"""

from __future__ import annotations

import functools
import os
import re
from collections.abc import Sequence
from pathlib import Path

from colonnade.common import processes
from colonnade.common.errors import UserError
from colonnade.common.temporary import temporary_folder
from colonnade.design.toolchain import require_program

#: Compiler flags for all C++ code of Verilator and of this package.
SAFE = ("-fno-tree-slp-vectorize",)

#: The oldest Verilator with the scheduler that the harness relies on.
MINIMUM_VERILATOR = (5, 6)

#: Environment variables that build programs inherit. Flags and search paths of the user are not among them.
INHERITED_VARIABLES = ("PATH", "HOME", "TMPDIR", "LANG", "LC_ALL", "VERILATOR_ROOT", "LD_LIBRARY_PATH")

_CANARY = Path(__file__).parent / "harness" / "canary.cpp"


def clean_environment() -> dict[str, str]:
    """The environment of compilers and make, without CXXFLAGS, MAKEFLAGS and the like."""
    return {name: os.environ[name] for name in INHERITED_VARIABLES if name in os.environ}


@functools.cache
def version_of(program: Path) -> str:
    """The first line that a program prints for ``--version``."""
    try:
        done = processes.run([program, "--version"], env=clean_environment())
    except OSError as error:
        raise UserError(f"{program} cannot be run: {error.strerror}") from error
    return (done.stdout + done.stderr).strip().partition("\n")[0]


def require_verilator(purpose: str) -> tuple[Path, str]:
    """The path and version of Verilator.

    Raises:
        UserError: Verilator is missing or too old.
    """
    program = require_program("verilator", purpose)
    version = version_of(program)
    match = re.match(r"Verilator (\d+)\.(\d+)", version)
    if match is None or (int(match[1]), int(match[2])) < MINIMUM_VERILATOR:
        oldest = f"{MINIMUM_VERILATOR[0]}.{MINIMUM_VERILATOR[1]:03}"
        advice = "use Debian 12, Ubuntu 24.04 or newer, or put a newer Verilator first on PATH"
        raise UserError(f"{program} is '{version[:60]}': {purpose} needs Verilator {oldest} or newer; {advice}")
    return program, version


def require_compiler(purpose: str) -> tuple[Path, str]:
    """The path and version of the C++ compiler."""
    program = require_program("g++", purpose)
    return program, version_of(program)


def require_right_compiler(compiler: Path, flags: Sequence[str]) -> None:
    """Compile canary.cpp with the flags of a simulator, and run it.

    Raises:
        UserError: The compiler fails, or the program counts wrongly.
    """
    with temporary_folder() as folder:
        program = folder / "canary"
        command: list[str | Path] = [compiler, "-std=c++17", *flags, "-o", program, _CANARY]
        built = processes.run(command, cwd=folder, env=clean_environment())
        if built.returncode != 0:
            message = (built.stderr.splitlines() or ["no message"])[0]
            raise UserError(f"{compiler} does not compile C++: {message}")
        ran = processes.run([program], cwd=folder)
    if ran.returncode != 0:
        raise UserError(
            f"{compiler} ({version_of(compiler)}) miscompiles population counts with {' '.join(flags)}: "
            "the simulator would be wrong; use another g++"
        )
