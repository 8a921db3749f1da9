"""Reads ``study.json``, and derives what table and charts share: texts of figures, best values, titles."""

from __future__ import annotations

import json
import unicodedata
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from colonnade.common.errors import UserError
from colonnade.common.input_files import read_input

#: The content of ``study.json``, version 1.
Study = Mapping[str, Any]
Column = Mapping[str, Any]
Point = Mapping[str, Any]

STUDY_NAME = "study.json"
VERSION = 1

#: Bytes of ``study.json``; a point takes about 10 kB.
MAX_STUDY_BYTES = 1 << 26

MISSING = "–"


def read_study(folder: Path) -> Study:
    """Read ``study.json``. A number that is not finite counts as missing.

    Raises:
        UserError: The file is missing, is not JSON, or has another version.
    """
    path = folder / STUDY_NAME
    data = read_input(path, "the study", MAX_STUDY_BYTES, f"no study in {folder}: run colonnade explore first")
    try:
        study = json.loads(data, parse_constant=lambda _: None)
    except (ValueError, RecursionError) as error:
        raise UserError(f"{path} is not JSON: {error}") from None
    if not isinstance(study, dict) or study.get("version") != VERSION:
        raise UserError(f"{path} is not a study of version {VERSION}: run colonnade explore again")
    return study


def is_number(value: Any) -> bool:
    """Whether `value` is a number; truth values are not."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def title_of(column: Column) -> str:
    """Label and unit of a column."""
    return f"{column['label']}, {column['unit']}" if column["unit"] else str(column["label"])


def axis_title_of(column: Column) -> str:
    """Label and unit of a column, and which direction is better.

    Vega-Lite compiles the titles of axes into expressions, as descriptions of marks. Characters that would break their
    strings are replaced: control characters, line separators and the backslash.
    """
    text = title_of(column) + (f" ({column['better']} is better)" if column["better"] else "")
    plain = "".join(" " if unicodedata.category(character) in ("Cc", "Zl", "Zp") else character for character in text)
    return plain.replace("\\", "\N{SET MINUS}")


def text_of(value: Any, form: str | None = None) -> str:
    """A figure or a configuration value as text; `form` formats numbers, e.g. ``.1f``."""
    if value is None:
        return MISSING
    if isinstance(value, str):
        return value
    return format(value, form) if form and is_number(value) else json.dumps(value, ensure_ascii=False)


def figure_text(point: Point, column: Column) -> str:
    """The figure of a point as text."""
    return text_of(point["figures"].get(column["key"]), column["format"])


def best_of(study: Study, column: Column) -> float | None:
    """The best figure of a column; None without a direction, or if all points are equal."""
    figures = [point["figures"].get(column["key"]) for point in study["points"]]
    known = {figure for figure in figures if is_number(figure)}
    if len(known) < 2 or column["better"] not in ("higher", "lower"):
        return None
    return float(max(known) if column["better"] == "higher" else min(known))


def measured_columns(study: Study) -> list[Column]:
    """The columns that are numbers at one point at least."""
    return [
        column
        for column in study["columns"]
        if any(is_number(point["figures"].get(column["key"])) for point in study["points"])
    ]


def scatter_columns(study: Study) -> list[Column]:
    """What the axes of a scatter plot may be: measured columns, then varied fields with several numbers."""
    points, keys = study["points"], {column["key"] for column in study["columns"]}
    fields = [
        {"key": field, "label": field, "unit": "", "better": None, "format": "", "what": "a varied field"}
        for field in study["axes"]
        if field not in keys and len(set(filter(is_number, (point["values"].get(field) for point in points)))) > 1
    ]
    return [*measured_columns(study), *fields]


def objectives(study: Study) -> list[Column]:
    """The columns of the front's objectives that were measured; other measured columns follow if there are fewer
    than two."""
    columns = {column["key"]: column for column in measured_columns(study)}
    wanted = [columns[key] for key in (study["front"] or {}).get("objectives", []) if key in columns]
    for column in columns.values():
        if len(wanted) >= 2:
            break
        if column not in wanted and column["better"]:
            wanted.append(column)
    return wanted


def configuration_text(point: Point) -> str:
    """The varied fields of a point with their values, on one line."""
    return ", ".join(f"{field} = {text_of(value)}" for field, value in point["values"].items())


def failures_of(study: Study) -> list[dict[str, Any]]:
    """All failures in the order of the points, each with its point."""
    return [{"point": point["name"], **failure} for point in study["points"] for failure in point["failures"]]
