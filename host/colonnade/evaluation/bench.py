"""Rays per cycle of the benchmark's meshes through the RTL, and what holds each of them back."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from colonnade.common.progress import QUIET, Progress
from colonnade.evaluation.measure import Conditions, Run, measure
from colonnade.evaluation.throughput import figures

#: The eight meshes of the benchmark.
MESHES = ("teapot", "fandisk", "cheburashka", "rocker-arm", "bunny", "armadillo", "dragon", "duck")

#: What the 10x8 chip of the paper reaches: 41.6 MRay/s at 200 MHz.
PAPER_RAYS_PER_CYCLE = 0.208

#: Name, report of the mesh: called after each mesh.
Finished = Callable[[str, Mapping[str, Any]], None]


def bench(
    config: str,
    overrides: Sequence[str],
    meshes: Sequence[str],
    conditions: Conditions,
    progress: Progress = QUIET,
    finished: Finished = lambda name, result: None,
    mirror: bool = False,
) -> dict[str, Any]:
    """Render every mesh once and gather the figures.

    Args:
        config: name of the configuration, with `overrides` applied.
        overrides: ``key.path=value`` changes.
        meshes: names or files.
        conditions: scene, size, and how many at a time.
        progress: shows the steps.
        finished: called with each mesh's name and figures as they come, in order.
        mirror: the meshes are mirrors, whose reflections are traced once.

    Returns:
        The report that `colonnade bench --json` writes.
    """
    runs = [Run(config, tuple(overrides), mesh, mirror) for mesh in dict.fromkeys(meshes)]
    reports: dict[str, dict[str, Any]] = {}
    for run, report in zip(runs, measure(runs, conditions, progress), strict=True):
        reports[run.mesh] = report
        with progress.paused():
            finished(run.mesh, mesh_result(report))
    return design_result(reports)


def design_result(reports: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """What several meshes say about one design.

    Args:
        reports: by mesh, from `measure`; at least one.
    """
    first = next(iter(reports.values()))
    meshes = {name: mesh_result(report) for name, report in reports.items()}
    in_box = geometric_mean(report["rays_per_cycle_in_box"] for report in reports.values())
    return {
        "config": first["config"],
        "config_hash": first["config_hash"],
        "size": first["size"],
        "meshes": meshes,
        "geomean_rays_per_cycle_in_box": in_box,
        "geomean_rays_per_cycle": geometric_mean(report["rays_per_cycle"] for report in reports.values()),
        "geomean_bounds": {
            bound: geometric_mean(mesh["bounds"][bound] or 0.0 for mesh in meshes.values())
            for bound in ("perfect_memory", "perfect_units")
        },
        "ratio_to_paper": in_box / PAPER_RAYS_PER_CYCLE,
    }


def mesh_result(report: Mapping[str, Any]) -> dict[str, Any]:
    """One mesh's part of the report."""
    kept = ("cycles", "rays", "rays_per_cycle", "rays_per_cycle_in_box", "counters", "cycles_per_second", "seconds")
    return {"triangles": report["mesh"]["triangles"], **{key: report[key] for key in kept}, **figures(report)}


def geometric_mean(values: Iterable[float]) -> float:
    """Geometric mean; 0.0 when any value is zero."""
    listed = list(values)
    return math.exp(sum(map(math.log, listed)) / len(listed)) if listed and min(listed) > 0 else 0.0
