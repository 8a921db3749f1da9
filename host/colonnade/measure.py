"""Frames through the RTL for the sake of their counters: some at a time, and none twice where that is wanted."""

from __future__ import annotations

import hashlib
import json
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from colonnade import cache
from colonnade.errors import UserError
from colonnade.generator import GeneratedDesign, design_for
from colonnade.image import SceneImage
from colonnade.meshes import Mesh, load_mesh
from colonnade.pack import pack
from colonnade.parallel import in_order
from colonnade.placement import placement
from colonnade.progress import QUIET, Progress
from colonnade.render import frame_report, mesh_report, require_no_errors
from colonnade.scene import Scene, load_scene
from colonnade.simulate import render_rtl
from colonnade.simulator_build import build_simulator
from colonnade.sizes import check_size
from colonnade.toolchain import cache_directory, project_root
from colonnade.viewpoint import made_of

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

    def one(run: Run) -> dict[str, Any]:
        return _measured(run, scene, meshes[run.mesh], conditions, progress.of(run.title))

    return in_order(one, runs, conditions.jobs)


def _measured(run: Run, scene: Scene, mesh: Mesh, conditions: Conditions, progress: Progress) -> dict[str, Any]:
    scene = run.scene(scene)
    with _BUILDING:
        design = design_for(run.config, run.overrides, progress)
    width, height = conditions.size or (scene.frame.width, scene.frame.height)
    check_size((width, height), design.manifest)
    begun = time.perf_counter()
    try:
        with progress.step("packing the scene"):
            image = pack(mesh, design.manifest, made_of(mesh.materials, scene.material))
            registers = placement(scene, image.header, design.manifest, width, height)
    except UserError as error:
        raise UserError(": ".join((*run.overrides, str(error)))) from error
    seconds = {"pack": time.perf_counter() - begun}
    key = _key(design, image, registers)
    name = hashlib.sha256(json.dumps(key, sort_keys=True).encode()).hexdigest()[:24]
    kept = cache_directory(project_root()) / "measurements" / f"{name}.json"
    if conditions.reuse and (known := cache.stored(kept, key, progress)) is not None:
        return known | {
            "config": design.manifest.config,
            "config_hash": design.manifest.config_hash,
            "mesh": mesh_report(image.header),
        }
    with _BUILDING:
        build_simulator(design, progress)
    begun = time.perf_counter()
    simulated = render_rtl(design, image, [registers], progress=progress)
    seconds["run"] = time.perf_counter() - begun
    frame = simulated.frames[0]
    require_no_errors(frame)
    report = {
        **frame_report("rtl", design.manifest, image.header, frame),
        "config_hash": design.manifest.config_hash,
        "cycles_per_second": simulated.cycles_per_second,
        "seconds": seconds,
    }
    cache.store(kept, key, report, progress)
    return report


def _key(design: GeneratedDesign, image: SceneImage, registers: Mapping[str, int]) -> dict[str, Any]:
    """All that a frame's counters follow from."""
    digest = hashlib.sha256()
    for words in (image.records, *(section.words for section in image.attributes)):
        digest.update(f"{words.shape} {words.dtype}\n".encode() + words.tobytes())
    plain = {name: int(value) for name, value in registers.items()}
    return {"design": design.digest(), "image": digest.hexdigest(), "registers": plain}
