"""Embree's calls: CPU time a ray of the library for rays in C, and of Embree."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from colonnade.common.errors import UserError
from colonnade.common.temporary import temporary_folder
from colonnade.design.toolchain import require_program
from colonnade.mesh.materials.mesh import Mesh
from colonnade.rays import Scene
from colonnade.rays.library import compile_library

from colonnade_lab.evaluation.rays import KINDS, embree_of, rays_of_kind

_PROGRAM = Path(__file__).with_suffix(".c")


@dataclass(frozen=True)
class CallTimes:
    """CPU microseconds a ray of a kind; Embree's are None without embreex.

    Attributes:
        kind: One of `KINDS`.
        one: `rtcIntersect1` or `rtcOccluded1` of the library.
        sixteen: `rtcIntersect16` or `rtcOccluded16`.
        batch: All rays in one call of `Scene`.
        embree_one: `rtcIntersect1` or `rtcOccluded1` of Embree.
        embree_sixteen: `rtcIntersect16` or `rtcOccluded16`.
        embree_batch: All rays in one call of embreex.
    """

    kind: str
    one: float
    sixteen: float
    batch: float
    embree_one: float | None
    embree_sixteen: float | None
    embree_batch: float | None


def measured(mesh: Mesh, count: int) -> Iterator[CallTimes]:
    """Times of each kind: one program for Embree's calls, with the library and with Embree in turn.

    Raises:
        UserError: There is no compiler, or the program fails.
    """
    scene, embree, other = Scene(mesh.vertices, mesh.faces), embree_of(mesh), _embree_library()
    with temporary_folder("colonnade-rays-") as folder:
        library, program = compile_library(folder, "-march=native"), folder / "ray_calls"
        compiler = require_program("gcc", "the program for Embree's calls")
        command: list[object] = [compiler, "-O2", _PROGRAM, library, f"-Wl,-rpath,{folder}", "-lm", "-o", program]
        subprocess.run(list(map(str, command)), check=True)
        for kind in KINDS:
            rays, is_occlusion = rays_of_kind(kind, mesh, count), kind == "occlusion"
            if not kind.endswith("shuffled"):
                rays = rays[scene.order(rays)]
            arrays = mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32), rays.astype(np.float32)
            (folder / "rays").write_bytes(b"".join(array.tobytes() for array in arrays))
            words = [program, folder / "rays", *map(len, arrays), "occluded" if is_occlusion else "closest"]
            one, sixteen = _times(words, None)
            embree_one, embree_sixteen = _times(words, other) if other else (None, None)
            parts = arrays[2][:, :3].copy(), arrays[2][:, 4:7].copy()
            call = scene.occluded if is_occlusion else scene.closest
            query = "OCCLUDED" if is_occlusion else "INTERSECT"
            yield CallTimes(
                kind,
                one,
                sixteen,
                _cpu(lambda: call(rays)) / count,  # noqa: B023
                embree_one,
                embree_sixteen,
                _cpu(lambda: embree.run(*parts, query=query)) / count if embree else None,  # noqa: B023
            )


def _times(words: list[Any], preloaded: Path | None) -> tuple[float, float]:
    """Microseconds a ray of single rays and of packets."""
    variables = os.environ | ({"LD_PRELOAD": str(preloaded)} if preloaded else {})
    done = subprocess.run(list(map(str, words)), env=variables, capture_output=True, text=True)
    if done.returncode:
        raise UserError(f"the program for Embree's calls failed: {done.stderr.strip()[-500:]}")
    one, sixteen = (float(line.split()[0]) / 1000 for line in done.stdout.splitlines())
    return one, sixteen


def _cpu(call: Callable[[], object]) -> float:
    """Microseconds of all threads; the least of three calls after a first one."""
    call()
    times = []
    for _ in range(3):
        begin = time.process_time()
        call()
        times.append(time.process_time() - begin)
    return 1e6 * min(times)


def _embree_library() -> Path | None:
    """Embree's own library, which embreex has."""
    found = importlib.util.find_spec("embreex")
    if found is None or found.origin is None:
        return None
    return next(iter(Path(found.origin).parents[1].glob("embreex.libs/libembree4*")), None)
