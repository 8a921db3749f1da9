"""Rays per cycle of the benchmark's meshes through the RTL, and what holds each of them back."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from colonnade.generator import manifest_for
from colonnade.progress import QUIET, Progress
from colonnade.render import render

#: The eight meshes of the benchmark.
MESHES = ("teapot", "fandisk", "cheburashka", "rocker-arm", "bunny", "armadillo", "dragon", "duck")

#: What the 10x8 chip of the paper reaches: 41.6 MRay/s at 200 MHz.
PAPER_RAYS_PER_CYCLE = 0.208

#: Counters of busy cycles, by the unit whose name people know; summed over all render units.
BUSY_COUNTERS = {
    "ray set-up": "busyRaySetup",
    "box unit": "busyBoxUnit",
    "triangle unit": "busyTriangleUnit",
    "shader": "busyShader",
}

#: Name, report of the mesh: called after each mesh.
Finished = Callable[[str, Mapping[str, Any]], None]


def bench(
    scene: Path,
    config: str,
    overrides: Sequence[str] = (),
    meshes: Sequence[str] = MESHES,
    size: tuple[int, int] | None = None,
    progress: Progress = QUIET,
    finished: Finished = lambda name, result: None,
) -> dict[str, Any]:
    """Render every mesh once and gather the figures.

    Args:
        scene: the benchmark's scene; its mesh is replaced.
        config: name of the configuration, with `overrides` applied.
        overrides: ``key.path=value`` changes.
        meshes: names or files.
        size: width and height in pixels; the scene's unless given.
        progress: shows the steps.
        finished: called with each mesh's name and figures as they come.

    Returns:
        The report that `colonnade bench --json` writes.
    """
    design = manifest_for(config, overrides, progress)
    results: dict[str, dict[str, Any]] = {}
    for name in meshes:
        report = render(
            scene, config, overrides, "rtl", size, mesh=name, background=None, hits=False, progress=progress
        ).report
        use = utilisation(report, design.manifest.config)
        results[name] = {
            "triangles": report["mesh"]["triangles"],
            "cycles": report["cycles"],
            "rays_per_cycle": report["rays_per_cycle"],
            "rays_per_cycle_in_box": report["rays_per_cycle_in_box"],
            "utilisation": use,
            "bottleneck": max(use, key=lambda unit: use[unit]),
        }
        finished(name, results[name])
    in_box = geometric_mean(result["rays_per_cycle_in_box"] for result in results.values())
    return {
        "config": design.manifest.config,
        "meshes": results,
        "geomean_rays_per_cycle_in_box": in_box,
        "geomean_rays_per_cycle": geometric_mean(result["rays_per_cycle"] for result in results.values()),
        "ratio_to_paper": in_box / PAPER_RAYS_PER_CYCLE,
    }


def utilisation(report: Mapping[str, Any], config: Mapping[str, Any]) -> dict[str, float]:
    """Share of the frame's cycles in which each kind of unit was busy, averaged over all of its kind."""
    counters, cycles = report["counters"], report["cycles"]
    columns = config["array"]["columns"]
    units = config["array"]["rows"] * columns
    use = {unit: counters[counter] / (cycles * units) for unit, counter in BUSY_COUNTERS.items() if counter in counters}
    use["memory banks"] = counters["recordReads"] / (cycles * columns * config["columnBvhMemory"]["banks"])
    return use


def geometric_mean(values: Iterable[float]) -> float:
    """Geometric mean; 0.0 when any value is zero."""
    listed = list(values)
    return math.exp(sum(map(math.log, listed)) / len(listed)) if listed and min(listed) > 0 else 0.0
