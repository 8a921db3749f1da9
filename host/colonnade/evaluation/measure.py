"""Measures the counters of RTL frames, in parallel and with a cache."""

from __future__ import annotations

import hashlib
import json
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from colonnade.common import cache
from colonnade.common.errors import UserError
from colonnade.common.parallel import in_order
from colonnade.common.progress import QUIET, Progress
from colonnade.design.frame_limits import check_size
from colonnade.design.generator import GeneratedDesign, design_for
from colonnade.design.toolchain import cache_directory, project_root
from colonnade.device.bit_exact import loaded_model, model_frame
from colonnade.device.simulator_build import build_simulator
from colonnade.device.verilator import render_rtl
from colonnade.mesh.load import load_mesh
from colonnade.mesh.mesh import Mesh
from colonnade.registers.frame import frame_registers
from colonnade.render.frames import require_no_errors
from colonnade.render.report import frame_report, mesh_report
from colonnade.scene.model import Scene
from colonnade.scene.parser import load_scene
from colonnade.scene.view import with_overrides
from colonnade.scene_image.file import SceneImage
from colonnade.scene_image.packer import pack

#: Serialises builds, since each uses all processors.
_BUILD_LOCK = threading.Lock()


@dataclass(frozen=True)
class Run:
    """One frame to render.

    Attributes:
        config: Configuration, before `overrides`.
        overrides: Changes to the configuration, ``key.path=value``.
        mesh: Name or file.
        mirror: Replace the scene's material by a mirror with one reflection.
    """

    config: str
    overrides: tuple[str, ...]
    mesh: str
    mirror: bool = False

    @property
    def title(self) -> str:
        """The title of its progress."""
        return " ".join((self.mesh, *("mirror" for _ in range(self.mirror)), *self.overrides))

    def scene(self, scene: Scene) -> Scene:
        """The benchmark scene with this run's mesh and material."""
        scene = scene.with_mesh(self.mesh)
        if not self.mirror:
            return scene
        return replace(scene, material=replace(scene.material, kind="mirror"), paths=replace(scene.paths, bounces=1))


@dataclass(frozen=True)
class Conditions:
    """The common settings of all runs of a measurement.

    Attributes:
        scene: The benchmark scene; each run replaces its mesh.
        size: Width and height, pixels; None: those of the scene.
        jobs: Number of frames in parallel.
        reuse: Use the cached report of an earlier run with the same hardware and scene image.
    """

    scene: Path
    size: tuple[int, int] | None = None
    jobs: int = 1
    reuse: bool = False


def measure(runs: Sequence[Run], conditions: Conditions, progress: Progress = QUIET) -> Iterator[dict[str, Any]]:
    """Reports of the runs in order: `frame_report` with ``cycles_per_second`` and ``seconds``.

    All meshes are loaded before the first frame.
    """
    scene = load_scene(conditions.scene)
    meshes: dict[str, Mesh] = {}
    with progress.step("loading the meshes"):
        for name in dict.fromkeys(run.mesh for run in runs):
            meshes[name] = load_mesh(scene.with_mesh(name).mesh_source)

    def prepare(run: Run) -> _Prepared:
        return _prepared(
            run,
            run.scene(scene),
            meshes[run.mesh],
            conditions.size,
            reuse=conditions.reuse,
            is_estimated=conditions.jobs > 1,
            progress=progress.of(run.title),
        )

    def render(frame: _Prepared) -> dict[str, Any]:
        return frame.cached or _measured(frame, progress.of(frame.run.title))

    prepared = list(in_order(prepare, runs, conditions.jobs))
    return in_order(render, prepared, conditions.jobs, length=lambda frame: frame.work)


@dataclass(frozen=True)
class _Prepared:
    """A frame that is ready to render.

    Attributes:
        run: The run.
        design, image, registers: The inputs of the simulation.
        key: Cache key of the measurement.
        cache_file: Cache file of the measurement.
        cached: The report of an earlier run; None if there is none or it must not be used.
        work: Estimate of the simulation time: record visits of a small frame in the model.
        seconds: Seconds of packing.
    """

    run: Run
    design: GeneratedDesign
    image: SceneImage
    registers: dict[str, int]
    key: dict[str, Any]
    cache_file: Path
    cached: dict[str, Any] | None
    work: int
    seconds: float


def measure_frame(
    config: str,
    overrides: Sequence[str],
    scene: Scene,
    mesh: Mesh,
    size: tuple[int, int],
    progress: Progress = QUIET,
    *,
    reuse: bool = True,
) -> dict[str, Any]:
    """The report of one frame, see `measure`. The scene's own mesh is not read."""
    run = Run(config, tuple(overrides), mesh.name)
    frame = _prepared(run, scene, mesh, size, reuse=reuse, is_estimated=False, progress=progress)
    return frame.cached or _measured(frame, progress)


def _prepared(
    run: Run,
    scene: Scene,
    mesh: Mesh,
    size: tuple[int, int] | None,
    *,
    reuse: bool,
    is_estimated: bool,
    progress: Progress,
) -> _Prepared:
    with _BUILD_LOCK:
        design = design_for(run.config, run.overrides, progress)
    manifest = design.manifest
    width, height = size or (scene.frame.width, scene.frame.height)
    check_size((width, height), manifest)
    begun = time.perf_counter()
    try:
        with progress.step("packing the scene"):
            image = pack(mesh, manifest, with_overrides(mesh.materials, scene.material))
            registers = frame_registers(scene, image.header, manifest, width, height)
    except UserError as error:
        raise UserError(": ".join((*run.overrides, str(error)))) from error
    seconds = time.perf_counter() - begun
    key = _key(design, image, registers)
    name = hashlib.sha256(json.dumps(key, sort_keys=True).encode()).hexdigest()[:24]
    cache_file = cache_directory(project_root()) / "measurements" / f"{name}.json"
    cached = cache.stored(cache_file, key, progress) if reuse else None
    work = 0
    if cached is not None:
        cached |= {
            "config": manifest.config,
            "config_hash": manifest.config_hash,
            "mesh": asdict(mesh_report(image.header)),
        }
    elif is_estimated:
        small = frame_registers(scene, image.header, manifest, max(1, width // 8), max(1, height // 8))
        counters = model_frame(loaded_model(manifest, image), small).counters
        work = counters["nodeReads"] + counters["triangleTests"]
    return _Prepared(run, design, image, registers, key, cache_file, cached, work, seconds)


def _measured(frame: _Prepared, progress: Progress) -> dict[str, Any]:
    design, image = frame.design, frame.image
    with _BUILD_LOCK:
        build_simulator(design, progress)
    begun = time.perf_counter()
    simulated = render_rtl(design, image, [frame.registers], progress=progress)
    run_seconds = time.perf_counter() - begun
    rendered = simulated.frames[0]
    require_no_errors(rendered)
    report = {
        **frame_report("rtl", design.manifest, image.header, rendered).as_json(),
        "config_hash": design.manifest.config_hash,
        "cycles_per_second": simulated.cycles_per_second,
        "seconds": {"pack": frame.seconds, "run": run_seconds},
    }
    cache.store(frame.cache_file, frame.key, report, progress)
    return report


def _key(design: GeneratedDesign, image: SceneImage, registers: Mapping[str, int]) -> dict[str, Any]:
    """The cache key: all inputs that determine a frame's counters."""
    digest = hashlib.sha256()
    for words in (image.records, *(section.words for section in image.attributes)):
        digest.update(f"{words.shape} {words.dtype}\n".encode() + words.tobytes())
    plain = {name: int(value) for name, value in registers.items()}
    return {"design": design.digest(), "image": digest.hexdigest(), "registers": plain}
