"""The library of rays in C with Embree's calls, compiled."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

from colonnade.rays.library import compile_library

#: Options of a sanitizer, where tools/sanitizers runs the tests.
SANITIZER = os.environ.get("COLONNADE_SANITIZER", "").split()


def compiled_library(folder: Path) -> Path:
    """A shared library in a folder, in place of `libembree4`."""
    return compile_library(folder, "-O1", "-Wall", "-Wextra", "-Werror", *SANITIZER)


def compiled_program(source: Path, library: Path) -> Path:
    """A program in C that is linked with the library."""
    output = library.parent / source.stem
    options = f"-std=gnu11 -O1 -Wall -Wextra -Werror -pthread -Wl,-rpath,{library.parent}".split()
    subprocess.run(["gcc", *options, *SANITIZER, source, library, "-lm", "-ldl", "-o", output], check=True)
    return output
