"""Plot of a study of rays per cycle over its varied fields.

Run as ``python -m colonnade_lab.report.fields STUDY.json PICTURE.png``.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from colonnade_lab.report.style import COLOURS, GREY, array_name, figure

#: Panels per row.
PANELS = 3

#: Axis labels of fields; other fields are labelled by their key.
LABELS = {
    "array.rows": "rows (traversal units per column)",
    "array.columns": "columns",
    "array.contexts": "contexts per traversal unit",
    "units.pathContexts": "contexts per path unit",
    "columnBvhMemory.banks": "memory banks per column",
    "columnBvhMemory.recordBuffers": "record buffers per traversal unit",
}

MARKERS = "osD^vP*X"

#: The content of ``study.json``, and one of its points.
Study = Mapping[str, Any]
Point = Mapping[str, Any]


def base_of(study: Study) -> Point:
    """The point without a changed field.

    Raises:
        StopIteration: The study has none.
    """
    return next(point for point in study["points"] if not point["values"])


def varied_points(study: Study) -> list[Point]:
    """All points but the base."""
    return [point for point in study["points"] if point["values"]]


def rate_of(point: Point, workload: str) -> float:
    """In-box rays per cycle of a frame."""
    return float(point["workloads"][workload]["rays_per_cycle_in_box"])


def plot_fields(study: Study, path: Path) -> None:
    """Plot the in-box rays per cycle of a study with a base as PNG.

    Fields varied one by one: a panel per field, a line per workload. A grid: a panel per workload with the first field
    on the x axis, and a line per combination of the other fields.

    Args:
        study: The content of ``study.json``.
        path: Output file.
    """
    one_by_one = all(len(point["values"]) == 1 for point in varied_points(study))
    panels = _panels_one_by_one(study) if one_by_one else _panels_of_workloads(study)
    has_free_cell = len(panels) > PANELS and len(panels) % PANELS != 0
    columns = min(PANELS, len(panels))
    rows = math.ceil(len(panels) / columns)
    with figure(path, 3.5 * columns + 0.4, 2.9 * rows + 0.5, rows, columns, sharey=True) as axes:
        cells = [axis for row in axes for axis in row]
        for axis, panel in zip(cells, panels, strict=False):
            panel.draw(axis)
        cells[0].set_ylim(bottom=0)
        for row in axes:
            row[0].set_ylabel("in-box rays per cycle")
        for axis in cells[len(panels) :]:
            axis.set_axis_off()
        handles, labels = cells[0].get_legend_handles_labels()
        width, height = study["workloads"][0]["size"]
        dotted = " (dotted)" if one_by_one else ""
        title = f"base{dotted}: {array_name(base_of(study)['config_values'])}; {width}×{height}"
        if has_free_cell:
            cells[-1].legend(
                handles, labels, loc="upper left", title=title.replace(": ", ":\n"), alignment="left", fontsize=9
            )
        else:
            cells[0].figure.legend(handles, labels, title=title, loc="outside lower center", ncols=min(4, len(labels)))


class _Panel:
    """A diagram with lines over one field."""

    def __init__(self, title: str, label: str, lines: Mapping[str, Sequence[tuple[Any, float]]], base: Any) -> None:
        self.title = title
        self.label = label
        self.lines = lines
        self.base = base

    def draw(self, axis: Any) -> None:
        values = sorted({value for line in self.lines.values() for value, _ in line}, key=_order)
        is_number = all(isinstance(value, int) and not isinstance(value, bool) and value > 0 for value in values)
        positions = {value: float(value) if is_number else float(index) for index, value in enumerate(values)}
        for (name, line), colour, marker in zip(self.lines.items(), COLOURS, MARKERS, strict=False):
            xs, ys = [positions[value] for value, _ in line], [rate for _, rate in line]
            axis.plot(xs, ys, color=colour, marker=marker, markersize=4.5, linewidth=1.6, label=name)
        if is_number:
            axis.set_xscale("log", base=2)
            axis.minorticks_off()
        axis.set_xticks(list(positions.values()), [_text(value) for value in positions])
        if self.base in positions:
            axis.axvline(positions[self.base], color=GREY, linewidth=0.8, linestyle=":", zorder=0)
        axis.grid(axis="y")
        axis.set_xlabel(self.label)
        axis.set_title(self.title)


def _panels_one_by_one(study: Study) -> list[_Panel]:
    base = base_of(study)
    panels = []
    for key in study["axes"]:
        own = _value_of(base["config_values"], key)
        points = [(own, base)] + [(p["values"][key], p) for p in varied_points(study) if key in p["values"]]
        by_value = {_text(value): (value, point) for value, point in points}
        ordered = sorted(by_value.values(), key=lambda each: _order(each[0]))
        lines = {name: [(value, rate_of(point, name)) for value, point in ordered] for name in base["workloads"]}
        panels.append(_Panel(key.rpartition(".")[2], LABELS.get(key, key), lines, own))
    return panels


def _panels_of_workloads(study: Study) -> list[_Panel]:
    first, *others = study["axes"]
    panels = []
    for workload in base_of(study)["workloads"]:
        lines: dict[str, list[tuple[Any, float]]] = {}
        for point in varied_points(study):
            name = ", ".join(_phrase(key, point["values"][key]) for key in others) or workload
            lines.setdefault(name, []).append((point["values"][first], rate_of(point, workload)))
        panels.append(_Panel(workload, LABELS.get(first, first), lines, None))
    return panels


def _value_of(config: Mapping[str, Any], key: str) -> Any:
    """The value of a configuration field ``key.path``."""
    value: Any = config
    for part in key.split("."):
        value = value[part]
    return value


def _phrase(key: str, value: Any) -> str:
    """A field and its value as text: ``no snooping``, ``banks 2``."""
    field = key.rpartition(".")[2]
    if isinstance(value, bool):
        return field if value else f"no {field}"
    return f"{field} {_text(value)}"


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)


def _order(value: Any) -> tuple[int, Any]:
    """Sort key: numbers by size, then all other values by their text."""
    return (0, value) if isinstance(value, int | float) else (1, _text(value))


if __name__ == "__main__":
    plot_fields(json.loads(Path(sys.argv[1]).read_text()), Path(sys.argv[2]))
