"""Renders the report: one HTML page with its scripts, charts and pictures.

Everything of the study passes the template's escaping or, in the page's data, `_script_json`. A content security
policy names the hashes of the page's own scripts and forbids every request, so text of a study cannot run or load
anything.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from colonnade_lab.report.explorer import pictures, tables
from colonnade_lab.report.explorer.rows import LEVELS, scale_of, scatter_rows
from colonnade_lab.report.explorer.sections import bar_charts, scatter_axes, scatter_chart, search_text
from colonnade_lab.report.explorer.study import (
    Column,
    Point,
    Study,
    axis_title_of,
    best_of,
    configuration_text,
    failures_of,
    figure_text,
    is_number,
    scatter_columns,
    text_of,
    title_of,
)
from colonnade_lab.report.explorer.vega import chart_library

_FILES = Path(__file__).parent

#: The page's scripts in their order; together they are one function.
_SCRIPTS = ("common.js", "table.js", "charts.js", "pictures.js")


def page(study: Study, folder: Path) -> str:
    """The HTML of the report.

    Args:
        study: Content of ``study.json``.
        folder: Where the study's pictures are.
    """
    encoded = pictures.load(study, folder)
    charts = bar_charts(study)
    axes = scatter_axes(study)
    scripts = [chart_library(), own_script()]
    template = _environment().get_template("page.html.jinja")
    return template.render(
        study=study,
        style=Markup((_FILES / "page.css").read_text(encoding="utf-8")),
        scripts=[Markup(script) for script in scripts],
        policy=_policy(scripts),
        data=Markup(_script_json(_data(study, charts, axes, encoded))),
        charts=charts,
        scatter=axes,
        scatter_columns=scatter_columns(study),
        axis_title=axis_title_of,
        title=title_of,
        columns=study["columns"],
        rows=_rows(study),
        failures=failures_of(study),
        search=search_text(study),
        has_pictures=bool(encoded),
        is_lossy=any(picture.is_lossy for picture in encoded.values()),
        index_table=tables.index_table(study),
        ranks=tables.rank_tables(study),
        area_table=tables.area_table(study),
        power_table=tables.power_table(study),
        cycles_table=tables.cycles_table(study),
        levels=LEVELS,
    )


def own_script() -> str:
    """The page's own script."""
    parts = [(_FILES / name).read_text(encoding="utf-8") for name in _SCRIPTS]
    return '"use strict";\n(() => {\n' + "\n".join(parts) + "})();\n"


def _environment() -> Environment:
    return Environment(
        loader=FileSystemLoader(_FILES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def _policy(scripts: list[str]) -> str:
    """The content security policy: scripts by hash, pictures as data, no requests."""
    digests = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    hashes = " ".join(f"'sha256-{digest}'" for digest in digests)
    own = f"script-src {hashes}; style-src 'unsafe-inline'; img-src data: blob:"
    return f"default-src 'none'; {own}; base-uri 'none'; form-action 'none'"


def _script_json(data: Any) -> str:
    """JSON that cannot end the element that holds it."""
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def _rows(study: Study) -> list[dict[str, Any]]:
    """The rows of the table of all points."""
    best = {column["key"]: best_of(study, column) for column in study["columns"]}
    return [
        {
            "point": point,
            "is_baseline": point["name"] == study["baseline"],
            "values": [_value_cell(point["values"].get(axis)) for axis in study["axes"]],
            "cells": [_figure_cell(point, column, best[column["key"]]) for column in study["columns"]],
        }
        for point in study["points"]
    ]


def _value_cell(value: Any) -> dict[str, Any]:
    return {"text": text_of(value), "raw": text_of(value) if value is not None else "", "is_number": is_number(value)}


def _figure_cell(point: Point, column: Column, best: float | None) -> dict[str, Any]:
    value = point["figures"].get(column["key"])
    raw = repr(value) if is_number(value) else str(value or "")
    return {
        "text": figure_text(point, column),
        "raw": raw,
        "is_number": is_number(value),
        "is_best": best is not None and value == best,
    }


def _data(
    study: Study,
    charts: Mapping[str, Any],
    axes: tuple[Column, Column] | None,
    encoded: Mapping[str, pictures.Encoded],
) -> dict[str, Any]:
    """What the page's script reads."""
    specs = {name: chart.spec for name, chart in charts.items()}
    if axes:
        specs["scatter"] = scatter_chart(study, *axes)
    rows = scatter_rows(study)
    return {
        "title": study["title"],
        "baseline": study["baseline"],
        "points": [_point_data(point, study, encoded) for point in study["points"]],
        "workloads": [
            {"name": each["name"], "reference": _key(each["reference"], encoded)} for each in study["workloads"]
        ],
        "axes": {
            column["key"]: {"title": axis_title_of(column), "scale": scale_of(rows, column["key"])}
            for column in scatter_columns(study)
        },
        "charts": specs,
        "pictures": {picture.key: picture.as_json() for picture in encoded.values()},
    }


def _key(path: str | None, encoded: Mapping[str, pictures.Encoded]) -> str | None:
    return encoded[path].key if path else None


def _point_data(point: Point, study: Study, encoded: Mapping[str, pictures.Encoded]) -> dict[str, Any]:
    figures = [(title_of(column), figure_text(point, column)) for column in study["columns"]]
    return {
        "name": point["name"],
        "onFront": point["on_front"],
        "summary": configuration_text(point),
        "configuration": [
            ("preset or file", point["config"]),
            ("overrides", " ".join(point["overrides"]) or "none"),
            *((axis, text_of(value)) for axis, value in point["values"].items()),
            ("hash", (point["config_hash"] or "none")[:16]),
        ],
        "figures": figures,
        "failures": [f"{failure['measure']}: {failure['reason']}" for failure in point["failures"]],
        "workloads": {
            name: {
                "picture": _key(figures.get("picture"), encoded),
                "figures": tables.workload_figures(figures),
            }
            for name, figures in point["workloads"].items()
        },
    }
