"""The library for rays in C with Embree's calls, compiled on this machine (docs/rays.md)."""

from __future__ import annotations

import platform
from pathlib import Path

from colonnade.common import processes
from colonnade.common.errors import UserError
from colonnade.design.toolchain import project_root, require_program

#: The library's name: programs for Embree 4 are linked with it.
NAME = "libembree4.so.4"
#: As in host/CMakeLists.txt for the same sources.
_OPTIONS = "-std=gnu++17 -O3 -DNDEBUG -Wno-psabi -ffp-contract=off -fPIC -shared -pthread".split()
_OPTIONS += ["-msse4.1"] * (platform.machine() in ("x86_64", "AMD64"))


def compile_library(folder: Path, *options: str) -> Path:
    """Compile the library into a folder, with a link for linkers; the library.

    Args:
        folder: The folder; it is made.
        options: Further options of the compiler.

    Raises:
        UserError: There is no g++, or it fails.
    """
    compiler, root, output = require_program("g++", "the library for rays"), project_root(), folder.resolve() / NAME
    sources = [root / "host/cpp/rays" / name for name in ("rays.cpp", "embree.cpp", "simulated.cpp")]
    includes = [f"-I{root / 'host/cpp'}", f"-I{root / 'driver/include'}"]
    folder.mkdir(parents=True, exist_ok=True)
    command = [compiler, *_OPTIONS, *options, *includes, *sources, f"-Wl,-soname,{NAME}", "-o", output]
    done = processes.run(command)
    if done.returncode:
        raise UserError(f"the library for rays does not compile: {(done.stderr or done.stdout).strip()[-500:]}")
    link = output.with_suffix("")
    link.unlink(missing_ok=True)
    link.symlink_to(NAME)
    return output
