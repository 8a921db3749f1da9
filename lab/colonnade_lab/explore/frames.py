"""Frames of a workload, and the jobs that count their cycles. `explore` and `bench` share the results of these jobs."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from colonnade.common.errors import UserError
from colonnade.common.progress import QUIET, Progress
from colonnade.design.config_name import find_configuration
from colonnade.design.generator import manifest_for
from colonnade.design.manifest import Manifest
from colonnade.design.toolchain import project_root
from colonnade.mesh.materials.mesh import Mesh
from colonnade.scene.model import Scene
from pydantic import TypeAdapter

from colonnade_lab.explore.jobs import KINDS, Job, JobFailed, cached, forget
from colonnade_lab.explore.result import figures_of
from colonnade_lab.explore.runners import LocalRunner
from colonnade_lab.explore.schedule import Outcome, Schedule

_SCENE = TypeAdapter(Scene)


@dataclass(frozen=True)
class Frame:
    """A frame of the workload.

    Attributes:
        name: Its name in tables: of the mesh, or of the scene, or of both where both vary.
        scene: The scene with the mesh's name.
        mesh: The mesh.
        source: The mesh as the study names it; None: the scene's.
        identity: What determines the frame but the configuration.
    """

    name: str
    scene: Scene
    mesh: Mesh
    source: str | None
    identity: Mapping[str, Any]

    def with_children(self, children: Literal[2, 4]) -> Frame:
        """The frame with so many children of a node at most."""
        if children == self.scene.mesh.children:
            return self
        scene = replace(self.scene, mesh=replace(self.scene.mesh, children=children))
        return replace(self, scene=scene, identity={**self.identity, "children": children})


def frame_of(name: str, scene: Scene, mesh: Mesh, source: str | None) -> Frame:
    """The frame of a scene with a mesh. Its identity is the content of mesh and room, and the scene without paths."""
    paths: dict[str, Any] = {"mesh": True, "background": {"room": True}, "objects": {"__all__": {"mesh"}}}
    plain = _SCENE.dump_python(scene, mode="json", exclude=paths)
    digest = hashlib.sha256()
    arrays = (mesh.vertices, mesh.faces, mesh.corner_normals, mesh.face_materials, mesh.source_faces)
    of_corners = tuple(array for array in (mesh.corner_colours, mesh.corner_uvs) if array is not None)
    for array in arrays + of_corners:
        digest.update(f"{array.shape} {array.dtype}\n".encode() + array.tobytes())
    for texture in mesh.textures:
        digest.update(f"{texture.wrap} {texture.pixels.shape}\n".encode() + texture.pixels.tobytes())
    digest.update(repr((mesh.materials, mesh.source_count)).encode())
    room = None
    if scene.background.room is not None:
        room = {
            path.name: hashlib.sha256(path.read_bytes()).hexdigest()
            for path in sorted(scene.background.room.iterdir())
            if path.is_file()
        }
    identity = {"scene": json.loads(json.dumps(plain)), "mesh": digest.hexdigest(), "room": room}
    return Frame(name, scene, mesh, source, identity)


def design_of(config: str, overrides: Sequence[str], progress: Progress = QUIET) -> tuple[dict[str, Any], Manifest]:
    """The arguments of jobs on a configuration, and its manifest.

    Args:
        config: Configuration, before `overrides`.
        overrides: Changes to the configuration, ``key.path=value``.
        progress: Shows the steps.
    """
    manifest = manifest_for(config, overrides, progress).manifest
    source = find_configuration(config, overrides, project_root())
    return {"config": source.path.read_text(), "overrides": source.overrides}, manifest


def cycles_job(
    title: str,
    design: Mapping[str, Any],
    manifest: Manifest,
    frame: Frame,
    size: tuple[int, int],
    *,
    reuse: bool = True,
    dram: Mapping[str, int] | None = None,
) -> Job:
    """The job that renders a frame with the RTL and counts its cycles.

    Args:
        title: Its title.
        design: ``config``, the text of the configuration, and ``overrides``.
        manifest: The manifest of the design.
        frame: The frame.
        size: Width and height, pixels.
        reuse: Use the cached counters of the same Verilog and scene image.
        dram: Fields of `colonnade.device.verilator.Stalls` about the DRAM of designs with a cache.
    """
    memory = dict(dram or {})
    identity = {"config": manifest.config, "frame": frame.identity, "size": size, "dram": memory}
    arguments = {"scene": frame.scene, "mesh": frame.mesh, "size": size, "reuse": reuse, "dram": memory}
    return Job(KINDS["cycles"], title, identity, {**design, **arguments})


def counted_job(title: str, design: Mapping[str, Any], manifest: Manifest, frame: Frame, size: tuple[int, int]) -> Job:
    """The job that counts the cycles of a frame with the cycle model; arguments as of `cycles_job`."""
    identity = {"config": manifest.config, "frame": frame.identity, "size": size}
    return Job(KINDS["counted"], title, identity, {**design, "scene": frame.scene, "mesh": frame.mesh, "size": size})


def run_in_order(
    jobs: Sequence[Job],
    parallel: int,
    progress: Progress = QUIET,
    *,
    fresh: bool = False,
    finished: Callable[[int, Mapping[str, Any]], None] = lambda position, figures: None,
) -> list[dict[str, Any]]:
    """Run jobs on this machine.

    Args:
        jobs: The jobs.
        parallel: Jobs to run at a time.
        progress: Shows the steps.
        fresh: Drop the cached results first.
        finished: Called after each job, in order, with its position and figures.

    Returns:
        The figures of each job.

    Raises:
        UserError: A job failed; the others are ended.
    """
    runner = LocalRunner(parallel)
    schedule = Schedule(runner, progress, "measuring")
    figures: list[dict[str, Any]] = []

    def one_finished(_: Job, outcome: Outcome) -> None:
        if isinstance(outcome, JobFailed):
            raise UserError(str(outcome))
        while len(figures) < len(jobs):
            first = schedule.outcomes.get(jobs[len(figures)].key)
            if not isinstance(first, Path):
                return
            figures.append(figures_of(first))
            with progress.paused():
                finished(len(figures) - 1, figures[-1])

    try:
        for job in jobs if fresh else ():
            forget(job)
        missing = next((reason for job in jobs if cached(job) is None and (reason := runner.missing(job))), None)
        if missing is not None:
            raise UserError(missing)
        schedule.run(jobs, one_finished)
    finally:
        runner.close()
    return figures
