"""Embree's own tests of triangles, `embree_verify`, linked with the library of rays in place of Embree."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path

from colonnade.common.errors import UserError
from colonnade.rays.library import compile_library

#: Names of tests, as regular expressions with SCENE for a scene's flags, and how often each repeats its rays: of all
#: scenes, and of one.
TESTS = {
    r"buffer_stride\.triangles": (1, 1),
    r"empty_scene\..*": (1, 1),
    r"get_bounds\.triangles": (1, 1),
    r"get_linear_bounds\.triangles": (1, 1),
    r"inactive_rays\.SCENE\..*": (0.1, 0.1),
    r"intersection_filter\.triangles\.SCENE\..*": (1, 1),
    r"multiple_devices": (1, 1),
    r"ray_alignment_test\.SCENE\..*sphere\.triangles": (0.1, 0.1),
    r"triangle_hit\.SCENE\..*": (1, 0.02),
    r"triangle_split_epsilon\..*": (1, 1),
    r"watertight_triangles\.SCENE\..*": (1, 0.2),
}
#: All flags, and the flags of one kind of scene: the library reads none. These expressions have no brackets.
ALL_SCENES, ONE_SCENE = ".*", "StaticRobust"
#: Parts of Embree that the tests use beside its calls.
PARTS = ("sys", "math", "simd", "lexers", "tasking", "image", "alloc_tutorial", "scenegraph", "embree_verify")
OPTIONS = {
    "CMAKE_BUILD_TYPE": "Release",
    "CMAKE_EXE_LINKER_FLAGS": "-Wl,--unresolved-symbols=ignore-all",
    "EMBREE_ISPC_SUPPORT": "OFF",
    "EMBREE_MAX_ISA": "SSE2",
    "EMBREE_TASKING_SYSTEM": "INTERNAL",
    "EMBREE_TUTORIALS": "ON",
    "EMBREE_TUTORIALS_GLFW": "OFF",
}


def configure(run: Callable[..., str], checkout: Path, folder: Path) -> None:
    """Make the files of a build, and a header among the checkout's."""
    folder.mkdir(parents=True, exist_ok=True)
    run("cmake", "-S", checkout, "-B", folder, *(f"-D{name}={value}" for name, value in OPTIONS.items()), cwd=checkout)


def build(run: Callable[..., str], checkout: Path, folder: Path) -> Path:
    """The program `embree_verify`."""
    configure(run, checkout, folder)
    compile_library(folder)
    for part in PARTS:
        run("make", "-j2", f"{part}/fast", cwd=folder)
    return folder / "embree_verify"


def verify(scenes: str, program: Path, variables: Mapping[str, str]) -> dict[str, tuple[int, int]]:
    """Tests of `scenes` that pass, and all, by name; `variables` are the program's environment."""
    found = {}
    for pattern, intensities in TESTS.items():
        name = pattern.replace("SCENE", "").replace(".*", "").replace("\\", "")
        name = re.sub(r"\.+", ".", name).rstrip(".")
        options = ["--no-colors", "--sequential", "--flatten", "--intensity", str(intensities[scenes == ONE_SCENE])]
        options += ["--run", rf"SSE2\.{pattern.replace('SCENE', scenes)}"]
        done = subprocess.run(
            [program, *options],
            env=variables,
            cwd=program.parent,
            text=True,
            capture_output=True,
        )
        counts = [int(count) for count in re.findall(r"Tests (?:passed|failed): *(\d+)", done.stdout)]
        if len(counts) != 2 or not sum(counts):
            raise UserError(f"embree_verify did not finish {name}: {(done.stderr or done.stdout).strip()[-500:]}")
        found[name] = counts[0], sum(counts)
        print(f"embree_verify {name}: {counts[0]} of {sum(counts)} pass", flush=True)
    return found
