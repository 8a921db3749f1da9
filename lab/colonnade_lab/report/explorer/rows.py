"""The rows that the charts draw: one flat mapping for each mark, for all libraries and workloads."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from colonnade_lab.report.explorer.study import (
    Column,
    Point,
    Study,
    configuration_text,
    is_number,
    scatter_columns,
    text_of,
    title_of,
)

Row = dict[str, Any]

#: Levels of units with their titles: a stack of bars is of one level.
LEVELS = {"traversal_unit": "one traversal unit", "column": "one column", "array": "the array"}

#: Units of a stack that have a colour of their own; the smaller ones are added up.
MAX_UNITS = 12
OTHER_UNITS = "other units"

#: Figures of a scatter plot whose largest one is so many times the least have a logarithmic axis.
LOGARITHMIC_SPAN = 30

ON_FRONT = "on the front"
OFF_FRONT = "not on the front"


def scatter_rows(study: Study) -> list[Row]:
    """A row for each point: name, kind, configuration, rank of its label, each figure as number and text."""
    columns = scatter_columns(study)
    ranks = [0 if each["name"] == study["baseline"] else 1 if each["on_front"] else 2 for each in study["points"]]
    return [
        {
            "name": point["name"],
            "kind": ON_FRONT if point["on_front"] else OFF_FRONT,
            "configuration": configuration_text(point),
            "rank": rank,
            "numbers": {column["key"]: _number(point, column["key"]) for column in columns},
            "texts": {column["key"]: _text(point, column) for column in columns},
        }
        for point, rank in zip(study["points"], ranks, strict=True)
    ]


def scale_of(rows: Iterable[Row], key: str) -> dict[str, Any]:
    """The scale of a figure's axis in a scatter plot, for Vega-Lite: its ``type`` is ``log`` or ``linear``."""
    values = [value for row in rows if (value := row["numbers"][key]) is not None]
    low, high = min(values, default=0.0), max(values, default=0.0)
    if low > 0 and high >= LOGARITHMIC_SPAN * low:
        return {"type": "log", "nice": False}
    return {"type": "linear", "nice": False, "zero": False}


def _number(point: Point, key: str) -> float | None:
    value = point["figures"].get(key, point["values"].get(key))
    return value if is_number(value) else None


def _text(point: Point, column: Column) -> str:
    return f"{title_of(column)} = {text_of(_number(point, column['key']), column['format'])}"


def index_order(study: Study) -> list[str]:
    """Names of the points with a RenderIndex: the best first, by the first library that has it."""
    found: dict[str, float] = {}
    for row in study["render_index"]["rows"]:
        if is_number(row["index"]):
            found.setdefault(row["name"], row["index"])
    return sorted(found, key=lambda name: (found[name], name))


def index_rows(study: Study) -> list[Row]:
    """A row for each point and library with a RenderIndex."""
    order = {name: position for position, name in enumerate(index_order(study))}
    rows = [row for row in study["render_index"]["rows"] if is_number(row["index"])]
    keys = ("name", "library", "loss", "norm_loss", "norm_power", "norm_area", "index")
    return [{key: row[key] for key in keys} for row in sorted(rows, key=lambda row: order[row["name"]])]


def unit_rows(study: Study, measure: str) -> list[Row]:
    """A row for each point, library, level and unit with a figure.

    Args:
        study: The study.
        measure: ``kge`` or ``power_mw``.
    """
    rows = [
        {"point": point["name"], "library": library, "level": unit["level"], "unit": name, "value": unit[measure]}
        for point in study["points"]
        for library, area in point["area"].items()
        for name, unit in area["units"].items()
        if is_number(unit.get(measure))
    ]
    groups = dict.fromkeys((row["library"], row["level"]) for row in rows)
    return [row for group in groups for row in _largest(r for r in rows if (r["library"], r["level"]) == group)]


def _largest(rows: Iterable[Row]) -> list[Row]:
    """The rows of one library and level: small units added up, large units first, points in their order."""
    rows = list(rows)
    sizes: dict[str, float] = {}
    for row in rows:
        sizes[row["unit"]] = max(sizes.get(row["unit"], 0.0), row["value"])
    order = sorted(sizes, key=lambda unit: (-sizes[unit], unit))
    if len(order) > MAX_UNITS:
        order = [*order[: MAX_UNITS - 1], OTHER_UNITS]
    merged: dict[tuple[str, str], Row] = {}
    for row in rows:
        unit = row["unit"] if row["unit"] in order else OTHER_UNITS
        key = (row["point"], unit)
        value = row["value"] + (merged[key]["value"] if key in merged else 0.0)
        merged[key] = row | {"unit": unit, "value": value, "order": order.index(unit)}
    return list(merged.values())


def stall_rows(study: Study) -> list[Row]:
    """A row for each point, workload and state of a context: its share of the context cycles."""
    return [
        {"point": name, "workload": workload, "stage": stage, "share": share, "order": position}
        for name, workload, figures in _workloads(study)
        for position, (stage, share) in enumerate((figures.get("stalls") or {}).items())
        if is_number(share)
    ]


def utilisation_rows(study: Study) -> list[Row]:
    """A row for each point, workload and unit or port: its utilisation."""
    return [
        {"point": name, "workload": workload, "unit": unit, "share": share, "binds": unit == figures.get("bottleneck")}
        for name, workload, figures in _workloads(study)
        for unit, share in (figures.get("utilisation") or {}).items()
        if is_number(share)
    ]


def _workloads(study: Study) -> Iterable[tuple[str, str, Any]]:
    for point in study["points"]:
        for workload in study["workloads"]:
            figures = point["workloads"].get(workload["name"])
            if figures:
                yield point["name"], workload["name"], figures
