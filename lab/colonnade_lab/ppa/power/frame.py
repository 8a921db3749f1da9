"""The workload of a device that renders: a frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from colonnade.common import processes
from colonnade.common.errors import UserError
from colonnade.common.progress import Progress
from colonnade.design.frame_limits import check_size
from colonnade.design.generator import GeneratedDesign
from colonnade.design.manifest import Manifest
from colonnade.design.toolchain import project_root
from colonnade.device.simulator_build import build_simulator
from colonnade.device.simulator_sources import TRACER
from colonnade.device.verilator import write_job
from colonnade.mesh.materials.mesh import Mesh
from colonnade.scene.model import Scene
from colonnade.scene.object_mesh import object_mesh
from colonnade.scene.parser import load_scene
from colonnade.scene.prepared.device_scene import DeviceScene

from colonnade_lab.ppa.netlist.hierarchy import LEVELS, TRIANGLES
from colonnade_lab.ppa.power.recording import Recording
from colonnade_lab.ppa.power.window import Window, window_of
from colonnade_lab.ppa.power.workload import OneColumn, Workload

#: Ports that count positions, pixels, shadow rays and hits, of the module that follows paths, and in-box rays.
_POSITIONS, _PIXELS, _SHADOW, _HITS = "io_positions", "io_pixels", "io_events_raysShadow", "io_events_hits"
_COLUMN_RAYS = "io_rays"

#: Modules of a column that follow the paths of its traversal units.
PATH_MODULES = ("PathUnit", "PathHits", "RayBus", "ResultBus")


@dataclass(frozen=True)
class FrameWorkload(Workload):
    """A frame, and how much of it is recorded.

    Attributes:
        scene: The scene; its mesh is not read.
        mesh: The mesh.
        size: Width and height, pixels; None: `whole_frame`.
        cycles: Maximum number of recorded cycles from the start of the frame.
    """

    modules: ClassVar[tuple[str, ...]] = (LEVELS[0].top, *PATH_MODULES, TRIANGLES)
    outer: ClassVar[str] = TRACER

    scene: Scene
    mesh: Mesh
    size: tuple[int, int] | None
    cycles: int

    @staticmethod
    def of_benchmark(mesh: str, size: tuple[int, int] | None, cycles: int) -> FrameWorkload:
        """The benchmark scene with a mesh, a name or a file."""
        scene = load_scene(project_root() / "scenes" / "object.toml").with_mesh(mesh)
        return FrameWorkload(scene, object_mesh(scene, corner_colours=True), size, cycles)

    def size_of(self, manifest: Manifest) -> tuple[int, int]:
        """Width and height of its frame, pixels."""
        return self.size or whole_frame(int(manifest.config["array"]["rows"]))

    def check(self, manifest: Manifest) -> None:
        """See `Workload`."""
        check_size(self.size_of(manifest), manifest)

    def run(self, column: OneColumn, recorded: GeneratedDesign, folder: Path, progress: Progress) -> Mapping[str, Any]:
        """See `Workload`."""
        manifest = column.design.manifest
        size = self.size_of(manifest)
        with progress.step("packing the scene"):
            prepared = DeviceScene.of(self.scene, manifest, self.mesh)
            registers = prepared.registers(size)
        program = build_simulator(recorded, progress)
        job, _ = write_job(folder, manifest, prepared.image, [registers])
        with progress.step("recording a frame"):
            done = processes.run([program, job], cwd=folder)
        if done.returncode != 0:
            raise RuntimeError(f"the simulated hardware failed (status {done.returncode}): {done.stderr[-300:]}")
        return {"mesh": self.mesh.name, "triangles": len(self.mesh.faces), "size": list(size)}

    def window(self, recordings: Mapping[str, Recording]) -> Window:
        """From the first input position to the last output pixel.

        Raises:
            UserError: No pixel has left, or no in-box ray is traced.
        """
        paths = recordings["PathUnit"]
        positions, pixels = paths.fires(_POSITIONS), paths.fires(_PIXELS)
        if True not in positions or True not in pixels:
            raise UserError("the recorded frame has no pixel: use more --cycles, or a larger --size")
        begin, end = positions.index(True), len(pixels) - pixels[::-1].index(True)
        counts = {
            "pixels": sum(pixels[begin:end]),
            "rays": sum(positions[begin:end]) + sum(paths.of(_SHADOW)[begin:end]),
            "rays_in_box": sum(recordings["PathHits"].fires(_COLUMN_RAYS)[begin:end]),
            "hits": sum(paths.of(_HITS)[begin:end]),
        }
        return window_of(recordings, begin, end, counts)


def whole_frame(rows: int) -> tuple[int, int]:
    """A frame size at which each traversal unit of a column with `rows` units works for about ten thousand cycles."""
    width = 4 * round(6 * rows**0.5)
    return width, width * 3 // 4
