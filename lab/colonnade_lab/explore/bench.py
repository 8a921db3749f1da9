"""The benchmark: rays per cycle of eight meshes in the RTL, by the same jobs as in a study."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from colonnade.common.errors import UserError
from colonnade.common.progress import QUIET, Progress
from colonnade.design.frame_limits import check_size
from colonnade.design.toolchain import project_root
from colonnade.scene.model import Scene
from colonnade.scene.object_mesh import object_mesh
from colonnade.scene.parser import load_scene

from colonnade_lab.evaluation.bench import design_result
from colonnade_lab.explore.frames import cycles_job, design_of, frame_of, run_in_order

#: Called after each mesh with its name and its report.
Finished = Callable[[str, Mapping[str, Any]], None]


def bench(
    config: str,
    overrides: Sequence[str],
    meshes: Sequence[str],
    size: tuple[int, int] | None,
    parallel: int,
    progress: Progress = QUIET,
    finished: Finished = lambda name, result: None,
    *,
    reuse: bool = False,
    mirror: bool = False,
    dram: Mapping[str, int] | None = None,
) -> dict[str, Any]:
    """Render each mesh once and collect its figures. All meshes are loaded before the first frame.

    Args:
        config: Configuration, before `overrides`.
        overrides: Changes to the configuration, ``key.path=value``.
        meshes: Names or files.
        size: Width and height, pixels; None: the benchmark scene's.
        parallel: Number of frames in parallel.
        progress: Shows the steps.
        finished: Called after each mesh, in order.
        reuse: Use the cached result of an earlier run.
        mirror: Render the meshes as mirrors with one reflection.
        dram: Fields of `colonnade.device.verilator.Stalls` about DRAM.

    Returns:
        The report that `colonnade bench --json` writes.

    Raises:
        UserError: `dram` for a configuration that reads no DRAM.
    """
    scene = load_scene(project_root() / "scenes" / "object.toml")
    size = size or (scene.frame.width, scene.frame.height)
    names = list(dict.fromkeys(meshes))
    with progress.step("loading the meshes"):
        loaded = [replace(object_mesh(scene.with_mesh(name), corner_colours=True), name=name) for name in names]
    design, manifest = design_of(config, overrides, progress)
    check_size(size, manifest)
    if dram and manifest.config["columnBvhMemory"]["cache"] is None:
        option = next(iter(dram)).replace("_", "-")
        raise UserError(f"this configuration reads no DRAM: --{option} needs columnBvhMemory.cache")
    jobs = []
    for name, mesh in zip(names, loaded, strict=True):
        own = scene.with_mesh(name)
        frame = frame_of(name, _as_mirror(own) if mirror else own, mesh, name)
        title = f"cycles of {name}{' as a mirror' * mirror}"
        jobs.append(cycles_job(title, design, manifest, frame, size, reuse=reuse, dram=dram))
    results = run_in_order(
        jobs,
        parallel,
        progress,
        fresh=not reuse,
        finished=lambda position, result: finished(names[position], result),
    )
    return design_result(manifest.config, manifest.config_hash, size, dict(zip(names, results, strict=True)))


def _as_mirror(scene: Scene) -> Scene:
    """The scene with a mirror for its material, and one reflection."""
    return replace(scene, material=replace(scene.material, kind="mirror"), paths=replace(scene.paths, bounces=1))
