"""The figures of the benchmark: rays per cycle of eight meshes in the RTL, and the bottleneck of each."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from colonnade_lab.common import paper
from colonnade_lab.evaluation.throughput import figures

#: Meshes of the benchmark.
MESHES = ("teapot", "fandisk", "cheburashka", "rocker-arm", "bunny", "armadillo", "dragon", "duck")


def design_result(
    config: Mapping[str, Any], config_hash: str, size: tuple[int, int], meshes: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """The report of one design over several meshes.

    Args:
        config: All values of its configuration.
        config_hash: Their hash.
        size: Width and height of the frames, pixels.
        meshes: `mesh_result` of each mesh, at least one.
    """
    in_box = geometric_mean(mesh["rays_per_cycle_in_box"] for mesh in meshes.values())
    return {
        "config": config,
        "config_hash": config_hash,
        "size": list(size),
        "meshes": dict(meshes),
        "geomean_rays_per_cycle_in_box": in_box,
        "geomean_rays_per_cycle": geometric_mean(mesh["rays_per_cycle"] for mesh in meshes.values()),
        "geomean_bounds": {
            bound: geometric_mean(mesh["bounds"][bound] or 0.0 for mesh in meshes.values())
            for bound in ("perfect_memory", "perfect_units")
        },
        "ratio_to_paper": in_box / paper.RAYS_PER_CYCLE,
    }


def mesh_result(report: Mapping[str, Any]) -> dict[str, Any]:
    """The figures of one mesh, from the report of `colonnade_lab.evaluation.measure.measure_frame`."""
    keys = ("cycles", "rays", "rays_per_cycle", "rays_per_cycle_in_box", "counters", "cycles_per_second", "seconds")
    return {"triangles": report["mesh"]["triangles"], **{key: report[key] for key in keys}, **figures(report)}


def geometric_mean(values: Iterable[float]) -> float:
    """The geometric mean; 0.0 if there is no value or any value is zero."""
    factors = list(values)
    return math.exp(sum(map(math.log, factors)) / len(factors)) if factors and min(factors) > 0 else 0.0
