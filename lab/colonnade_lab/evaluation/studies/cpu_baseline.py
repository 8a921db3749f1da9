"""A frame of the benchmark on a core of this machine: every triangle for every ray in plain C++, and Embree.

The rays are the camera's, one a pixel. The plain program takes every `STEP`-th of each row and column, since all
take minutes.
"""

from __future__ import annotations

import platform
import re
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from colonnade.common import processes
from colonnade.common.errors import UserError
from colonnade.common.progress import QUIET, Progress
from colonnade.common.temporary import temporary_folder
from colonnade.design.toolchain import project_root, require_program
from colonnade.reference.embree import RayTracer
from colonnade.reference.render import primary_directions
from colonnade.scene.object_mesh import object_mesh
from colonnade.scene.object_pose import Placed
from colonnade.scene.parser import load_scene
from colonnade.scene.view import make_view

from colonnade_lab.common import paper
from colonnade_lab.common.markdown import markdown
from colonnade_lab.evaluation.rays import embree_of

#: The frame, and which of its rays the plain program takes.
SIZE, STEP = (640, 480), 8

_PROGRAM = Path(__file__).with_name("cpu_tests.cpp")


@dataclass(frozen=True)
class CpuBaseline:
    """CPU time of one core.

    Attributes:
        processor: Its name.
        triangles: Triangles of the mesh.
        rays: Rays of the frame; `in_box` of them enter the mesh's box.
        in_box: See `rays`.
        tested_rays: Rays of the plain program; `hits` of them hit, `embree_hits` in Embree.
        hits: See `tested_rays`.
        embree_hits: See `tested_rays`.
        nanoseconds: Of a test of the plain program.
        plain_seconds: Of all triangles with all rays of the frame.
        plain_in_box_seconds: The same of rays that enter the box.
        embree_seconds: Of the rays of the frame in Embree, its tree built before.
    """

    processor: str
    triangles: int
    rays: int
    in_box: int
    tested_rays: int
    hits: int
    embree_hits: int
    nanoseconds: float
    plain_seconds: float
    plain_in_box_seconds: float
    embree_seconds: float


def study_mesh(name: str, progress: Progress = QUIET) -> dict[str, CpuBaseline]:
    """The baseline with a mesh, by its name.

    Raises:
        UserError: There is no compiler.
    """
    scene = load_scene(project_root() / "scenes" / "object.toml").with_mesh(name)
    mesh = object_mesh(scene)
    view = make_view(Placed(scene, mesh.extent), *SIZE, mesh.materials)
    directions = primary_directions(view, slice(0, view.height))
    origins = np.broadcast_to(view.origin, directions.shape)
    in_box = int(RayTracer(mesh).enters_box(origins, directions)[0].sum())
    chosen = np.arange(len(directions)).reshape(view.height, view.width)[STEP // 2 :: STEP, STEP // 2 :: STEP].ravel()
    with progress.step("testing all triangles"):
        seconds, hits = _plain(mesh.vertices[mesh.faces], origins[chosen], directions[chosen])
    test = seconds / (len(chosen) * len(mesh.faces))
    embree = embree_of(mesh)
    parts = [np.ascontiguousarray(each, dtype=np.float32) for each in (origins, directions)]
    embree.run(*(part[:1] for part in parts))  # the first call builds the tree
    begin = time.process_time()
    found = embree.run(*parts)
    embree_seconds = time.process_time() - begin
    return {
        name: CpuBaseline(
            processor=_processor(),
            triangles=len(mesh.faces),
            rays=len(directions),
            in_box=in_box,
            tested_rays=len(chosen),
            hits=hits,
            embree_hits=int((found[chosen] >= 0).sum()),
            nanoseconds=1e9 * test,
            plain_seconds=test * len(directions) * len(mesh.faces),
            plain_in_box_seconds=test * in_box * len(mesh.faces),
            embree_seconds=embree_seconds,
        )
    }


def table(reports: dict[str, CpuBaseline]) -> str:
    """The baselines as a Markdown table, by mesh."""
    rows = [
        [
            name,
            found.processor,
            f"{found.nanoseconds:.1f}",
            f"{found.plain_seconds / 60:.1f}",
            f"{found.plain_in_box_seconds / 60:.1f}",
            f"{3600 * paper.LAPTOP_HOURS / found.plain_seconds:,.0f}",
            f"{found.rays / found.embree_seconds / 1e6:.1f}",
            f"{1e3 * found.embree_seconds:.0f}",
        ]
        for name, found in reports.items()
    ]
    plain = ("ns a test", "minutes a frame, all rays", "in-box rays", "the paper's 2.5 hours ÷ all rays")
    return markdown(["mesh", "one core of", *plain, "Embree: MRay/s", "ms a frame"], rows)


def _plain(corners: np.ndarray, origins: np.ndarray, directions: np.ndarray) -> tuple[float, int]:
    """CPU seconds of all tests, and rays that hit."""
    compiler = require_program("g++", "the program that tests all triangles")
    triangles = np.stack([corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=1)
    rays = np.hstack([origins, directions])
    with temporary_folder() as folder:
        program, file = folder / "cpu_tests", folder / "rays"
        file.write_bytes(b"".join(np.ascontiguousarray(each, dtype=np.float64).tobytes() for each in (triangles, rays)))
        built = processes.run([compiler, "-O3", "-march=native", "-std=c++17", _PROGRAM, "-o", program])
        if built.returncode != 0:
            raise UserError(f"g++ cannot compile {_PROGRAM.name}: {built.stderr.strip()[-300:]}")
        done = processes.run([program, file, len(triangles), len(rays)])
        if done.returncode != 0:
            raise RuntimeError(f"{_PROGRAM.name} failed with status {done.returncode}")
    seconds, hits = done.stdout.split()
    return float(seconds), int(hits)


def _processor() -> str:
    """The name of the processor."""
    file = Path("/proc/cpuinfo")
    found = re.search(r"^model name\s*: (.*)$", file.read_text(), re.MULTILINE) if file.is_file() else None
    return found[1].strip() if found else platform.processor() or platform.machine()
