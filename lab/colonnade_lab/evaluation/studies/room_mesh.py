"""A room as a mesh in the tree beside its march: what a mirror ray reads of either, and how many find the right point.

The rays are of mirror spheres (`probe_spheres`). The mesh is the depth map's (`depth_mesh`), packed for
`CONFIG`, whose caches read DRAM; the march reads the maps on chip.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from colonnade.common.progress import QUIET, Progress
from colonnade.common.types import Floats
from colonnade.design.generator import manifest_for
from colonnade.mesh.load import clean_mesh
from colonnade.rays import Scene
from colonnade.reference.environment.depth_mesh import DepthMesh, triangles_of
from colonnade.scene_image.packer import memory_use, pack
from numpy.typing import NDArray

from colonnade_lab.common.markdown import markdown
from colonnade_lab.evaluation.studies.environment_accuracy import NEAR_METRES, compare
from colonnade_lab.evaluation.studies.probe_spheres import mirror_rays, standing_spheres

if TYPE_CHECKING:
    from colonnade.environment.model import Environment

#: The device for rays that traces the mesh, and one in how many rays its RTL traces.
CONFIG, EVERY = "traversal", 4


@dataclass(frozen=True)
class RoomMesh:
    """A room as a mesh, and its march.

    Attributes:
        triangles: Triangles of the mesh.
        mesh_bytes: Of the packed mesh: nodes and triangles.
        rays: Mirror rays.
        node_reads, triangle_tests: Of a ray in the tree.
        dram_bytes: That the caches read for a ray, in an order in which near rays follow each other.
        mesh_right, march_right: Shares of the rays that hit the mesh in float, within `NEAR_METRES` of that point, or
            for the march also within its pixels.
        cycles: Of the device for a ray, by its RTL; None if it was not run.
        plane_bytes: Of the encoded planes, which a march reads.
        march_steps: Of a ray.
    """

    triangles: int
    mesh_bytes: int
    rays: int
    node_reads: float
    triangle_tests: float
    dram_bytes: float
    mesh_right: float
    march_right: float
    cycles: float | None
    plane_bytes: int
    march_steps: float


def study_rooms(folders: Iterable[Path], rtl: bool = False, progress: Progress = QUIET) -> dict[str, RoomMesh]:
    """The rooms of folders, by name; with `rtl` also cycles."""
    from colonnade.environment.load import load_environment

    return {room.name: study(room, rtl, progress) for room in map(load_environment, folders)}


def study(environment: Environment, rtl: bool = False, progress: Progress = QUIET) -> RoomMesh:
    """Trace the mirror rays of a room through its mesh and its march."""
    from colonnade.maps.cache import encoded_environment
    from colonnade.maps.layout import AttributeLayout

    from colonnade_lab.evaluation.environment_march import DeviceMarch

    layout = AttributeLayout(width=environment.width, height=environment.height)
    image = encoded_environment(environment, layout)
    manifest = manifest_for("small", (f"physicalAttributeMemory={json.dumps(layout.to_config())}",)).manifest
    march, truth = DeviceMarch(environment, image, manifest), DepthMesh(environment)
    found = [compare(environment, truth, march, mirror_rays(centre)) for centre in standing_spheres(environment)]
    known = np.concatenate([~each.truth.outside for each in found])
    points = np.concatenate([each.truth.position for each in found])[known]
    origins, directions = (
        np.concatenate([getattr(each.rays, name) for each in found]) for name in ("origins", "directions")
    )
    ends = np.zeros((len(origins), 1))
    rays = np.hstack([origins, ends, directions, ends + np.inf]).astype(np.float32).astype(np.float64)

    mesh = triangles_of(environment)
    with progress.step("packing the room"):
        scene = Scene(mesh.vertices, mesh.faces, CONFIG, refine=False)
        rays = rays[order := scene.order(rays)]
    hits = scene.closest(rays)
    counters = scene.counters()
    at = np.full((len(rays), 3), np.nan)
    at[order] = rays[:, :3] + np.where(hits.face >= 0, hits.t, np.nan)[:, None] * rays[:, 4:7]
    with np.errstate(invalid="ignore"):
        right = np.linalg.norm(at[known] - points, axis=1) <= NEAR_METRES
    return RoomMesh(
        triangles=len(mesh.faces),
        mesh_bytes=_packed_bytes(mesh.vertices, mesh.faces),
        rays=len(rays),
        node_reads=counters["nodeReads"] / len(rays),
        triangle_tests=counters["triangleTests"] / len(rays),
        dram_bytes=scene.traffic(rays).bytes / len(rays),
        mesh_right=float(right.mean()),
        march_right=float(np.concatenate([each.ok for each in found])[known].mean()),
        cycles=_cycles(mesh.vertices, mesh.faces, rays[::EVERY], progress) if rtl else None,
        plane_bytes=layout.plane_bytes,
        march_steps=float(np.concatenate([each.marched.steps for each in found]).mean()),
    )


def table(reports: dict[str, RoomMesh]) -> str:
    """The rooms as a Markdown table."""
    rows = [
        [
            name,
            f"{found.triangles:,}",
            f"{found.mesh_bytes / 1e6:.1f} MB, {found.plane_bytes / 1e3:.1f} KB",
            f"{found.node_reads:.1f}, {found.triangle_tests:.1f}",
            f"{found.march_steps:.1f}",
            f"{found.dram_bytes:,.0f}, 0",
            f"{100 * found.mesh_right:.1f}, {100 * found.march_right:.1f}",
            "–" if found.cycles is None else f"{found.cycles:.2f}",
        ]
        for name, found in reports.items()
    ]
    reads = ("a ray in the tree: nodes, triangles", "steps of a march", "DRAM, bytes a ray: tree, march")
    right = ("right, %: tree, march", "cycles a ray: tree")
    return markdown(["room", "triangles", "tree, planes of the march", *reads, *right], rows)


def _packed_bytes(vertices: Floats, faces: NDArray[np.int32]) -> int:
    """Bytes of the records of a mesh."""
    manifest = manifest_for(CONFIG).manifest
    image = pack(clean_mesh(vertices, faces, "room"), manifest)
    return int(memory_use(image.header, manifest)["columnBvhMemory"]["bytes"])


def _cycles(vertices: Floats, faces: NDArray[np.int32], rays: Floats, progress: Progress) -> float:
    """Cycles of the device for a ray, by its RTL; its caches are empty at first."""
    from colonnade.rays.device import RayDevice

    device = RayDevice(CONFIG, progress=progress)
    scene = Scene(vertices, faces, CONFIG, refine=False, backend=device)
    with progress.step("tracing by the RTL"):
        scene.closest(rays)
    return device.counters()["cycles"] / len(rays)
