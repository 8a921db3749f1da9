"""vcglib's sample for Embree, linked with the library of rays in place of Embree, on the bunny."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path

from colonnade.mesh.load import load_mesh
from colonnade.rays.library import compile_library
from ray_suites.embree import configure

#: Lines that its parts print at their ends: ambient occlusion, with directions, thickness, normals, visible faces.
PARTS = ("Done AO", "Done AO Directioned", "Done SDF", "Done NormalAnlysis", "done face selection")
DIRECTIONS = 64


def build(run: Callable[..., str], checkout: Path, embree: Path, folder: Path) -> Path:
    """The sample, with the bunny beside it; `embree` is a checkout with the headers."""
    configure(run, embree, folder / "embree")
    mesh = load_mesh("bunny")
    with (folder / "bunny.off").open("w") as file:
        file.write(f"OFF\n{len(mesh.vertices)} {len(mesh.faces)} 0\n")
        file.writelines(f"{x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in mesh.vertices)
        file.writelines(f"3 {a} {b} {c}\n" for a, b, c in mesh.faces)
    library, program = compile_library(folder), folder / "embree_sample"
    includes = [f"-I{each}" for each in (checkout, checkout / "eigenlib", embree / "include")]
    source = checkout / "apps" / "embree" / "embree_sample.cpp"
    options = ["-std=c++17", "-O1", "-w", "-fopenmp", *includes]
    run("g++", *options, source, library, f"-Wl,-rpath,{folder}", "-o", program, cwd=folder)
    return program


def verify(program: Path, variables: Mapping[str, str]) -> dict[str, tuple[int, int]]:
    """Parts of the sample that end, and all."""
    done = subprocess.run(
        [program, "bunny.off", str(DIRECTIONS)],
        env=os.environ | variables,
        cwd=program.parent,
        text=True,
        capture_output=True,
    )
    return {"embree_sample": (sum(part in done.stdout.splitlines() for part in PARTS), len(PARTS))}
