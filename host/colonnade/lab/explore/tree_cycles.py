"""Gain of the BVH in cycles: simplified meshes in the RTL, with and without a BVH.

Without a BVH each ray tests every triangle, and full meshes would take days. So meshes are simplified by quadrics.

``python -m colonnade.lab.explore.tree_cycles CONFIG SIZE COUNT,COUNT,… FILE`` writes the figures.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from colonnade.common.atomic_files import replacing, write_json
from colonnade.common.frame_size import parse_size
from colonnade.common.progress import for_terminal
from colonnade.design.toolchain import cache_directory, project_root
from colonnade.lab.common.parallel import processors
from colonnade.lab.evaluation.bench import MESHES, geometric_mean
from colonnade.lab.explore.frames import cycles_job, design_of, frame_of, run_in_order
from colonnade.mesh.load import load_mesh
from colonnade.mesh.mesh import Mesh
from colonnade.scene.parser import load_scene

Array = npt.NDArray[Any]

#: Seven meshes, as in the paper. The eighth is a subdivided small mesh.
REDUCED = tuple(name for name in MESHES if name != "duck")

#: Speed-up by the paper's BVH.
PAPER_GAIN = 6.3

NO_TREE = "geometry.bvh=false"


def reduced(mesh: Mesh, maximum: int) -> tuple[Array, Array]:
    """Simplify a mesh by vertex clustering (Rossignac and Borrel 1993), on the finest grid.

    At most `maximum` faces are left.

    A library's edge collapse (fast-simplification, by quadrics) does not serve: it keeps every component, and the 875
    components of the dragon leave 5,143 faces.

    Returns:
        Vertices [n, 3] and faces [m, 3].
    """
    least = mesh.vertices.min(axis=0)
    edge = float((mesh.vertices.max(axis=0) - least).max())
    finest: tuple[Array, Array] | None = None
    # The number of faces grows with the grid, if not strictly
    low, high = 1, 1024
    while low < high - 1:
        cells = (low + high) // 2
        vertices, faces = _clustered(mesh, np.floor((mesh.vertices - least) / edge * cells).astype(np.int64))
        if 0 < len(faces) <= maximum:
            low, finest = cells, (vertices, faces)
        else:
            low, high = (low, cells) if len(faces) else (cells, high)
    if finest is None:
        raise RuntimeError(f"{mesh.name} cannot be simplified to {maximum} triangles")
    return finest


def _clustered(mesh: Mesh, cells: Array) -> tuple[Array, Array]:
    """Replace the vertices of each cell by their mean; drop faces without area, and duplicates."""
    _, index, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    index = index.reshape(-1)
    sums = np.zeros((len(counts), 3))
    np.add.at(sums, index, mesh.vertices)
    faces = index[mesh.faces]
    corners = np.sort(faces, axis=1)
    is_flat = (corners[:, 0] == corners[:, 1]) | (corners[:, 1] == corners[:, 2])
    _, first = np.unique(corners, axis=0, return_index=True)
    kept = np.intersect1d(first, np.flatnonzero(~is_flat))
    return sums / counts[:, None], faces[kept]


def tree_gain(config: str, counts: Sequence[int], size: tuple[int, int]) -> dict[str, Any]:
    """Cycles of each mesh with and without a BVH, and their ratio, for each maximum number of triangles in `counts`."""
    folder = cache_directory(project_root()) / "reduced"
    folder.mkdir(parents=True, exist_ok=True)
    progress = for_terminal()
    with progress.step("simplifying the meshes"):
        files = {(maximum, name): _written(load_mesh(name), maximum, folder) for maximum in counts for name in REDUCED}
    scene = load_scene(project_root() / "scenes" / "object.toml")
    frames = [
        frame_of(file.stem, scene.with_mesh(str(file)), load_mesh(str(file)), str(file)) for file in files.values()
    ]
    jobs = []
    # Those without a BVH take longer, and come first
    for overrides in ((NO_TREE,), ()):
        design, manifest = design_of(config, overrides, progress)
        for frame in frames:
            title = " ".join(("cycles of", frame.name, *overrides))
            jobs.append(cycles_job(title, design, manifest, frame, size))
    results = run_in_order(jobs, processors(), progress)
    reductions: dict[str, dict[str, Any]] = {str(maximum): {} for maximum in counts}
    for (maximum, name), none, tree in zip(files, results, results[len(files) :], strict=False):
        reductions[str(maximum)][name] = {
            "triangles": tree["triangles"],
            "rays_in_box": tree["rays"]["in_box"],
            "cycles": {"tree": tree["cycles"], "none": none["cycles"]},
            "gain": none["cycles"] / tree["cycles"],
        }
    return {
        "config": manifest.config,
        "size": list(size),
        "reductions": {
            maximum: {"meshes": meshes, "geomean_gain": geometric_mean(mesh["gain"] for mesh in meshes.values())}
            for maximum, meshes in reductions.items()
        },
        "paper_gain": PAPER_GAIN,
    }


def _written(mesh: Mesh, maximum: int, folder: Path) -> Path:
    """Write a simplified mesh, and return its file."""
    vertices, faces = reduced(mesh, maximum)
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in faces + 1]
    file = folder / f"{mesh.name}-{maximum}.obj"
    with replacing(file) as stream:
        stream.write(("\n".join(lines) + "\n").encode())
    return file


if __name__ == "__main__":
    wanted = [int(count) for count in sys.argv[3].split(",")]
    write_json(Path(sys.argv[4]), tree_gain(sys.argv[1], wanted, parse_size(sys.argv[2])))
