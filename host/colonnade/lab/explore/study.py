"""The study file: its schema, and the line of every error.

A study names hardware configurations, the frames that they render, and what is measured. All keys and defaults are the
fields of `Study`; an unknown key is refused.
"""

from __future__ import annotations

import dataclasses
import datetime
import json
import math
import re
import sys
import unicodedata
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import field
from pathlib import Path
from typing import Annotated, Any, Literal

from annotated_types import Ge, Gt, Interval, Le, MinLen
from pydantic import BeforeValidator, ConfigDict, PlainValidator, Strict, StrictBool, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass
from pydantic_core import ErrorDetails

from colonnade.common.errors import UserError
from colonnade.common.frame_size import parse_size
from colonnade.common.input_files import check_values, read_input
from colonnade.common.limits import MAX_DEPTH, MAX_DESIGNS
from colonnade.common.terminal_text import one_line

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

#: The fastest clock for power, MHz.
MAX_CLOCK = 1e6

_STRICT = ConfigDict(extra="forbid")


def _field_value(value: Any) -> Any:
    """Refuse what is no value of a configuration field."""
    if isinstance(value, bool | int | str):
        return value
    if isinstance(value, float) and math.isfinite(value):
        return value
    if isinstance(value, dict):
        return value
    raise ValueError(f"must be a number, true or false, text in quotes, or a table, not {_shown(value)}")


def _frame_size(value: Any) -> Any:
    """The size of a frame: ``[96, 72]``, or ``"96x72"`` as on the command line."""
    try:
        return parse_size(value) if isinstance(value, str) else value
    except UserError as error:
        raise ValueError(str(error)) from None


#: A value of a configuration field: a number, a Boolean, text such as a precision, or a whole section.
FieldValue = Annotated[bool | int | float | str | dict[str, Any] | None, PlainValidator(_field_value)]

#: The way in which the axes combine.
Combination = Literal["grid", "one-by-one", "list", "search"]

_Count = Annotated[int, Strict(), Ge(1)]
_Names = tuple[Annotated[str, MinLen(1)], ...]
_Size = Annotated[tuple[_Count, _Count], BeforeValidator(_frame_size)]


@dataclass(frozen=True, config=_STRICT)
class Design:
    """The configuration that every point starts from.

    Attributes:
        config: Preset, or precision in the paper's notation. A JSON file is relative to the study.
        set: Changes to it, ``key.path=value``.
    """

    config: str = "small"
    set: _Names = ()


@dataclass(frozen=True, config=_STRICT)
class NamedPoint:
    """A point beside those of the axes.

    Attributes:
        name: Its name in tables and plots.
        set: Fields and their values.
    """

    name: Annotated[str, MinLen(1)]
    set: Mapping[str, FieldValue] = field(default_factory=dict)


@dataclass(frozen=True, config=_STRICT)
class Workload:
    """The frames: each scene with each mesh.

    Attributes:
        scenes: Scene files, relative to the study.
        meshes: Names or files; empty: the mesh of each scene.
        size: Width and height in pixels, ``[640, 480]`` or ``"640x480"``.
    """

    scenes: Annotated[_Names, MinLen(1)]
    meshes: _Names = ()
    size: _Size = (640, 480)


@dataclass(frozen=True, config=_STRICT)
class Quality:
    """Pictures of the bit-exact model, compared with Embree's and with those of the baseline.

    Attributes:
        dists: Measure DISTS, whose weights are a download of 64 MB.
    """

    dists: StrictBool = True


@dataclass(frozen=True, config=_STRICT)
class Cycles:
    """Frames of the RTL. `meshes` restricts them; empty: all of the workload."""

    meshes: _Names = ()


@dataclass(frozen=True, config=_STRICT)
class Area:
    """Gates, memories and timing paths, with each library."""


@dataclass(frozen=True, config=_STRICT)
class Power:
    """Gate-level power of one render unit, with each library.

    Attributes:
        meshes: Meshes of the workload; empty: all.
        size: Width and height of the frame, pixels; without it one that the window replays completely.
        cycles: Cycles to replay on the gates, at most.
        clock: MHz.
    """

    meshes: _Names = ()
    size: _Size | None = None
    cycles: _Count = 4000
    clock: Annotated[float, Gt(0), Le(MAX_CLOCK)] = 200.0


@dataclass(frozen=True, config=_STRICT)
class Search:
    """A search for the Pareto front over the axes.

    Attributes:
        budget: Points to evaluate, at most.
        objectives: Figures to minimise or maximise, as they are better.
        constraints: Conditions ``figure >= number`` or ``figure <= number``.
        sampler: ``nsga2`` or ``tpe`` of Optuna.
        batch: Points to evaluate before the sampler learns from them: the population of ``nsga2``.
        seed: Seed of the sampler: the same study gives the same points.
        start: Values of axes that the search begins with, after the first value of every axis. An axis that one of them
            leaves out has its first value.
    """

    budget: Annotated[int, Strict(), Interval(ge=1, le=MAX_DESIGNS)]
    objectives: Annotated[_Names, MinLen(2)]
    constraints: _Names = ()
    sampler: Literal["nsga2", "tpe"] = "nsga2"
    batch: _Count = 8
    seed: Annotated[int, Strict(), Interval(ge=0, le=2**32 - 1)] = 1
    start: tuple[dict[str, FieldValue], ...] = ()


@dataclass(frozen=True, config=_STRICT)
class Study:
    """A study.

    Attributes:
        title, description: Text for the report.
        combine: ``grid``: all combinations of the axes; ``one-by-one``: each value of each axis alone, after the
            unchanged design; ``list``: the named points only; ``search``: points that a search chooses.
        baseline: Name of the point that the others are compared with.
        libraries: Names of standard-cell libraries, whose files the command line gives; empty: Yosys's generic gates.
        objectives: Figures whose Pareto front is reported.
        quality, cycles, area, power: The measures; one without a table is not taken.
        design: The configuration that every point starts from.
        axes: Values of configuration fields.
        point: Points beside those of the axes.
        workload: The frames.
        search: The search, for ``combine = "search"``.
    """

    title: str
    workload: Workload
    description: str = ""
    combine: Combination = "grid"
    baseline: str | None = None
    libraries: _Names = ()
    objectives: _Names = ()
    design: Design = field(default_factory=Design)
    axes: Mapping[str, Annotated[tuple[FieldValue, ...], MinLen(1)]] = field(default_factory=dict)
    point: tuple[NamedPoint, ...] = ()
    quality: Quality | None = None
    cycles: Cycles | None = None
    area: Area | None = None
    power: Power | None = None
    search: Search | None = None

    def __post_init__(self) -> None:
        problem = self._problem()
        if problem is not None:
            raise ValueError(problem)

    def _problem(self) -> str | None:
        """What contradicts itself; None if nothing does."""
        if (self.combine == "search") != (self.search is not None):
            return 'combine: a search needs combine = "search" and a table [search]'
        if self.combine == "list" and (self.axes or not self.point):
            return "combine: a list has [[point]] tables and no [axes]"
        if self.combine != "list" and not self.axes:
            return 'combine: no [axes]; use combine = "list" for [[point]] tables alone'
        if not any((self.quality, self.cycles, self.area, self.power)):
            return "nothing is measured: give [quality], [cycles], [area] or [power]"
        for key, names in (("libraries", self.libraries), ("objectives", self.objectives)):
            twice = [name for name, count in Counter(names).items() if count > 1]
            if twice:
                return f"{key}: {twice[0]} is named twice"
        if self.search is not None and len(self.search.start) >= self.search.budget:
            return "search.start: the budget ends before these points and the first one: give fewer, or a larger budget"
        for values in self.search.start if self.search else ():
            for key, value in values.items():
                if value not in self.axes.get(key, ()):
                    return f"search.start: {key} = {value_text(value)} is not a value of the axes"
        if self.power is not None and not self.libraries:
            return 'power: the gates need a library: give libraries = ["NAME"]'
        for name, part in (("cycles", self.cycles), ("power", self.power)):
            unknown = [mesh for mesh in (part.meshes if part else ()) if mesh not in self.workload.meshes]
            if unknown:
                return f"{name}.meshes: {unknown[0]} is not in workload.meshes"
        return None


_SCHEMA = TypeAdapter(Study)


@dataclasses.dataclass(frozen=True)
class StudyFile:
    """A study and the file that it came from.

    Attributes:
        study: The study.
        path: The file.
        text: Its content.
    """

    study: Study
    path: Path
    text: str

    def error(self, where: tuple[str, ...], message: str) -> UserError:
        """An error of a key or value, with its line. `where` is the path of keys, and a value as the last part."""
        line = line_of(self.text, where)
        return UserError(f"{self.path}{'' if line is None else f':{line}'}: {message}")


def load_study(path: Path) -> StudyFile:
    """Read a study.

    Raises:
        UserError: The file is missing, is not TOML, or has an invalid key or value; with its line.
    """
    content = read_input(path, "the study", missing=f"study file {path} does not exist")
    try:
        text = content.decode("utf-8")
        data = tomllib.loads(text)
    except RecursionError:
        raise UserError(f"study {path} is nested too deeply: {MAX_DEPTH} levels at most") from None
    except UnicodeDecodeError:
        raise UserError(f"study {path} is not TOML: save it as UTF-8 text") from None
    except ValueError as error:
        raise UserError(f"study {path} is not TOML: {error}") from None
    check_values(data, f"study {path}")
    for where, problem in _unusable(data, ()):
        line = line_of(text, where)
        raise UserError(f"{path}{'' if line is None else f':{line}'}: {one_line('.'.join(where))}: {problem}")
    try:
        study = _SCHEMA.validate_python(data)
    except ValidationError as error:
        # An unknown key explains a missing one
        found = error.errors(include_url=False)
        first = next((each for each in found if each["type"] == "unexpected_keyword_argument"), found[0])
        where = tuple(str(part) for part in first["loc"] if isinstance(part, str) and not part[:1].isupper())
        message = _message(first, where)
        if first["type"] == "value_error" and not where:
            where = tuple(message.partition(":")[0].split("."))
        line = line_of(text, where)
        raise UserError(f"{path}{'' if line is None else f':{line}'}: {message}") from None
    return StudyFile(study, path, text)


def _unusable(value: Any, where: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], str]]:
    """Keys and values below `where` that no study can have, each with what to do."""
    if isinstance(value, dict):
        for key, inner in value.items():
            if not key.strip() or "=" in key or _control(key):
                yield (*where, key), "a key must be a name without = and control characters"
            yield from _unusable(inner, (*where, key))
    elif isinstance(value, list):
        for inner in value:
            yield from _unusable(inner, where)
    elif isinstance(value, datetime.date | datetime.time):
        yield where, f"a date or time is no value: write a number, or {value} in quotes"
    elif isinstance(value, float) and not math.isfinite(value):
        yield where, f"{value} is no value: write a finite number"
    elif isinstance(value, str) and (
        found := _control(value if where != ("description",) else " ".join(value.split()))
    ):
        yield where, f"the text holds the control character U+{ord(found):04X}: leave it out"


def _control(text: str) -> str | None:
    """The first character of a text that tables and plots cannot show: control characters, separators of lines."""
    for character in text:
        is_none = ord(character) & 0xFFFE == 0xFFFE or 0xFDD0 <= ord(character) <= 0xFDEF
        if is_none or unicodedata.category(character) in ("Cc", "Zl", "Zp"):
            return character
    return None


#: What a value must be, by the type of pydantic's error.
_WANTED = {
    "string_type": "text in quotes",
    "string_too_short": "text that is not empty",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "int_parsing": "a whole number",
    "float_type": "a number",
    "float_parsing": "a number",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "tuple_type": "a list in brackets",
    "mapping_type": "a table",
    "dict_type": "a table",
    "dataclass_type": "a table",
}


def _message(error: ErrorDetails, where: tuple[str, ...]) -> str:
    name, kind, context = ".".join(where), error["type"], error.get("ctx", {})
    if kind == "unexpected_keyword_argument":
        return f"unknown key {one_line(name)}; known here: {', '.join(_keys(where[:-1]))}"
    if kind == "value_error":
        return f"{name}: {context['error']}" if where else str(context["error"])
    if kind in ("missing_argument", "missing"):
        is_key = isinstance(error["loc"][-1], str)
        return f"the key {name} is missing: add it" if is_key else f"{name}: too few values: give one more"
    if kind == "too_short":
        least = context["min_length"]
        return f"{name}: too few values: give at least {least}"
    if kind == "too_long":
        return f"{name}: too many values: give {context['max_length']}"
    wanted = _WANTED.get(kind)
    if wanted is None:
        # Numbers out of range, and words of a list
        text = error["msg"].removeprefix("Input should be ")
        wanted = f"{text[:1].lower()}{text[1:]}"
    return f"{name}: must be {wanted}, not {_shown(error['input'])}"


def _shown(value: Any) -> str:
    """A value in a message."""
    text = json.dumps(value, ensure_ascii=False, default=str)
    return one_line(text if len(text) <= _MAX_SHOWN else f"{text[:_MAX_SHOWN]}…")


#: Characters of a value in a message.
_MAX_SHOWN = 60


def _keys(table: tuple[str, ...]) -> list[str]:
    """The known keys of a table."""
    schema: dict[str, Any] = _SCHEMA.json_schema()
    node = schema
    for name in table:
        node = node["properties"][name]
        options = [node, *node.get("anyOf", []), node.get("items", {})]
        reference = next((option["$ref"] for option in options if "$ref" in option), None)
        if reference is None:
            return []
        node = schema["$defs"][reference.rpartition("/")[2]]
    return list(node.get("properties", {}))


def line_of(text: str, where: tuple[str, ...]) -> int | None:
    """The line of a key, or of a value below it, in a TOML text, from 1; None if it is not found.

    Args:
        text: The text.
        where: Tables and key from the outside in; the last part may be a value, or a key within an inline table.
    """
    table: tuple[str, ...] = ()
    best, depth = None, 0
    for number, line in enumerate(text.splitlines(), 1):
        path: tuple[str, ...] = ()
        if header := re.fullmatch(r"\s*\[\[?([^\]]+)\]\]?\s*(#.*)?", line):
            path = table = _split(header[1])
        elif key := re.match(r"\s*([\w.\"'-]+)\s*=", line):
            path = (*table, *_split(key[1]))
        if depth < len(path) and path == where[: len(path)]:
            best, depth = number, len(path)
        # The value, or the key of an inline table, is on this line or below it
        if best is not None and depth == len(where) - 1 and _holds(line, where[-1]):
            return number
    return best


def _split(key: str) -> tuple[str, ...]:
    return tuple(part[0] or part[1] or part[2] for part in re.findall(r"\"([^\"]*)\"|'([^']*)'|([\w-]+)", key))


def _holds(line: str, value: str) -> bool:
    """Whether a line names a value, as text or as a number."""
    return re.search(rf"(?<![\w.-]){re.escape(value)}(?![\w-])", line) is not None


def value_text(value: FieldValue) -> str:
    """A value as ``--set`` takes it."""
    return value if isinstance(value, str) else json.dumps(value)
