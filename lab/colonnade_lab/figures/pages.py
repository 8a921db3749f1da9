"""Writes tables and single figures of the pages from the data.

A table replaces the text between ``<!-- NAME -->`` on a line of its own and ``<!-- end -->``. A figure replaces that
between ``<!-- figure:PRESET.NAME -->`` and ``<!-- end -->`` within a line, see `facts`; for PRESET ``paper`` see
`paper_tables.FACTS`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from colonnade.common.atomic_files import replacing
from colonnade.common.errors import UserError

from colonnade_lab.figures import (
    cost_tables,
    light_tables,
    map_tables,
    paper_tables,
    performance_tables,
    precision_tables,
    ray_tables,
    result_tables,
    study_tables,
    tree_tables,
)
from colonnade_lab.figures.data import Data, Missing, unmeasured
from colonnade_lab.figures.facts import FORMATS, PRESETS, facts, text

#: The generator of each table.
TABLES: Mapping[str, Callable[[Data], str]] = {
    **result_tables.TABLES,
    **performance_tables.TABLES,
    **cost_tables.TABLES,
    **study_tables.TABLES,
    **map_tables.TABLES,
    **light_tables.TABLES,
    **paper_tables.TABLES,
    **tree_tables.TABLES,
    **precision_tables.TABLES,
    **ray_tables.TABLES,
}

#: Tables of what a measurement took, which say no figure of the hardware.
_OF_MINUTES = ("measuring", "paper-minutes")

_TABLE = re.compile(r"^<!-- ([\w-]+) -->\n.*?^<!-- end -->$", re.DOTALL | re.MULTILINE)
_FIGURE = re.compile(r"<!-- figure:(\w+)\.(\w+) -->.*?<!-- end -->")
_MARKER = re.compile(r"<!-- (?!end -->)([\w:.-]+) -->")


class Read(Data):
    """Data that notes which of its files are read."""

    def __init__(self, data: Data) -> None:
        self._data = data
        self.names: set[str] = set()

    def get(self, name: str) -> Mapping[str, Any] | None:
        """See `Data`."""
        self.names.add(name)
        return self._data.get(name)


def _earlier(read: Read, declared: Collection[str]) -> str:
    """A line below a table for its files that are of earlier hardware or sources."""
    contents = {name: content for name in sorted(read.names & set(declared)) if (content := read.get(name)) is not None}
    if not contents:
        return ""
    found = (f"`{name}` at commit {str(content['commit'])[:8]}" for name, content in contents.items())
    return f"\n\n*Measured before the last change: {', '.join(found)}.*"


def tables_of(docs: Path, entries: Iterable[str]) -> Iterator[tuple[str, str]]:
    """The names and the text of the tables that are made of data files, without tables of minutes."""
    for name, table in TABLES.items():
        if name in _OF_MINUTES:
            continue
        read = Read(Data(docs))
        try:
            text = table(read)
        except Missing:
            continue
        if not read.names.isdisjoint(entries):
            yield name, text


def pages_of(docs: Path) -> list[Path]:
    """The pages in and beside the folder `docs`."""
    return [file for file in (docs.parent / "README.md", *sorted(docs.glob("*.md"))) if file.is_file()]


def page(content: str, data: Data, declared: Collection[str] = ()) -> str:
    """A page with new tables and figures; tables of `declared` files say that they are of an earlier state.

    Raises:
        UserError: A marker names no table or figure, or has no end.
    """
    used: list[str] = []

    def table(match: re.Match[str]) -> str:
        used.append(match[1])
        if match[1] not in TABLES:
            raise UserError(f"there is no table {match[1]}: choose from {', '.join(TABLES)}")
        read = Read(data)
        try:
            body = TABLES[match[1]](read) + ("" if match[1] in _OF_MINUTES else _earlier(read, declared))
        except Missing as missing:
            body = f"Not measured: run `tools/figures {missing}`."
        return f"<!-- {match[1]} -->\n{body}\n<!-- end -->"

    def figure(match: re.Match[str]) -> str:
        preset, name = match.groups()
        used.append(f"figure:{preset}.{name}")
        is_of_paper = preset == "paper"
        known = paper_tables.FACTS if is_of_paper else FORMATS
        if name not in known or not (is_of_paper or preset in PRESETS):
            raise UserError(f"there is no figure {preset}.{name}: choose from {', '.join(known)} of paper or a preset")
        value = paper_tables.fact(data, name) if is_of_paper else text(facts(data, preset), name)
        return f"<!-- figure:{preset}.{name} -->{value}<!-- end -->"

    new = _FIGURE.sub(figure, _TABLE.sub(table, content))
    without_end = sorted(set(_MARKER.findall(content)) - set(used))
    if without_end:
        raise UserError(f"the marker {without_end[0]} has no end on a line of its own")
    return new


def write(docs: Path) -> None:
    """Write all pages."""
    data = Data(docs)
    for file, old, new in _pages(docs, data):
        if new != old:
            with replacing(file) as stream:
                stream.write(new.encode())
            print(f"figures: wrote {file.name}")


def problems(docs: Path) -> Iterator[str]:
    """One line for each page that differs from the data, and for each table that no page shows."""
    written = set()
    for file, old, new in _pages(docs, Data(docs)):
        written |= set(_MARKER.findall(new))
        if new != old:
            yield f"{file.name} differs from its data: run tools/figures pages"
    for name in sorted(TABLES.keys() - written):
        yield f"no page shows the table {name}"


def _pages(docs: Path, data: Data) -> Iterator[tuple[Path, str, str]]:
    """Each page with its text and the new one."""
    for file in pages_of(docs):
        old = file.read_text(encoding="utf-8")
        try:
            yield file, old, page(old, data, unmeasured(docs))
        except UserError as error:
            raise UserError(f"{file}: {error}") from None
