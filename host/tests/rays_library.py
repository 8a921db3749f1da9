"""The library of rays in C with Embree's calls, compiled."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

from colonnade.rays.library import compile_library

#: Options of a sanitizer, where tools/sanitizers runs the tests; with one g++ warns of what is right.
OPTIONS = os.environ.get("COLONNADE_SANITIZER", "-Wall -Wextra -Werror").split()


def preloaded(*libraries: Path) -> dict[str, str]:
    """Variables of a Python in a process of its own that needs these libraries, and those of a sanitizer, first."""
    names = [*os.environ.get("COLONNADE_SANITIZER_LIBRARIES", "").split(), *map(str, libraries)]
    variables = {name: value for name, value in os.environ.items() if name in ("ASAN_OPTIONS", "TSAN_OPTIONS")}
    return variables | ({"LD_PRELOAD": " ".join(names)} if names else {})


def compiled_library(folder: Path) -> Path:
    """A shared library in a folder, in place of `libembree4`."""
    return compile_library(folder, "-O1", *OPTIONS)


def compiled_program(source: Path, library: Path) -> Path:
    """A program in C that is linked with the library."""
    output = library.parent / source.stem
    options = f"-std=gnu11 -O1 -pthread -Wl,-rpath,{library.parent}".split()
    subprocess.run(["gcc", *options, *OPTIONS, source, library, "-lm", "-ldl", "-o", output], check=True)
    return output
