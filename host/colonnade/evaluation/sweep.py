"""Sweeps: rays per cycle over combinations of configuration fields."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from colonnade.common.errors import UserError
from colonnade.common.limits import MAX_DESIGNS
from colonnade.common.progress import QUIET, Progress
from colonnade.design.generator import manifest_for
from colonnade.design.manifest import Manifest
from colonnade.evaluation.bench import design_result
from colonnade.evaluation.measure import Conditions, Run, measure


@dataclass(frozen=True)
class Variation:
    """A configuration field and its values, as written on the command line."""

    key: str
    values: tuple[str, ...]


@dataclass(frozen=True)
class Point:
    """One design of a sweep.

    Attributes:
        overrides: Its changes to the configuration, ``key.path=value``, those of the base first.
        varied: The varied field; None for the base and in a cross product.
        manifest: The manifest of the design.
    """

    overrides: tuple[str, ...]
    varied: str | None
    manifest: Manifest


#: Called after each point, the base first, with its part of the report.
Finished = Callable[[Mapping[str, Any]], None]


def parse_variations(texts: Sequence[str]) -> list[Variation]:
    """Parse texts ``key.path=value,value,…``, one per field.

    Raises:
        UserError: A text is malformed, a value or field occurs twice, or there are too many combinations.
    """
    variations: list[Variation] = []
    for text in texts:
        key, equals, rest = (part.strip() for part in text.partition("="))
        values = tuple(value.strip() for value in rest.split(","))
        if not key or not equals or not all(values):
            raise UserError(f"--vary {text} is not of the form key.path=value,value, e.g. --vary array.rows=1,2,4")
        if len(set(values)) < len(values):
            raise UserError(f"--vary {text} names a value twice")
        if any(key == other.key for other in variations):
            raise UserError(f"--vary {key} is given twice: name all its values in one")
        variations.append(Variation(key, values))
    if math.prod(len(variation.values) for variation in variations) > MAX_DESIGNS:
        raise UserError(f"--vary has more than {MAX_DESIGNS:,} combinations: vary fewer fields or values at a time")
    return variations


def sweep(
    config: str,
    overrides: Sequence[str],
    variations: Sequence[Variation],
    meshes: Sequence[str],
    conditions: Conditions,
    one_by_one: bool = False,
    progress: Progress = QUIET,
    finished: Finished = lambda point: None,
) -> dict[str, Any]:
    """Measure the base and all points. All configurations are checked before the first frame.

    Args:
        config: Configuration of the base, before `overrides`.
        overrides: Changes to the configuration, ``key.path=value``.
        variations: The fields to vary.
        meshes: Names or files; rates are geometric means over them.
        conditions: Scene, size and number of parallel jobs.
        one_by_one: Vary each field alone and keep the others as in the base; else the cross product.
        progress: Shows the steps.
        finished: Called after each point, in order.

    Returns:
        The report that `colonnade sweep --json` writes.
    """
    points = _points(config, tuple(overrides), variations, one_by_one, progress)
    designs: dict[str, Point] = {}
    for point in points:
        designs.setdefault(point.manifest.config_hash, point)
    names = list(dict.fromkeys(meshes))
    runs = [Run(config, point.overrides, mesh) for point in designs.values() for mesh in names]
    reports: dict[str, dict[str, Any]] = {}
    results: list[dict[str, Any]] = []
    waiting = iter(points)
    current = next(waiting, None)
    for run, report in zip(runs, measure(runs, conditions, progress), strict=True):
        reports.setdefault(report["config_hash"], {})[run.mesh] = report
        while current is not None and len(reports.get(current.manifest.config_hash, {})) == len(names):
            result = _result(current, variations, reports[current.manifest.config_hash], results)
            results.append(result)
            with progress.paused():
                finished(result)
            current = next(waiting, None)
    return {
        "vary": {variation.key: list(variation.values) for variation in variations},
        "one_by_one": one_by_one,
        "base": results[0],
        "points": results[1:],
    }


def _points(
    config: str, base: tuple[str, ...], variations: Sequence[Variation], one_by_one: bool, progress: Progress
) -> list[Point]:
    """The base, then the points in order."""
    combinations: list[tuple[str | None, tuple[str, ...]]] = [(None, ())]
    if one_by_one:
        combinations += [(vary.key, (f"{vary.key}={value}",)) for vary in variations for value in vary.values]
    else:
        by_field = [[f"{vary.key}={value}" for value in vary.values] for vary in variations]
        combinations += [(None, changes) for changes in itertools.product(*by_field)]
    points = []
    for varied, changes in combinations:
        overrides = (*base, *changes)
        points.append(Point(overrides, varied, manifest_for(config, overrides, progress).manifest))
    return points


def _result(
    point: Point,
    variations: Sequence[Variation],
    reports: Mapping[str, Mapping[str, Any]],
    before: Sequence[Mapping[str, Any]],
) -> dict[str, Any]:
    result = design_result(reports)
    array = point.manifest.config["array"]
    rate = result["geomean_rays_per_cycle_in_box"]
    base = before[0]["geomean_rays_per_cycle_in_box"] if before else rate
    return {
        "values": {variation.key: value_of(point.manifest, variation.key) for variation in variations},
        "varied": point.varied,
        "cycles": sum(mesh["cycles"] for mesh in result["meshes"].values()),
        "in_box_per_unit": rate / (array["rows"] * array["columns"]),
        "ratio_to_base": rate / base if base else 0.0,
        **result,
    }


def value_of(manifest: Manifest, key: str) -> Any:
    """The value of a configuration field ``key.path``."""
    value: Any = manifest.config
    for part in key.split("."):
        value = value[part]
    return value
