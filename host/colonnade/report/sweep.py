"""Plot of a sweep: rays per cycle over the varied fields."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from colonnade.report.style import COLOURS, GREY, array_name, figure

#: Panels per row.
PANELS = 3

#: Axis labels of fields; other fields are labelled by their key.
LABELS = {
    "array.rows": "rows (render units per column)",
    "array.columns": "columns",
    "array.contexts": "contexts per render unit",
    "columnBvhMemory.banks": "memory banks per column",
    "columnBvhMemory.recordBuffers": "record buffers per render unit",
    "columnBvhMemory.readLatency": "memory read latency, cycles",
}

MARKERS = "osD^vP*X"


def plot_sweep(report: Mapping[str, Any], path: Path) -> None:
    """Plot a report of `colonnade.evaluation.sweep.sweep` as PNG.

    One by one: a panel per field, a line per mesh. Cross product: a panel per mesh with the first field on the x axis,
    and a line per combination of the other fields.
    """
    panels = _panels_one_by_one(report) if report["one_by_one"] else _panels_of_meshes(report)
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
        width, height = report["base"]["size"]
        dotted = " (dotted)" if report["one_by_one"] else ""
        title = f"base{dotted}: {array_name(report['base']['config'])}; {width}×{height}"
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


def _panels_one_by_one(report: Mapping[str, Any]) -> list[_Panel]:
    base = report["base"]
    panels = []
    for key in report["vary"]:
        points = [base, *(point for point in report["points"] if point["varied"] == key)]
        by_value = {_text(point["values"][key]): point for point in points}
        ordered = sorted(by_value.values(), key=lambda point: _order(point["values"][key]))
        lines = {
            mesh: [(point["values"][key], point["meshes"][mesh]["rays_per_cycle_in_box"]) for point in ordered]
            for mesh in base["meshes"]
        }
        label = LABELS.get(key, key)
        panels.append(_Panel(key.rpartition(".")[2], label, lines, base["values"][key]))
    return panels


def _panels_of_meshes(report: Mapping[str, Any]) -> list[_Panel]:
    first, *others = report["vary"]
    panels = []
    for mesh in report["base"]["meshes"]:
        lines: dict[str, list[tuple[Any, float]]] = {}
        for point in report["points"]:
            name = ", ".join(_phrase(key, point["values"][key]) for key in others) or mesh
            lines.setdefault(name, []).append((point["values"][first], point["meshes"][mesh]["rays_per_cycle_in_box"]))
        panels.append(_Panel(mesh, LABELS.get(first, first), lines, None))
    return panels


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
