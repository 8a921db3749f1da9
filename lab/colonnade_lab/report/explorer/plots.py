"""Writes the charts of a study as SVG and PNG files."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from colonnade_lab.common.file_names import FileNames
from colonnade_lab.report.explorer.charts import INK, SCATTER_HEIGHT, SCATTER_PADDING, Spec
from colonnade_lab.report.explorer.labels import placed
from colonnade_lab.report.explorer.rows import LEVELS
from colonnade_lab.report.explorer.sections import Chart, bar_charts, scatter_axes, scatter_chart
from colonnade_lab.report.explorer.study import Study, objectives, scatter_columns
from colonnade_lab.report.explorer.vega import drawn

#: Width of a plot, and what its vertical axis and edges take of it, CSS pixels.
WIDTH, _AXIS = 760, 75


def write_all(study: Study, folder: Path, write: Callable[[Path, bytes], None]) -> list[Path]:
    """Write a plot for each pair of objectives, for each of the study's, and for each library, level and workload.

    Returns:
        The paths.
    """
    paths = []
    charts = list(plots(study))
    for (name, _), pictures in zip(charts, drawn([_static(spec) for _, spec in charts]), strict=True):
        for suffix, data in zip((".svg", ".png"), pictures, strict=True):
            paths.append(folder / (name + suffix))
            write(paths[-1], data)
    return paths


def plots(study: Study) -> Iterator[tuple[str, Spec]]:
    """File name and specification of each plot."""
    names = FileNames()
    for name, spec in _all(study):
        yield names.of(name), spec


def _all(study: Study) -> Iterator[tuple[str, Spec]]:
    pairs = list(itertools.combinations(objectives(study), 2))
    known = {column["key"]: column for column in scatter_columns(study)}
    own = [(known[x], known[y]) for x, y in study.get("plots", []) if x in known and y in known]
    pairs += [pair for pair in own if pair not in pairs]
    first = scatter_axes(study)
    for x, y in pairs or ([first] if first else []):
        spec = scatter_chart(study, x, y)
        area = (WIDTH - _AXIS, SCATTER_HEIGHT)
        spec["data"]["values"] = placed(spec["data"]["values"], x["key"], y["key"], area, SCATTER_PADDING)
        yield f"pareto--{x['key']}--{y['key']}", spec
    for chart in bar_charts(study).values():
        yield from _choices(chart)


def _choices(chart: Chart) -> Iterator[tuple[str, Spec]]:
    """The chart with each combination of values that has data, its title naming them."""
    rows = chart.spec["data"]["values"]
    for values in itertools.product(*chart.choices.values()):
        chosen = dict(zip(chart.choices, values, strict=True))
        if not any(all(row[key] == value for key, value in chosen.items()) for row in rows):
            continue
        spec = copy.deepcopy(chart.spec)
        for parameter in spec.get("params", []):
            parameter["value"] = chosen[parameter["name"]]
        spec["title"] = ", ".join([chart.title, *(LEVELS.get(value, value) for value in values)])
        yield "--".join([chart.name, *values]), spec


def _static(spec: Spec) -> Spec:
    """The specification for a white page of fixed width."""
    static: Spec = _replaced(spec, INK, "black")
    return static | {"width": WIDTH, "padding": 10, "config": static["config"] | {"background": "white"}}


def _replaced(value: Any, old: str, new: str) -> Any:
    if isinstance(value, dict):
        return {key: item if key == "data" else _replaced(item, old, new) for key, item in value.items()}
    if isinstance(value, list):
        return [_replaced(item, old, new) for item in value]
    return new if value == old else value
