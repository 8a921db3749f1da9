"""The header of a PLY file, and the content of its elements, ASCII or binary."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from colonnade.common.errors import UserError
from colonnade.common.types import Floats, Indices
from colonnade.mesh import losses as lost
from colonnade.mesh.losses import Losses

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip


@dataclass(frozen=True)
class Property:
    """A property of an element.

    Attributes:
        name: Its name.
        kind: Type of its values, as of numpy without the byte order.
        count_kind: Type of the number of values of a list; None: it is no list.
    """

    name: str
    kind: str
    count_kind: str | None = None


@dataclass(frozen=True)
class Element:
    """An element of the header, in the order of the file."""

    name: str
    rows: int
    properties: tuple[Property, ...]


@dataclass(frozen=True)
class ListColumn:
    """A list property.

    Attributes:
        sizes: Values of each row, int64 [rows].
        values: All values, row by row, float64.
    """

    sizes: Indices
    values: Floats


#: The content of an element by property: an array float64 [rows], or a `ListColumn`.
Columns = dict[str, Any]


def read_header(data: bytes, path: Path) -> tuple[list[Element], bytes, str]:
    """The elements of a PLY file, the bytes after its header, and its encoding."""
    found = re.search(rb"(?m)^end_header[ \t]*(\r\n|\n|\r)", data)
    if not data.startswith(b"ply") or found is None:
        raise UserError(f"{path} cannot be read as a mesh: its PLY header has no end")
    elements: list[Element] = []
    encoding = ""
    for line in data[: found.start()].decode("latin-1").splitlines():
        words = line.split() or [""]
        if words[0] == "format":
            encoding = words[1]
        elif words[0] == "element":
            rows = int(words[2]) if len(words) == 3 and re.fullmatch("[0-9]{1,18}", words[2]) else -1
            if rows < 0:
                raise UserError(f"mesh {path}: the number of an element of its header is not valid: {line}")
            elements.append(Element(words[1], rows, ()))
        elif words[0] == "property":
            kinds = words[2:4] if words[1] == "list" else words[1:2]
            if (
                not elements
                or any(kind not in _TYPES for kind in kinds)
                or len(words) != len(kinds) + 2 + (words[1] == "list")
            ):
                raise UserError(f"mesh {path}: a property of its header is not valid: {line}")
            is_list = words[1] == "list"
            added = Property(words[-1], _TYPES[kinds[-1]], _TYPES[kinds[0]] if is_list else None)
            last = elements[-1]
            elements[-1] = Element(last.name, last.rows, (*last.properties, added))
    if encoding not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise UserError(f"{path} cannot be read as a mesh: its PLY format is {encoding or 'missing'}")
    return elements, data[found.end() :], encoding


def _truncated(path: Path, element: Element) -> UserError:
    return UserError(
        f"mesh {path} is truncated: its header states {element.rows:,} rows of {element.name}, the file ends before"
    )


def read_ascii(body: bytes, path: Path, header: Sequence[Element], losses: Losses) -> list[Columns]:
    """The columns of all elements of an ASCII file.

    Rows may go over several lines. Where the words are not those of the header, each line is a row, of which the
    values beyond those of the header are left out.

    Raises:
        UserError: The file is truncated, or a value is missing.
    """
    reader, refused = _AsciiReader(body.split(), path), None
    try:
        columns = [reader.read(element) for element in header]
    except UserError as error:
        refused = error
    if refused is not None or reader.left:
        words = _declared([line.split() for line in body.splitlines() if line.strip()], header)
        if words is not None:
            reader = _AsciiReader(words, path)
            columns = [reader.read(element) for element in header]
            losses.add(lost.SURPLUS, len(body.split()) - len(words))
        elif refused is not None:
            raise refused
        else:
            losses.add(lost.SURPLUS, reader.left)
    return columns


def _declared(rows: Sequence[Sequence[bytes]], header: Sequence[Element]) -> list[bytes] | None:
    """The words of the rows that the header declares; None if a line has fewer than a row."""
    words: list[bytes] = []
    kinds = [element.properties for element in header for _ in range(min(element.rows, len(rows) + 1))]
    if len(kinds) > len(rows):
        return None
    for row, properties in zip(rows, kinds, strict=False):
        size = 0
        for one in properties:
            if one.count_kind and (size >= len(row) or not row[size].isdigit()):
                return None
            size += 1 + int(row[size]) if one.count_kind else 1
        if size > len(row):
            return None
        words += row[:size]
    return words


class _AsciiReader:
    """Reads elements from the words of an ASCII file."""

    def __init__(self, words: list[bytes], path: Path) -> None:
        self._words = words
        self._at, self._path = 0, path

    @property
    def left(self) -> int:
        """The words after the elements that were read."""
        return len(self._words) - self._at

    def read(self, element: Element) -> Columns:
        """The columns of the next element."""
        words, properties = self._words, element.properties
        lists = [one for one in properties if one.count_kind]
        if element.rows * max(1, len(properties)) > len(words) - self._at and properties:
            raise _truncated(self._path, element)
        if not lists:
            table = self._take(element.rows * len(properties), element).reshape(element.rows, len(properties))
            return {one.name: table[:, column] for column, one in enumerate(properties)}
        values: dict[str, list[bytes]] = {one.name: [] for one in properties}
        sizes: dict[str, list[int]] = {one.name: [] for one in lists}
        at = self._at
        for _ in range(element.rows):
            for one in properties:
                size = 1
                if at >= len(words):
                    raise _truncated(self._path, element)
                if one.count_kind:
                    if not words[at].isdigit():
                        raise UserError(
                            f"mesh {self._path}: a list of {element.name} begins with {words[at].decode('latin-1')},"
                            " not with its number of values: rows may have more values than the header states"
                        )
                    size = int(words[at])
                    at += 1
                    if not 0 <= size <= len(words) - at:
                        raise _truncated(self._path, element)
                    sizes[one.name].append(size)
                values[one.name] += words[at : at + size]
                at += size
        if at > len(words):
            raise _truncated(self._path, element)
        self._at = at
        return {
            one.name: ListColumn(np.array(sizes[one.name], dtype=np.int64), _numbers(values[one.name]))
            if one.count_kind
            else _numbers(values[one.name])
            for one in properties
        }

    def _take(self, count: int, element: Element) -> Floats:
        if count > len(self._words) - self._at:
            raise _truncated(self._path, element)
        self._at += count
        return _numbers(self._words[self._at - count : self._at])


class BinaryReader:
    """Reads elements from a binary file."""

    def __init__(self, body: bytes, path: Path, is_big: bool) -> None:
        self._body, self._path, self._order = body, path, ">" if is_big else "<"
        self._at = 0

    def read(self, element: Element) -> Columns:
        """The columns of the next element."""
        sizes = self._same_sizes(element)
        fields: list[Any] = []
        for number, one in enumerate(element.properties):
            if one.count_kind:
                fields.append((f"count {number}", self._order + one.count_kind))
                fields.append((f"value {number}", self._order + one.kind, (sizes.get(number, 0),)))
            else:
                fields.append((f"value {number}", self._order + one.kind))
        kind = np.dtype(fields)
        size = element.rows * kind.itemsize
        if len(self._body) - self._at >= size:
            table = np.frombuffer(self._body, kind, element.rows, self._at)
            if all((table[f"count {number}"] == count).all() for number, count in sizes.items()):
                self._at += size
                return {
                    one.name: ListColumn(
                        np.full(element.rows, sizes[number], dtype=np.int64),
                        table[f"value {number}"].astype(np.float64).reshape(-1),
                    )
                    if one.count_kind
                    else table[f"value {number}"].astype(np.float64)
                    for number, one in enumerate(element.properties)
                }
        if not sizes:
            raise _truncated(self._path, element)
        return self._row_by_row(element)

    def _same_sizes(self, element: Element) -> dict[int, int]:
        """The sizes of the lists of the first row, by the number of the property."""
        sizes: dict[int, int] = {}
        at = self._at
        for number, one in enumerate(element.properties):
            size = 1
            if one.count_kind:
                size = int(self._values(one.count_kind, 1, at, element)[0]) if element.rows else 0
                at += np.dtype(one.count_kind).itemsize
                sizes[number] = size
                if not 0 <= size <= len(self._body):
                    raise _truncated(self._path, element)
            at += size * np.dtype(one.kind).itemsize
        return sizes

    def _row_by_row(self, element: Element) -> Columns:
        values: dict[str, list[npt.NDArray[Any]]] = {one.name: [] for one in element.properties}
        at = self._at
        for _ in range(element.rows):
            for one in element.properties:
                size = 1
                if one.count_kind:
                    size = int(self._values(one.count_kind, 1, at, element)[0])
                    at += np.dtype(one.count_kind).itemsize
                row = self._values(one.kind, size, at, element)
                values[one.name].append(row)
                at += row.nbytes
        self._at = at
        columns: Columns = {}
        for one in element.properties:
            rows = values[one.name]
            flat = np.concatenate(rows).astype(np.float64)
            sizes = np.array([len(row) for row in rows], dtype=np.int64)
            columns[one.name] = ListColumn(sizes, flat) if one.count_kind else flat
        return columns

    def _values(self, kind: str, count: int, at: int, element: Element) -> npt.NDArray[Any]:
        if count < 0 or at + count * np.dtype(kind).itemsize > len(self._body):
            raise _truncated(self._path, element)
        return np.frombuffer(self._body, self._order + kind, count, at)


def _numbers(words: Sequence[bytes]) -> Floats:
    return np.array(words).astype(np.float64) if words else np.zeros(0)
