"""Makes the wheels: the host, compiled by zig for one processor, with all that a checkout has for its users.

A wheel serves all Pythons from 3.10 on. It holds the module three times: for 3.10, for 3.11, and for the stable ABI of
3.12, which all later ones load; the binding library can do with no older stable ABI.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import archives
import nanobind

ROOT = Path(__file__).resolve().parents[2]
#: The oldest C library; numpy's wheels need no older one.
_GLIBC = "2.28"
#: Prints the folder of an interpreter's headers, and Debian's name of the processor.
_ABOUT = "import sysconfig as s; print(s.get_path('include'), s.get_config_var('MULTIARCH') or '-', sep='\\n')"


@dataclass(frozen=True)
class Target:
    """A processor by its names for wheels and for firtool; there is no firtool for Linux on aarch64."""

    processor: str
    firtool: str


TARGETS = (Target("x86_64", "linux-x64"), Target("aarch64", "linux-aarch64"))


def build(target: Target, jar: Path, pythons: list[str], work: Path, output: Path) -> Path:
    """Build the wheel of a processor into ``output``.

    Args:
        target: The processor.
        jar: The generator.
        pythons: Programs of Python 3.10, 3.11, and 3.12 or newer, with their headers.
        work: A folder for what the build needs.
        output: The folder for the wheel.
    """
    files = work / "files"
    gather(files / "data", target, jar)
    toolchain = _toolchain(target, work)
    for python in pythons:
        shutil.copy(_compile(target, python, toolchain, work / Path(python).name), files)
    settings = {
        "cmake.define.COLONNADE_FILES": str(files),
        "wheel.py-api": "cp310",
        "build-dir": str(work / "build"),
    }
    program = (
        "import json, sys, scikit_build_core.build as build;"
        "print(build.build_wheel(sys.argv[1], json.loads(sys.argv[2])))"
    )
    tag = f"manylinux_{_GLIBC.replace('.', '_')}_{target.processor}"
    command = [sys.executable, "-c", program, str(output), json.dumps(settings)]
    _run(command, work / "wheel.log", cwd=ROOT / "host", env={**os.environ, "_PYTHON_HOST_PLATFORM": tag})
    return output / (work / "wheel.log").read_text().split()[-1]


def _compile(target: Target, python: str, toolchain: Path, work: Path) -> Path:
    """Compile the module for a Python; returns the file."""
    work.mkdir()
    about = subprocess.run([python, "-c", _ABOUT], capture_output=True, text=True, check=True).stdout.split("\n")
    include = _copy_headers(Path(about[0]), about[1], work / "include")
    minor = Path(python).name.removeprefix("python3.")
    defines = {
        "CMAKE_BUILD_TYPE": "Release",
        "CMAKE_TOOLCHAIN_FILE": str(toolchain),
        "nanobind_DIR": nanobind.cmake_dir(),
        "Python_EXECUTABLE": python,
        "Python_INCLUDE_DIR": str(include),
        "SKBUILD_SOABI": f"cpython-3{minor}-{target.processor}-linux-gnu",
    }
    if int(minor) >= 12:
        defines |= {"SKBUILD_SABI_COMPONENT": "Development.SABIModule", "SKBUILD_SOSABI": "abi3"}
    build, programs = work / "build", Path(sys.executable).parent
    options = [f"-D{name}={value}" for name, value in defines.items()]
    path = f"{programs}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path}
    command = [str(programs / "cmake"), "-G", "Ninja", "-S", str(ROOT / "host"), "-B", str(build), *options]
    _run(command, work / "cmake.log", env=environment)
    _run([str(programs / "cmake"), "--build", str(build)], work / "compile.log", env=environment)
    (module,) = build.glob("_core.*.so")
    return module


def _run(command: list[str], log: Path, cwd: Path | None = None, env: dict[str, str] | None = None) -> None:
    with log.open("w") as stream:
        done = subprocess.run(command, cwd=cwd, env=env, stdout=stream, stderr=stream, check=False)
    if done.returncode != 0:
        sys.exit(f"colonnade: error: a wheel does not build; {log} ends:\n{log.read_text()[-2000:]}")


def gather(data: Path, target: Target, jar: Path) -> None:
    """What ``colonnade.design.toolchain.RELEASE`` is in the wheel."""
    for folder in ("configs", "scenes", "manifests", "site", "tools"):
        (data / folder).mkdir(parents=True)
    for preset in sorted((ROOT / "configs").glob("*.json")):
        shutil.copy(preset, data / "configs")
        (data / "manifests" / preset.stem).mkdir()
        shutil.copy(ROOT / "configs" / "golden" / preset.name, data / "manifests" / preset.stem / "manifest.json")
    for scene in sorted((ROOT / "scenes").glob("*.toml")):
        shutil.copy(scene, data / "scenes")
    shutil.copytree(ROOT / "scenes" / "rooms", data / "scenes" / "rooms")
    # The page of `colonnade view`
    for name in ("live.html", "live.js", "orbit.js", "style.css"):
        shutil.copy(ROOT / "site" / name, data / "site")
    shutil.copy(ROOT / "tools" / "verilated-object", data / "tools")
    # The library for rays, which `colonnade rays --library` compiles
    cpp = ROOT / "host" / "cpp"
    folders = [cpp / name for name in ("mesh", "model", "packer", "rays")]
    sources = [*cpp.glob("*.hpp"), *(file for folder in folders for file in folder.glob("*.[ch]pp"))]
    for source in (*sources, ROOT / "driver" / "include" / "colonnade_rays.h"):
        target_file = data / source.relative_to(ROOT)
        target_file.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(source, target_file)
    shutil.copy(ROOT / ".jvmopts", data)
    shutil.copy(ROOT / "LICENSE", data)
    archives.copy_jar(jar, data / jar.name, target.firtool)


def _copy_headers(source: Path, multiarch: str, include: Path) -> Path:
    """Copy Python's headers; Debian's pyconfig.h includes one for the target.

    This machine's serves both processors, whose types have the same sizes.
    """
    shutil.copytree(source, include)
    beside = source.parent / multiarch / source.name / "pyconfig.h"
    if beside.is_file():
        shutil.copy(beside, include / "pyconfig.h")
    return include


def _toolchain(target: Target, work: Path) -> Path:
    """A toolchain file of CMake. This machine's processor is a target like any other: wheels are not its compiler's."""
    lines = ["set(CMAKE_SYSTEM_NAME Linux)", f"set(CMAKE_SYSTEM_PROCESSOR {target.processor})"]
    lines.append('set(CMAKE_CXX_FLAGS_INIT "-include stdio.h")')  # nanobind 3.1 forgets it, with zig's library
    for language, compiler in (("C", "cc"), ("CXX", "c++")):
        program = work / f"zig-{compiler}"
        triple = f"{target.processor}-linux-gnu.{_GLIBC}"
        program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m ziglang {compiler} -target {triple} "$@"\n')
        program.chmod(0o755)
        lines.append(f'set(CMAKE_{language}_COMPILER "{program}")')
    file = work / "toolchain.cmake"
    file.write_text("\n".join(lines) + "\n")
    return file
