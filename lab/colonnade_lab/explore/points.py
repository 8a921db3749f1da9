"""The points of a study: combinations of axis values, checked by the generator before the first job."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

from colonnade.common.errors import UserError
from colonnade.common.limits import MAX_DESIGNS
from colonnade.common.progress import QUIET, Progress
from colonnade.design.generator import manifest_for
from colonnade.design.manifest import Manifest

from colonnade_lab.common.parallel import in_order, processors
from colonnade_lab.explore.study import FieldValue, quoted, value_text
from colonnade_lab.explore.study_file import StudyFile


@dataclass(frozen=True)
class Point:
    """One configuration of a study.

    Attributes:
        name: Unique name, e.g. ``32b32s64d, contexts=8``.
        values: Its values of the axes, and of the fields of a named point.
        overrides: All changes to the study's configuration, ``key.path=value``.
        children: Most children of a node of the packer's tree.
    """

    name: str
    values: Mapping[str, FieldValue]
    overrides: tuple[str, ...]
    children: Literal[2, 4] = 4


def point_of(file: StudyFile, values: Mapping[str, FieldValue], name: str | None = None) -> Point:
    """The point with these values; without a name, it is named after them."""
    changes = tuple(f"{key}={value_text(value)}" for key, value in values.items())
    return Point(name or _name(values), values, (*file.study.design.set, *changes))


def _name(values: Mapping[str, FieldValue]) -> str:
    parts = [
        value_text(v) if k == "precision" else f"{k.rpartition('.')[2]}={value_text(v)}" for k, v in values.items()
    ]
    return ", ".join(parts) or "base"


def points_of(file: StudyFile) -> list[Point]:
    """The points of the axes and the named ones, without points that a search adds.

    Raises:
        UserError: Two points have one name, there are too many, or the baseline is unknown.
    """
    study = file.study
    for point in study.point:
        for key in point.set:
            if not key.strip():
                raise file.error(("point", "set"), "a field without a name")
    values = sum(len(axis) for axis in study.axes.values())
    # A search checks each value once, whatever its budget
    of_axes = {"grid": grid_size(file), "one-by-one": 1 + values, "search": values, "list": 0}[study.combine]
    if len(study.point) + of_axes > MAX_DESIGNS:
        where = ("axes",) if of_axes > len(study.point) else ("point",)
        advice = "vary fewer values, or search" if study.combine == "grid" else "give fewer"
        raise file.error(where, f"the study has more than {MAX_DESIGNS:,} points: {advice}")
    points = [replace(point_of(file, point.set, point.name), children=point.children) for point in study.point]
    points += [point_of(file, values) for values in _combinations(file)]
    names = [point.name for point in points]
    twice = next((name for name, count in Counter(names).items() if count > 1), None)
    if twice is not None:
        raise file.error(("axes",), f"two points are named {quoted(twice)}")
    if study.baseline is not None and study.baseline not in names:
        known = ", ".join(map(quoted, names))
        raise file.error(("baseline",), f"baseline: there is no point {quoted(study.baseline)}; points: {known}")
    return points


def grid_size(file: StudyFile) -> int:
    """The number of combinations of all axes."""
    return math.prod(len(values) for values in file.study.axes.values())


def _combinations(file: StudyFile) -> Iterator[dict[str, FieldValue]]:
    axes = file.study.axes
    if file.study.combine == "grid":
        for values in itertools.product(*axes.values()):
            yield dict(zip(axes, values, strict=True))
    elif file.study.combine == "one-by-one":
        yield {}
        for key, each in axes.items():
            yield from ({key: value} for value in each)


def manifests_of(file: StudyFile, points: list[Point], progress: Progress = QUIET) -> dict[str, Manifest]:
    """The manifest of each point by its name. An illegal configuration is refused with the line that is wrong."""

    def manifest(point: Point) -> Manifest | UserError:
        try:
            return manifest_for(config_of(file), point.overrides, progress).manifest
        except UserError as error:
            return error

    with progress.step(f"checking {len(points)} configurations"):
        found = dict(zip((point.name for point in points), in_order(manifest, points, processors()), strict=True))
    for point in points:
        problem = found[point.name]
        if isinstance(problem, UserError):
            raise file.error(_origin(file, point, str(problem)), f"{quoted(point.name)}: {problem}")
    return {name: manifest for name, manifest in found.items() if isinstance(manifest, Manifest)}


def config_of(file: StudyFile) -> str:
    """The configuration of the study; a JSON file is relative to the study."""
    config = file.study.design.config
    return str(file.path.parent / config) if config.endswith(".json") else config


def _origin(file: StudyFile, point: Point, problem: str) -> tuple[str, ...]:
    """Where a configuration's problem comes from: the field that the message names, else the varied one."""
    for key in sorted(point.values, key=lambda key: key not in problem and key.rpartition(".")[2] not in problem):
        if key in file.study.axes:
            value = () if "unknown key" in problem else (value_text(point.values[key]),)
            return "axes", key, *value
        return "point", "set", key
    return ("design",)
