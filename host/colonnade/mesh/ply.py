"""Reads PLY files: polygons and triangle strips with normals and colours of vertices, and colours of faces.

This is our own code because trimesh reads neither strips nor the normals of all files, and splits concave polygons
wrongly.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from colonnade.common.errors import UserError
from colonnade.common.srgb import linear_from_srgb
from colonnade.common.types import Floats, Indices
from colonnade.mesh import losses as lost
from colonnade.mesh.losses import Losses
from colonnade.mesh.ply_elements import AsciiReader, BinaryReader, Columns, Element, ListColumn, read_header
from colonnade.mesh.surface import RawSurface, from_polygons

_COLOURS = (("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue"))
#: Names of the list of a face's vertices.
_CORNERS = ("vertex_indices", "vertex_index")


def read_ply(data: bytes, path: Path, losses: Losses) -> RawSurface:
    """Read a PLY file, ASCII or binary.

    Raises:
        UserError: The file is invalid or truncated, or a face names a vertex that does not exist.
    """
    header, body, encoding = read_header(data, path)
    reader = (
        AsciiReader(body, path) if encoding == "ascii" else BinaryReader(body, path, encoding == "binary_big_endian")
    )
    content = {element.name: (element, reader.read(element)) for element in header}
    if "vertex" not in content:
        raise UserError(f"mesh {path} has no vertices")
    vertex = content["vertex"][1]
    vertices = _stacked(vertex, ("x", "y", "z"))
    if vertices is None:
        raise UserError(f"mesh {path}: its vertices lack x, y or z")
    normals = _stacked(vertex, ("nx", "ny", "nz"))
    face_element, face = content.get("face", (None, {}))
    corners = next((face[name] for name in _CORNERS if isinstance(face.get(name), ListColumn)), None)
    sizes = np.zeros(0, dtype=np.int64) if corners is None else corners.sizes
    flat = np.zeros(0, dtype=np.int64) if corners is None else _whole(corners.values)
    polygon_colours = None if face_element is None else _colours(face_element, face)
    if isinstance(strips := content.get("tristrips", (None, {}))[1].get("vertex_indices"), ListColumn):
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


def _whole(values: Floats) -> Indices:
    """Indices as integers; one that is none becomes -1, which names no vertex."""
    with np.errstate(invalid="ignore"):
        return np.where(np.abs(values) < 2**53, np.nan_to_num(values), -1.0).astype(np.int64)


def _stacked(columns: Columns, names: Sequence[str]) -> Floats | None:
    if not all(isinstance(columns.get(name), np.ndarray) for name in names):
        return None
    return np.stack([columns[name] for name in names], axis=1)


def _colours(element: Element, columns: Columns) -> Floats | None:
    """Linear colours [rows, 3] of an element, from sRGB as bytes or from 0 to 1; None without."""
    for names in _COLOURS:
        colours = _stacked(columns, names)
        if colours is not None and len(colours):
            kind = next(one.kind for one in element.properties if one.name == names[0])
            white = {"u1": 255.0, "u2": 65535.0}.get(kind, 1.0 if kind.startswith("f") else 255.0)
            return linear_from_srgb(np.clip(np.nan_to_num(colours) / white, 0.0, 1.0))
    return None


def _unrolled(strips: ListColumn) -> list[tuple[int, int, int]]:
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
