"""Frames through the RTL for the sake of their counters: some at a time, and none twice where that is wanted."""

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

#: A build takes all processors by itself.
_BUILDING = threading.Lock()


@dataclass(frozen=True)
class Run:
    """One frame to render.

    Attributes:
        config: name of the configuration, with `overrides` applied.
        overrides: ``key.path=value`` changes.
        mesh: name or file.
        mirror: its surface is a mirror, whose reflections are traced once, in place of the scene's material.
    """

    config: str
    overrides: tuple[str, ...]
    mesh: str
    mirror: bool = False

    @property
    def title(self) -> str:
        """For progress."""
        return " ".join((self.mesh, *("mirror" for _ in range(self.mirror)), *self.overrides))

    def scene(self, scene: Scene) -> Scene:
        """The benchmark's scene with this mesh and its surface."""
        scene = scene.with_mesh(self.mesh)
        if not self.mirror:
            return scene
        return replace(scene, material=replace(scene.material, kind="mirror"), paths=replace(scene.paths, bounces=1))


@dataclass(frozen=True)
class Conditions:
    """What the runs of one measurement have in common.

    Attributes:
        scene: the benchmark's scene; its mesh is replaced.
        size: width and height in pixels; the scene's unless given.
        jobs: frames at a time.
        reuse: take the report of a run of the same hardware and the same scene image, where one was kept.
    """

    scene: Path
    size: tuple[int, int] | None = None
    jobs: int = 1
    reuse: bool = False


def measure(runs: Sequence[Run], conditions: Conditions, progress: Progress = QUIET) -> Iterator[dict[str, Any]]:
    """Reports of the runs, in their order: those of `frame_report`, with ``cycles_per_second`` and ``seconds``.

    All meshes are loaded before the first frame is rendered.
    """
    scene = load_scene(conditions.scene)
    meshes: dict[str, Mesh] = {}
    with progress.step("loading the meshes"):
        for name in dict.fromkeys(run.mesh for run in runs):
            meshes[name] = load_mesh(scene.with_mesh(name).mesh_source)

    def prepare(run: Run) -> _Prepared:
        return _prepared(run, scene, meshes[run.mesh], conditions, progress.of(run.title))

    def one(frame: _Prepared) -> dict[str, Any]:
        return frame.known or _measured(frame, progress.of(frame.run.title))

    prepared = list(in_order(prepare, runs, conditions.jobs))
    return in_order(one, prepared, conditions.jobs, length=lambda frame: frame.visits)


@dataclass(frozen=True)
class _Prepared:
    """A frame that is ready to be rendered.

    Attributes:
        run: what it belongs to.
        design, image, registers: what it is rendered with.
        key, kept: of its measurement in the cache.
        known: the report of an earlier run, if there is one and it may be used.
        visits: records that its rays visit, by the model of a small frame: the time it takes goes with them.
        seconds: that packing took.
    """

    run: Run
    design: GeneratedDesign
    image: SceneImage
    registers: dict[str, int]
    key: dict[str, Any]
    kept: Path
    known: dict[str, Any] | None
    visits: int
    seconds: float


def _prepared(run: Run, scene: Scene, mesh: Mesh, conditions: Conditions, progress: Progress) -> _Prepared:
    scene = run.scene(scene)
    with _BUILDING:
        design = design_for(run.config, run.overrides, progress)
    manifest = design.manifest
    width, height = conditions.size or (scene.frame.width, scene.frame.height)
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
    kept = cache_directory(project_root()) / "measurements" / f"{name}.json"
    known = cache.stored(kept, key, progress) if conditions.reuse else None
    visits = 0
    if known is not None:
        known |= {
            "config": manifest.config,
            "config_hash": manifest.config_hash,
            "mesh": asdict(mesh_report(image.header)),
        }
    elif conditions.jobs > 1:
        small = frame_registers(scene, image.header, manifest, max(1, width // 8), max(1, height // 8))
        counters = model_frame(loaded_model(manifest, image), small).counters
        visits = counters["nodeReads"] + counters["triangleTests"]
    return _Prepared(run, design, image, registers, key, kept, known, visits, seconds)


def _measured(frame: _Prepared, progress: Progress) -> dict[str, Any]:
    design, image = frame.design, frame.image
    with _BUILDING:
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
    cache.store(frame.kept, frame.key, report, progress)
    return report


def _key(design: GeneratedDesign, image: SceneImage, registers: Mapping[str, int]) -> dict[str, Any]:
    """All that a frame's counters follow from."""
    digest = hashlib.sha256()
    for words in (image.records, *(section.words for section in image.attributes)):
        digest.update(f"{words.shape} {words.dtype}\n".encode() + words.tobytes())
    plain = {name: int(value) for name, value in registers.items()}
    return {"design": design.digest(), "image": digest.hexdigest(), "registers": plain}
