"""Reads PLY files: polygons and triangle strips with normals and colours of vertices, and colours of faces.

This is our own code because trimesh reads neither strips nor the normals of all files, and splits concave polygons
wrongly.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from colonnade.common.errors import UserError
from colonnade.common.srgb import linear_from_srgb
from colonnade.common.types import Floats, Indices
from colonnade.mesh import losses as lost
from colonnade.mesh.losses import Losses
from colonnade.mesh.surface import RawSurface, from_polygons

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
_COLOURS = (("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue"))
#: Names of the list of a face's vertices.
_CORNERS = ("vertex_indices", "vertex_index")


@dataclass(frozen=True)
class _Property:
    name: str
    kind: str
    count_kind: str | None = None  # of a list


@dataclass(frozen=True)
class _Element:
    name: str
    rows: int
    properties: tuple[_Property, ...]


@dataclass(frozen=True)
class _List:
    """A list property: the number of values of each row, and all values."""

    sizes: Indices
    values: Floats


_Columns = dict[str, Any]  # of an element: an array, or a _List, for each property


def read_ply(data: bytes, path: Path, losses: Losses) -> RawSurface:
    """Read a PLY file, ASCII or binary.

    Raises:
        UserError: The file is invalid or truncated, or a face names a vertex that does not exist.
    """
    header, body, encoding = _header(data, path)
    reader = _Ascii(body, path) if encoding == "ascii" else _Binary(body, path, encoding == "binary_big_endian")
    content = {element.name: (element, reader.read(element)) for element in header}
    if "vertex" not in content:
        raise UserError(f"mesh {path} has no vertices")
    vertex = content["vertex"][1]
    vertices = _stacked(vertex, ("x", "y", "z"))
    if vertices is None:
        raise UserError(f"mesh {path}: its vertices lack x, y or z")
    normals = _stacked(vertex, ("nx", "ny", "nz"))
    face_element, face = content.get("face", (None, {}))
    corners = next((face[name] for name in _CORNERS if isinstance(face.get(name), _List)), None)
    sizes = np.zeros(0, dtype=np.int64) if corners is None else corners.sizes
    flat = np.zeros(0, dtype=np.int64) if corners is None else _whole(corners.values)
    polygon_colours = None if face_element is None else _colours(face_element, face)
    if isinstance(strips := content.get("tristrips", (None, {}))[1].get("vertex_indices"), _List):
        triangles = np.array(_unrolled(strips), dtype=np.int64).reshape(-1, 3)
        flat, sizes = np.append(flat, triangles), np.append(sizes, np.full(len(triangles), 3))
        polygon_colours = None
    if len(flat) and (flat.min() < 0 or flat.max() >= len(vertices)):
        worst = int(flat.min()) if flat.min() < 0 else int(flat.max())
        raise UserError(
            f"mesh {path}: a face names vertex {worst}, which does not exist: the file has {len(vertices):,} vertices,"
            " numbered from 0"
        )
    losses.add(lost.LINES, content["edge"][0].rows if "edge" in content else 0)
    alpha = vertex.get("alpha")
    opaque = 255.0 if any(one.kind == "u1" for one in content["vertex"][0].properties if one.name == "alpha") else 1.0
    losses.add(lost.ALPHA, int((alpha < opaque).sum()) if isinstance(alpha, np.ndarray) else 0)
    textures = set(re.findall(rb"(?m)^comment[ \t]+TextureFile[ \t]+(\S.*)$", data[: len(data) - len(body)]))
    losses.add(lost.TEXTURES, len(textures))
    return from_polygons(
        vertices,
        flat,
        sizes,
        losses,
        corner_normals=None if normals is None else normals[flat],
        vertex_colours=_colours(*content["vertex"]),
        polygon_colours=polygon_colours,
    )


def _header(data: bytes, path: Path) -> tuple[list[_Element], bytes, str]:
    """The elements of a PLY file, the bytes after its header, and its encoding."""
    found = re.search(rb"(?m)^end_header[ \t]*(\r\n|\n|\r)", data)
    if not data.startswith(b"ply") or found is None:
        raise UserError(f"{path} cannot be read as a mesh: its PLY header has no end")
    elements: list[_Element] = []
    encoding = ""
    for line in data[: found.start()].decode("latin-1").splitlines():
        words = line.split() or [""]
        if words[0] == "format":
            encoding = words[1]
        elif words[0] == "element":
            rows = int(words[2]) if len(words) == 3 and re.fullmatch("[0-9]{1,18}", words[2]) else -1
            if rows < 0:
                raise UserError(f"mesh {path}: the number of an element of its header is not valid: {line}")
            elements.append(_Element(words[1], rows, ()))
        elif words[0] == "property":
            kinds = words[2:4] if words[1] == "list" else words[1:2]
            if (
                not elements
                or any(kind not in _TYPES for kind in kinds)
                or len(words) != len(kinds) + 2 + (words[1] == "list")
            ):
                raise UserError(f"mesh {path}: a property of its header is not valid: {line}")
            is_list = words[1] == "list"
            added = _Property(words[-1], _TYPES[kinds[-1]], _TYPES[kinds[0]] if is_list else None)
            last = elements[-1]
            elements[-1] = _Element(last.name, last.rows, (*last.properties, added))
    if encoding not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise UserError(f"{path} cannot be read as a mesh: its PLY format is {encoding or 'missing'}")
    return elements, data[found.end() :], encoding


def _truncated(path: Path, element: _Element) -> UserError:
    return UserError(
        f"mesh {path} is truncated: its header states {element.rows:,} rows of {element.name}, the file ends before"
    )


class _Ascii:
    """Reads elements from the words of an ASCII file."""

    def __init__(self, body: bytes, path: Path) -> None:
        self._words = body.split()
        self._at, self._path = 0, path

    def read(self, element: _Element) -> _Columns:
        """The columns of the next element."""
        words, properties = self._words, element.properties
        lists = [one for one in properties if one.count_kind]
        if element.rows * max(1, len(properties)) > len(words) - self._at and properties:
            raise _truncated(self._path, element)
        if not lists:
            table = self._take(element.rows * len(properties), element).reshape(element.rows, -1)
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
            one.name: _List(np.array(sizes[one.name], dtype=np.int64), _numbers(values[one.name]))
            if one.count_kind
            else _numbers(values[one.name])
            for one in properties
        }

    def _take(self, count: int, element: _Element) -> Floats:
        if count > len(self._words) - self._at:
            raise _truncated(self._path, element)
        self._at += count
        return _numbers(self._words[self._at - count : self._at])


class _Binary:
    """Reads elements from a binary file."""

    def __init__(self, body: bytes, path: Path, is_big: bool) -> None:
        self._body, self._path, self._order = body, path, ">" if is_big else "<"
        self._at = 0

    def read(self, element: _Element) -> _Columns:
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
                    one.name: _List(
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

    def _same_sizes(self, element: _Element) -> dict[int, int]:
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

    def _row_by_row(self, element: _Element) -> _Columns:
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
        columns: _Columns = {}
        for one in element.properties:
            rows = values[one.name]
            flat = np.concatenate(rows).astype(np.float64)
            sizes = np.array([len(row) for row in rows], dtype=np.int64)
            columns[one.name] = _List(sizes, flat) if one.count_kind else flat
        return columns

    def _values(self, kind: str, count: int, at: int, element: _Element) -> npt.NDArray[Any]:
        if count < 0 or at + count * np.dtype(kind).itemsize > len(self._body):
            raise _truncated(self._path, element)
        return np.frombuffer(self._body, self._order + kind, count, at)


def _numbers(words: Sequence[bytes]) -> Floats:
    return np.array(words).astype(np.float64) if words else np.zeros(0)


def _whole(values: Floats) -> Indices:
    """Indices as integers; one that is none becomes -1, which names no vertex."""
    with np.errstate(invalid="ignore"):
        return np.where(np.abs(values) < 2**53, np.nan_to_num(values), -1.0).astype(np.int64)


def _stacked(columns: _Columns, names: Sequence[str]) -> Floats | None:
    if not all(isinstance(columns.get(name), np.ndarray) for name in names):
        return None
    return np.stack([columns[name] for name in names], axis=1)


def _colours(element: _Element, columns: _Columns) -> Floats | None:
    """Linear colours [rows, 3] of an element, from sRGB as bytes or from 0 to 1; None without."""
    for names in _COLOURS:
        colours = _stacked(columns, names)
        if colours is not None and len(colours):
            kind = next(one.kind for one in element.properties if one.name == names[0])
            white = {"u1": 255.0, "u2": 65535.0}.get(kind, 1.0 if kind.startswith("f") else 255.0)
            return linear_from_srgb(np.clip(np.nan_to_num(colours) / white, 0.0, 1.0))
    return None


def _unrolled(strips: _List) -> list[tuple[int, int, int]]:
    """The triangles of strips, which end at -1."""
    triangles: list[tuple[int, int, int]] = []
    for row in np.split(_whole(strips.values), np.cumsum(strips.sizes)[:-1]):
        strip: list[int] = []
        for vertex in row.tolist():
            if vertex == -1:
                strip = []
                continue
            strip.append(vertex)
            if len(strip) >= 3:
                a, b, c = strip[-3:]
                triangles.append((a, b, c) if len(strip) % 2 else (b, a, c))
    return triangles
