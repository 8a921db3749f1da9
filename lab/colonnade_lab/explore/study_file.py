"""Reads a study file, and names the line of an error."""

from __future__ import annotations

import dataclasses
import datetime
import math
import re
import unicodedata
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

from colonnade.common.errors import UserError
from colonnade.common.input_files import read_input
from colonnade.common.terminal_text import one_line
from colonnade.common.toml_files import parse_toml
from pydantic import TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from colonnade_lab.explore.study import Study, quoted

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

    def with_backend(self, backend: Literal["model", "rtl"]) -> StudyFile:
        """The study with its cycles counted by the cycle model or by the RTL.

        Raises:
            UserError: It counts none.
        """
        if self.study.cycles is None:
            raise UserError(f"{self.path} counts no cycles: leave out --backend, or give it [cycles]")
        cycles = dataclasses.replace(self.study.cycles, backend=backend)
        return dataclasses.replace(self, study=dataclasses.replace(self.study, cycles=cycles))

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
    data = parse_toml(content, f"study {path}")
    text = content.decode("utf-8-sig")
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
    return f"{name}: must be {wanted}, not {quoted(error['input'])}"


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
