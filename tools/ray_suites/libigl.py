"""libigl's own tests of its class for Embree, linked with the library of rays in place of Embree."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path

from colonnade.common.errors import UserError
from colonnade.rays.library import compile_library

#: Test files, and the names with which their tests begin.
TESTS = ("EmbreeIntersector", "winding_number_antipodal")
#: Headers of Debian's libeigen3-dev, and of catch2, which are in the compiler's folders.
EIGEN = Path("/usr/include/eigen3")


def build(run: Callable[..., str], checkouts: Mapping[str, Path], folder: Path) -> Path:
    """The program of the tests; `checkouts` has libigl, its data, and Embree with the headers."""
    if not EIGEN.is_dir():
        raise UserError("no Eigen found, which libigl needs; run: sudo apt-get install libeigen3-dev catch2")
    folder.mkdir(parents=True, exist_ok=True)
    library = compile_library(folder)
    tests, program = checkouts["libigl"] / "tests", folder / "tests"
    includes = [tests, checkouts["libigl"] / "include", checkouts["embree"] / "include", EIGEN]
    flags = ["-std=c++17", "-O1", "-DNDEBUG", f'-DLIBIGL_DATA_DIR="{checkouts["libigl-tests-data"]}"']
    flags += [f"-I{each}" for each in includes]
    sources = [tests / "main.cpp", *(tests / "include" / "igl" / "embree" / f"{name}.cpp" for name in TESTS)]
    objects = [folder / f"{source.stem}.o" for source in sources]
    for source, output in zip(sources, objects, strict=True):
        run("g++", *flags, "-c", source, "-o", output, cwd=folder)
    run("g++", *objects, library, f"-Wl,-rpath,{folder}", "-o", program, cwd=folder)
    return program


def verify(program: Path, variables: Mapping[str, str]) -> dict[str, tuple[int, int]]:
    """Test cases that pass, and all, by name; `variables` are the program's environment."""
    found = {}
    for name in TESTS:
        done = subprocess.run([program, f"{name}*", "-r", "xml"], env=variables, text=True, capture_output=True)
        counts = re.search(r'<OverallResultsCases successes="(\d+)" failures="(\d+)"', done.stdout)
        if counts is None:
            raise UserError(f"libigl's tests did not finish {name}: {(done.stderr or done.stdout).strip()[-500:]}")
        found[name] = int(counts[1]), int(counts[1]) + int(counts[2])
    return found
