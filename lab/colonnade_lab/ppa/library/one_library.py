"""Refuses liberty files that do not belong together: other conditions, units, names of cells, or the same cells.

Yosys and abc would map a design to a mixture of all cells that they are given.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from colonnade.common.errors import UserError

from colonnade_lab.ppa.library.liberty_files import find_liberties, library_text

#: The attributes that must agree, with Liberty's defaults.
_ATTRIBUTES = {
    "nom_process": "none",
    "nom_voltage": "none",
    "nom_temperature": "none",
    "time_unit": "1ns",
    "voltage_unit": "1V",
    "current_unit": "1mA",
    "capacitive_load_unit": "1,pf",
    "leakage_power_unit": "1nW",
}

_CELL = re.compile(r"\bcell\s*\(\s*\"?([^\s\"(){}]+)\"?\s*\)")


@dataclass(frozen=True)
class _File:
    """What a liberty file says of its library. `naming`: what its cells' names begin and end with, if they show it."""

    name: str
    attributes: dict[str, str]
    cells: tuple[str, ...]
    naming: tuple[str, str] | None


def library_files(names: Sequence[str]) -> tuple[Path, ...]:
    """The liberty files of one library, whose files or folders are given.

    Raises:
        UserError: A file is missing, or the files do not form one library.
    """
    paths = find_liberties(names)
    if len(paths) > 1:
        _check([_read(path) for path in paths])
    return paths


def _check(files: Sequence[_File]) -> None:
    base = next((file for file in files if file.naming and any(file.naming)), files[0])
    others = {file.name: differences for file in files if (differences := list(_differences(base, file)))}
    if others:
        named = ", ".join(others)
        verb = "differ" if len(others) > 1 else "differs"
        different = ", ".join(next(iter(others.values())))
        raise UserError(f"{named} {verb} from {base.name} in {different}: name the files of one library and one corner")
    owner: dict[str, str] = {}
    for file in files:
        for cell in file.cells:
            if cell in owner:
                raise UserError(f"the cell {cell} is in {owner[cell]} and again in {file.name}: name one of them")
            owner[cell] = file.name


def _differences(base: _File, other: _File) -> Iterator[str]:
    for key, value in other.attributes.items():
        if value != base.attributes[key]:
            yield f"{key} ({value}, not {base.attributes[key]})"
    if base.naming is None:
        return
    first, last = base.naming
    strange = [cell for cell in other.cells if not (cell.startswith(first) and cell.endswith(last))]
    if strange or (other.naming is not None and other.naming != base.naming):
        yield f"names of cells ({(strange or other.cells)[0]}, not {first}…{last})"


def _read(path: Path) -> _File:
    text = re.sub(r"/\*.*?\*/", "", library_text(path), flags=re.DOTALL)
    cells = tuple(match[1] for match in _CELL.finditer(text))
    attributes = {key: _attribute(text, key, usual) for key, usual in _ATTRIBUTES.items()}
    return _File(path.name, attributes, cells, _naming(cells))


def _attribute(text: str, name: str, usual: str) -> str:
    """The value of a library's attribute: numbers in one form, units in lower case."""
    match = re.search(rf"\b{name}\s*(?::\s*([^;\n]+)|\(([^)]*)\))", text)
    value = (match[1] or match[2] or "") if match else usual
    number, unit = re.fullmatch(r"([-+.\deE]*)(.*)", re.sub(r"[\s\",]", "", value)).groups()  # type: ignore[union-attr]
    try:
        return f"{float(number):g}{unit.lower()}"
    except ValueError:
        return f"{number}{unit}".lower()


def _naming(cells: Sequence[str]) -> tuple[str, str] | None:
    """What all names begin and end with, in whole words; None if there are too few kinds of cells to tell.

    Words at the end that only name a drive strength, such as ``X1``, do not count.
    """
    words = [cell.split("_") for cell in cells]
    if not words:
        return None
    shortest = min(map(len, words)) - 1
    begin = _common(words, shortest)
    end = _common([each[::-1] for each in words], shortest - begin)
    kinds = {re.sub(r"[^A-Za-z].*", "", each[begin]) for each in words}
    if len(kinds) < 2:
        return None
    last = words[0][len(words[0]) - end :]
    while last and re.fullmatch(r"[xXdD]?\d+(p\d+)?[A-Za-z]?", last[0]):
        last.pop(0)
    return "".join(f"{word}_" for word in words[0][:begin]), "".join(f"_{word}" for word in last)


def _common(words: Sequence[Sequence[str]], limit: int) -> int:
    """How many words all sequences begin with, at most `limit`."""
    return next((n for n in range(limit) if len({each[n] for each in words}) > 1), limit)
