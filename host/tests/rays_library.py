"""The library of rays in C with Embree's calls, compiled."""

from __future__ import annotations

import subprocess
from pathlib import Path

from colonnade.design.toolchain import project_root


def compiled_library(folder: Path) -> Path:
    """A shared library in a folder, in place of `libembree4`."""
    root, output = project_root(), folder / "libembree4.so.4"
    flags = "-std=gnu++17 -O1 -ffp-contract=off -fPIC -shared -pthread -Wall -Wextra -Werror".split()
    sources = [root / "host/cpp/rays" / name for name in ("rays.cpp", "embree.cpp", "simulated.cpp")]
    command = ["g++", *flags, f"-I{root / 'host/cpp'}", f"-I{root / 'driver/include'}", *sources, "-o", output]
    subprocess.run(command, check=True)
    return output
