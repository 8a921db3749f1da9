"""The C++ compiler and Verilator: their versions, flags and environment, and a check that their output is right.

Debian 12's g++ 12.2 miscompiles population counts, sums of ``1U == x`` as Verilator writes them, when it vectorises
straight-line code. `SAFE` switches that off, and `require_right_compiler` runs a program with the pattern.
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

#: Part of each compilation of C++ that Verilator or this package wrote.
SAFE = ("-fno-tree-slp-vectorize",)

#: The oldest Verilator with the scheduler that the harness relies on.
MINIMUM_VERILATOR = (5, 6)

#: What programs that build see of the environment: neither flags nor search paths of the user's.
KEPT_VARIABLES = ("PATH", "HOME", "TMPDIR", "LANG", "LC_ALL", "VERILATOR_ROOT", "LD_LIBRARY_PATH")

_CANARY = Path(__file__).parent / "harness" / "canary.cpp"


def clean_environment() -> dict[str, str]:
    """The environment for compilers and make: CXXFLAGS, MAKEFLAGS and their like do not reach them."""
    return {name: os.environ[name] for name in KEPT_VARIABLES if name in os.environ}


@functools.cache
def version_of(program: Path) -> str:
    """The first line that a program answers to ``--version``: a part of the key of all that it builds."""
    try:
        answer = processes.run([program, "--version"], env=clean_environment())
    except OSError as error:
        raise UserError(f"{program} cannot be run: {error.strerror}") from error
    return (answer.stdout + answer.stderr).strip().partition("\n")[0]


def require_verilator(purpose: str) -> tuple[Path, str]:
    """Verilator and its version; refuses one that is too old."""
    program = require_program("verilator", purpose)
    version = version_of(program)
    match = re.match(r"Verilator (\d+)\.(\d+)", version)
    if match is None or (int(match[1]), int(match[2])) < MINIMUM_VERILATOR:
        oldest = f"{MINIMUM_VERILATOR[0]}.{MINIMUM_VERILATOR[1]:03}"
        advice = "use Debian 12, Ubuntu 24.04 or newer, or put a newer Verilator first on PATH"
        raise UserError(f"{program} is '{version[:60]}': {purpose} needs {oldest} or newer; {advice}")
    return program, version


def require_compiler(purpose: str) -> tuple[Path, str]:
    """The C++ compiler and its version, a part of the key of all that is built with it."""
    program = require_program("g++", purpose)
    return program, version_of(program)


def require_right_compiler(compiler: Path, flags: Sequence[str]) -> None:
    """Compile and run the canary with the flags of a simulator; refuse a compiler that gets it wrong.

    Raises:
        UserError: the compiler fails, or its program counts wrongly.
    """
    with temporary_folder() as place:
        program = place / "canary"
        command: list[str | Path] = [compiler, "-std=c++17", *flags, "-o", program, _CANARY]
        built = processes.run(command, cwd=place, env=clean_environment())
        if built.returncode != 0:
            said = (built.stderr.splitlines() or ["no message"])[0]
            raise UserError(f"{compiler} does not compile C++: {said}")
        ran = processes.run([program], cwd=place)
    if ran.returncode != 0:
        raise UserError(
            f"{compiler} ({version_of(compiler)}) miscompiles population counts with {' '.join(flags)}: "
            "simulated hardware would be wrong; use another g++"
        )
