"""Reads PLY files: polygons and triangle strips with normals, colours and textures.

The format names no properties; those that are read are the ones that MeshLab, Blender, Assimp, trimesh and scanners
write. Colours are sRGB, as bytes or from 0 to 1.

This is our own code because trimesh reads neither strips nor the normals of all files, and splits concave polygons
wrongly.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from colonnade.common.errors import UserError
from colonnade.common.types import Floats, Indices
from colonnade.mesh import losses as lost
from colonnade.mesh.files.ply_elements import BinaryReader, Columns, Element, ListColumn, read_ascii, read_header
from colonnade.mesh.files.ply_textures import textured_polygons
from colonnade.mesh.files.resolver import References
from colonnade.mesh.losses import Losses
from colonnade.mesh.materials.materials import PLAIN
from colonnade.mesh.materials.surface import RawSurface, from_polygons, linear_colours

#: Names of a colour and its alpha.
_COLOURS = (
    ("red", "green", "blue", "alpha"),
    ("r", "g", "b", "a"),
    ("diffuse_red", "diffuse_green", "diffuse_blue", "diffuse_alpha"),
    ("color_0", "color_1", "color_2", "color_3"),
)
#: Values of a scan that no picture shows.
_MEASURES = ("confidence", "intensity", "quality")
#: Properties that a note names.
_NAMED = 8
#: Names of the list of a face's vertices.
_CORNERS = ("vertex_indices", "vertex_index")


def read_ply(data: bytes, path: Path, references: References, losses: Losses) -> RawSurface:
    """Read a PLY file, ASCII or binary.

    Raises:
        UserError: The file is invalid or truncated, or a face names a vertex that does not exist.
    """
    header, body, encoding = read_header(data, path)
    if encoding == "ascii":
        columns = read_ascii(body, path, header, losses)
    else:
        reader = BinaryReader(body, path, encoding == "binary_big_endian")
        columns = [reader.read(element) for element in header]
    content = {element.name: (element, values) for element, values in zip(header, columns, strict=True)}
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
    polygon_colours = None if face_element is None else _colours(face_element, face, losses)
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
    losses.add(lost.ALPHA, _transparent(*content["vertex"]))
    losses.add(lost.FACE_ALPHA, 0 if face_element is None else _transparent(face_element, face))
    names = re.findall(rb"(?m)^comment[ \t]+TextureFile[ \t]+(\S.*)$", data[: len(data) - len(body)])
    textured = textured_polygons(
        [name.decode("utf-8", "replace").strip() for name in names], flat, sizes, vertex, face, references, losses
    )
    read = {"x", "y", "z", "nx", "ny", "nz", *_CORNERS, *_MEASURES, *(textured.read if textured else ())}
    unread = [
        f"{name}.{one.name}"
        for name, (element, columns) in content.items()
        for one in element.properties
        if element.rows and name != "edge" and one.name not in read | set(_colour_names(columns) or ())
    ]
    if unread and len(sizes):
        losses.add(lost.unread_properties(unread[:_NAMED], len(unread) > _NAMED), len(unread))
    return from_polygons(
        vertices,
        flat,
        sizes,
        losses,
        corner_normals=None if normals is None else normals[flat],
        vertex_colours=_colours(*content["vertex"], losses),
        polygon_colours=polygon_colours,
        materials=(PLAIN,) if textured is None else textured.materials,
        polygon_materials=None if textured is None else textured.polygon_materials,
        textures=() if textured is None else textured.textures,
        corner_uvs=None if textured is None else textured.corner_uvs,
    )


def _whole(values: Floats) -> Indices:
    """Indices as integers; one that is none becomes -1, which names no vertex."""
    with np.errstate(invalid="ignore"):
        return np.where(np.abs(values) < 2**53, np.nan_to_num(values), -1.0).astype(np.int64)


def _stacked(columns: Columns, names: Sequence[str]) -> Floats | None:
    if not all(isinstance(columns.get(name), np.ndarray) for name in names):
        return None
    return np.stack([columns[name] for name in names], axis=1)


def _colour_names(columns: Columns) -> tuple[str, ...] | None:
    """The names of an element's colour and alpha; None without a colour."""
    return next((names for names in _COLOURS if _stacked(columns, names[:3]) is not None), None)


def _white(element: Element, name: str) -> float | None:
    """The largest value of a property of colours; None for real numbers."""
    kind = next(one.kind for one in element.properties if one.name == name)
    return {"u1": 255.0, "u2": 65535.0}.get(kind, None if kind.startswith("f") else 255.0)


def _colours(element: Element, columns: Columns, losses: Losses) -> Floats | None:
    """Linear colours [rows, 3] of an element; None without."""
    names = _colour_names(columns)
    colours = None if names is None else _stacked(columns, names[:3])
    if names is None or colours is None or not len(colours):
        return None
    return linear_colours(colours, _white(element, names[0]), losses)


def _transparent(element: Element, columns: Columns) -> int:
    """Rows of an element with an alpha below that of an opaque one."""
    names = _colour_names(columns)
    alpha = None if names is None else columns.get(names[3])
    return int((alpha < (_white(element, names[3]) or 1.0)).sum()) if names and isinstance(alpha, np.ndarray) else 0


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
