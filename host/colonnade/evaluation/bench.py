"""The benchmark: rays per cycle of eight meshes in the RTL, and the bottleneck of each."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from colonnade.common.progress import QUIET, Progress
from colonnade.evaluation.measure import Conditions, Run, measure
from colonnade.evaluation.throughput import figures

#: Meshes of the benchmark.
MESHES = ("teapot", "fandisk", "cheburashka", "rocker-arm", "bunny", "armadillo", "dragon", "duck")

#: Rate of the paper's 10x8 chip: 41.6 MRay/s at 200 MHz.
PAPER_RAYS_PER_CYCLE = 0.208

#: Called after each mesh with its name and its report.
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
    """Render each mesh once and collect its figures.

    Args:
        config: Configuration, before `overrides`.
        overrides: Changes to the configuration, ``key.path=value``.
        meshes: Names or files.
        conditions: Scene, size and number of parallel jobs.
        progress: Shows the steps.
        finished: Called after each mesh, in order.
        mirror: Render the meshes as mirrors with one reflection.

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
    """The report of one design over several meshes.

    Args:
        reports: Reports of `measure` by mesh, at least one.
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
    """The report of one mesh."""
    keys = ("cycles", "rays", "rays_per_cycle", "rays_per_cycle_in_box", "counters", "cycles_per_second", "seconds")
    return {"triangles": report["mesh"]["triangles"], **{key: report[key] for key in keys}, **figures(report)}


def geometric_mean(values: Iterable[float]) -> float:
    """The geometric mean; 0.0 if there is no value or any value is zero."""
    factors = list(values)
    return math.exp(sum(map(math.log, factors)) / len(factors)) if factors and min(factors) > 0 else 0.0
