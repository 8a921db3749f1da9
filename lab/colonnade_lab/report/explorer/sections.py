"""The sections of the report: which charts a study has data for, and what was not measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from colonnade_lab.report.explorer import charts
from colonnade_lab.report.explorer.rows import (
    LEVELS,
    Row,
    index_rows,
    scatter_rows,
    stall_rows,
    unit_rows,
    utilisation_rows,
)
from colonnade_lab.report.explorer.study import Column, Study, objectives, scatter_columns


@dataclass(frozen=True)
class Chart:
    """A chart with data.

    Attributes:
        name: Unique on the page.
        title: What it shows.
        spec: The Vega-Lite specification.
        choices: Values of each parameter that has data; the first is drawn at first.
    """

    name: str
    title: str
    spec: charts.Spec
    choices: dict[str, list[str]]


def scatter_chart(study: Study, x: Column, y: Column) -> charts.Spec:
    """The scatter plot of two columns."""
    return charts.scatter(scatter_rows(study), x, y, len(study["axes"]), has_front=study["front"] is not None)


def scatter_axes(study: Study) -> tuple[Column, Column] | None:
    """Columns of the horizontal and the vertical axis: the first two objectives.

    If there are fewer, other columns, a varied field as the horizontal one; None if there are less than two columns.
    """
    known = scatter_columns(study)
    wanted = objectives(study)
    wanted += [column for column in known if column["key"] not in {each["key"] for each in wanted}]
    if len(wanted) < 2:
        return None
    first, second = wanted[:2]
    return (second, first) if second["key"] in study["axes"] else (first, second)


def index_chart(study: Study) -> Chart | None:
    """The bars of the RenderIndex."""
    rows = index_rows(study) if study["render_index"] else []
    if not rows:
        return None
    libraries = list(dict.fromkeys(row["library"] for row in rows))
    return Chart("index", "RenderIndex", charts.render_index(rows, libraries), {})


def unit_chart(study: Study, measure: str) -> Chart | None:
    """Area (``kge``) or power (``power_mw``) by unit."""
    rows = unit_rows(study, measure)
    if not rows:
        return None
    name, title, unit = {"kge": ("area", "area", "kGE"), "power_mw": ("power", "power", "mW")}[measure]
    levels = [level for level in LEVELS if any(row["level"] == level for row in rows)]
    choices = {"library": _values(rows, "library"), "level": levels}
    spec = charts.units(rows, choices["library"][0], levels[0], title, unit)
    return Chart(name, f"{title.capitalize()} by unit", spec, choices)


def stall_chart(study: Study) -> Chart | None:
    """Context cycles by state."""
    rows = stall_rows(study)
    if not rows:
        return None
    workloads = _values(rows, "workload")
    return Chart("stalls", "Context cycles by state", charts.stalls(rows, workloads[0]), {"workload": workloads})


def utilisation_chart(study: Study) -> Chart | None:
    """Utilisation of units and ports."""
    rows = utilisation_rows(study)
    if not rows:
        return None
    workloads = _values(rows, "workload")
    spec = charts.utilisation(rows, workloads[0])
    return Chart("utilisation", "Utilisation of units and ports", spec, {"workload": workloads})


def bar_charts(study: Study) -> dict[str, Chart]:
    """All charts with data except the scatter plot, by name."""
    found = [
        index_chart(study),
        unit_chart(study, "kge"),
        unit_chart(study, "power_mw"),
        stall_chart(study),
        utilisation_chart(study),
    ]
    return {chart.name: chart for chart in found if chart is not None}


def search_text(study: Study) -> str | None:
    """How the points were found, and how many the grid has."""
    search: dict[str, Any] | None = study["search"]
    if not search:
        return None
    share = f" ({search['evaluations'] / search['grid']:.2%} of it)" if search["grid"] else ""
    grid = f" instead of the grid's {search['grid']:,}{share}" if search["grid"] else ""
    return f"{search['method']} evaluated {search['evaluations']:,} points{grid}, seed {search['seed']}."


def _values(rows: list[Row], key: str) -> list[str]:
    return list(dict.fromkeys(row[key] for row in rows))
