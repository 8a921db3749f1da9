"""The library of rays in C with Embree's calls, compiled."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

from colonnade.rays.library import compile_library

#: Options of a sanitizer, where tools/sanitizers runs the tests; with one g++ warns of what is right.
OPTIONS = os.environ.get("COLONNADE_SANITIZER", "-Wall -Wextra -Werror").split()


def compiled_library(folder: Path) -> Path:
    """A shared library in a folder, in place of `libembree4`."""
    return compile_library(folder, "-O1", *OPTIONS)


def compiled_program(source: Path, library: Path) -> Path:
    """A program in C that is linked with the library."""
    output = library.parent / source.stem
    options = f"-std=gnu11 -O1 -pthread -Wl,-rpath,{library.parent}".split()
    subprocess.run(["gcc", *options, *OPTIONS, source, library, "-lm", "-ldl", "-o", output], check=True)
    return output
