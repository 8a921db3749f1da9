"""The workload of a device for rays of applications: a batch of a kind."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from colonnade.common.errors import UserError
from colonnade.common.progress import Progress
from colonnade.design.generator import GeneratedDesign
from colonnade.design.manifest import Manifest
from colonnade.mesh.materials.mesh import Mesh
from colonnade.rays import Scene
from colonnade.rays.device import RayDevice

from colonnade_lab.evaluation.ray_bench import batches_of
from colonnade_lab.ppa.netlist.hierarchy import LEVELS, RAY_LEVELS, TRIANGLES
from colonnade_lab.ppa.power.recording import Recording
from colonnade_lab.ppa.power.window import Window, window_of
from colonnade_lab.ppa.power.workload import OneColumn, Workload


@dataclass(frozen=True)
class BatchWorkload(Workload):
    """A batch, the first one of a device.

    Attributes:
        mesh: The mesh.
        kind: One of `colonnade_lab.evaluation.ray_bench.KINDS`.
        rays: Number of rays, whole runs.
        cycles: Maximum number of recorded cycles; the batch must end within them.
    """

    modules: ClassVar[tuple[str, ...]] = (LEVELS[0].top, "RayQueries", "RayBus", "ResultBus", TRIANGLES)
    outer: ClassVar[str] = RAY_LEVELS[1].top

    mesh: Mesh
    kind: str
    rays: int
    cycles: int

    def check(self, manifest: Manifest) -> None:
        """See `Workload`."""
        if not manifest.has_queries:
            raise UserError("the design answers no batches of rays: choose one with queries, such as traversal")

    def run(self, column: OneColumn, recorded: GeneratedDesign, folder: Path, progress: Progress) -> Mapping[str, Any]:
        """See `Workload`."""
        device = RayDevice(column.config, column.overrides, (), progress, recorded, folder)
        mesh = self.mesh
        scene = Scene(mesh.vertices, mesh.faces, column.config, column.overrides, backend=device)
        run, count = batches_of(mesh, scene, self.rays)[self.kind]
        with progress.step(f"recording a batch: {self.kind}"):
            run(scene)
            device.close()
        return {"mesh": mesh.name, "triangles": len(mesh.faces), "kind": self.kind, "rays": count}

    def window(self, recordings: Mapping[str, Recording]) -> Window:
        """From the first run of rays to the end of the last one.

        Raises:
            UserError: The batch has not ended, or no in-box ray is traced.
        """
        queries = recordings["RayQueries"]
        begins, resolved = queries.fires("io_runs"), queries.of("io_resolved")
        if not sum(begins) or sum(begins) != sum(resolved):
            raise UserError("the recorded batch has not ended: use more --cycles, or fewer --rays")
        begin = begins.index(True)
        end = max(cycle for cycle, runs in enumerate(resolved) if runs) + 1
        hits = zip(queries.of("io_results_valid"), queries.of("io_results_bits_hasHit"), strict=True)
        counts = {
            "rays": sum(count for count, does in zip(queries.of("io_runs_bits_count"), begins, strict=True) if does),
            "rays_in_box": sum(queries.fires("io_rays")[begin:end]),
            "hits": sum(bool(is_result and has_hit) for is_result, has_hit in hits),
        }
        return window_of(recordings, begin, end, counts)
