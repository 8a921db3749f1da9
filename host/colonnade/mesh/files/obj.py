"""Reads OBJ files with their MTL files: corners with normals, materials, base-colour textures and vertex colours.

This is our own code because trimesh splits concave polygons wrongly and does not say what it leaves out.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from colonnade.common.errors import UserError
from colonnade.common.input_files import text_of
from colonnade.common.srgb import linear_from_srgb
from colonnade.common.types import Floats, Indices
from colonnade.mesh import losses as lost
from colonnade.mesh.files.obj_textures import MtlTextures, TextureMap, uvs_of
from colonnade.mesh.files.resolver import References
from colonnade.mesh.losses import Losses
from colonnade.mesh.materials.materials import BRIGHTEST, PLAIN, MeshMaterial, from_mtl, mtl_losses, unread_values
from colonnade.mesh.materials.surface import RawSurface, from_polygons, linear_colours
from colonnade.mesh.materials.texture import MAX_UV, Texture

#: Statements of curves, surfaces and their parameter space.
_CURVES = ("curv", "curv2", "surf")
#: Keywords of colours in MTL files; the filter `Tf` is a share of the light.
_COLOURS = ("kd", "ke")
#: Statements of names, in which # begins no comment.
_NAMES = re.compile("usemtl|mtllib|newmtl|map_.*|bump|disp|decal|refl|norm", re.IGNORECASE)
#: Corners that all have a position and a normal.
_COMPLETE = re.compile(r"[^\s/]+/[^\s/]+/[^\s/]+(?: [^\s/]+/[^\s/]+/[^\s/]+)*")


def _statement(line: str) -> tuple[str, str]:
    """The keyword of a line, and what follows it without a comment."""
    keyword, _, rest = line.strip().partition(" ")
    if "#" in line and not _NAMES.fullmatch(keyword):
        keyword, _, rest = re.sub(r"(?<!\S)#.*", "", line).strip().partition(" ")
    return keyword, rest


class _Statements:
    """The statements of a file, sorted by their keyword."""

    def __init__(self, text: str) -> None:
        self.vertices: list[str] = []
        self.normals: list[str] = []
        self.uvs: list[str] = []
        self.faces: list[str] = []
        #: Vertices, normals and texture coordinates before each face, for relative indices.
        self.counts: list[tuple[int, int, int]] = []
        self.face_materials: list[int] = []
        self.names: list[str] = []
        self.libraries: list[str] = []
        self.losses: dict[str, int] = {}
        groups: set[str] = set()
        index, material = {"": 0}, 0
        for line in text.splitlines():
            keyword, rest = _statement(line)
            if keyword == "v":
                self.vertices.append(rest)
            elif keyword == "f":
                self.faces.append(rest)
                self.counts.append((len(self.vertices), len(self.normals), len(self.uvs)))
                self.face_materials.append(material)
            elif keyword == "vn":
                self.normals.append(rest)
            elif keyword == "vt":
                self.uvs.append(rest)
            elif keyword == "usemtl":
                material = index.setdefault(rest.strip(), len(index))
            elif keyword == "mtllib":
                self.libraries.append(rest.strip().strip('"'))
            elif keyword == "s" and rest.strip() not in ("off", "0"):
                groups.add(rest.strip())
            elif keyword in ("l", "p") or keyword in _CURVES:
                self.losses[keyword] = self.losses.get(keyword, 0) + 1
        self.names = list(index)
        self.groups = len(groups)


def read_obj(data: bytes, path: Path, references: References, losses: Losses) -> RawSurface:
    """Read an OBJ file. A face is a polygon in the order of the file.

    Raises:
        UserError: A face names a vertex or a normal that does not exist, or an MTL file is invalid.
    """
    file = _Statements(re.sub(r"\\\r?\n", " ", text_of(data)).replace("\t", " "))
    vertices, vertex_colours = _vertices(file.vertices, losses)
    normals = _rows(file.normals, 3)[:, :3]
    sizes, corners, corner_normals, corner_uvs = _corners(file, path, losses)
    odd = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if len(odd) and len(named := np.intersect1d(odd, corners)):
        raise UserError(f"mesh {path}: vertex {named[0] + 1} is not a finite number: repair the file")
    losses.add(lost.POINTS, file.losses.get("p", 0))
    losses.add(lost.LINES, file.losses.get("l", 0))
    losses.add(lost.CURVES, sum(file.losses.get(name, 0) for name in _CURVES))
    if file.groups > 1 and not len(normals):
        losses.add(lost.GROUPS, file.groups)
    materials, used, maps, textures = _materials(file, references, losses)
    uvs = None
    if textures:
        materials, used, uvs = _placed(file, materials, used, maps, sizes, corner_uvs, losses)
    return from_polygons(
        vertices,
        corners,
        sizes,
        losses,
        corner_normals=np.concatenate([normals, np.zeros((1, 3))])[corner_normals] if len(normals) else None,
        materials=materials,
        polygon_materials=used,
        vertex_colours=vertex_colours,
        textures=textures,
        corner_uvs=uvs,
    )


def _placed(
    file: _Statements,
    materials: tuple[MeshMaterial, ...],
    used: Indices,
    maps: Sequence[TextureMap | None],
    sizes: Indices,
    corner_uvs: Indices,
    losses: Losses,
) -> tuple[tuple[MeshMaterial, ...], Indices, Floats]:
    """Materials, the material of each polygon, and the texture coordinates of the corners.

    A polygon with a corner without texture coordinates, or with one beyond `MAX_UV`, shows no texture.
    """
    owner = np.repeat(np.arange(len(sizes)), sizes)
    rows = _rows([f"{line} 0" for line in file.uvs], 2)[:, :2]  # v is 0 unless given
    values = np.concatenate([rows, np.zeros((1, 2))])[corner_uvs]
    uvs = uvs_of(values, maps, used[owner])
    is_known = (corner_uvs >= 0) & (np.abs(uvs) <= MAX_UV).all(axis=1)
    lacks = np.bincount(owner, ~is_known, len(sizes)) > 0
    is_textured = np.array([material.texture is not None for material in materials])[used]
    losses.add(lost.NO_UVS, int((is_textured & lacks).sum()))
    plain = tuple(replace(material, texture=None) for material in materials)
    uvs = np.where(is_known[:, None], uvs, 0.0)
    return (*materials, *plain), used + np.where(lacks, len(materials), 0), uvs


def _rows(lines: Sequence[str], columns: int) -> Floats:
    """The numbers of each line, at least so many, float64 [lines, numbers of the shortest line]."""
    rows = [line.split() for line in lines]
    shortest = min(map(len, rows), default=columns)
    if shortest < columns:
        raise ValueError(f"a vertex or normal has fewer than {columns} numbers")
    if any(len(row) > shortest for row in rows):
        rows = [row[:shortest] for row in rows]
    return np.array(list(map(float, chain.from_iterable(rows))), dtype=np.float64).reshape(-1, shortest)


def _vertices(lines: Sequence[str], losses: Losses) -> tuple[Floats, Floats | None]:
    """Positions [n, 3] and, if all vertices have them, linear colours [n, 3]."""
    values = _rows(lines, 3)
    if values.shape[1] < 6:
        coloured = sum(line.count(" ") >= 5 and len(line.split()) >= 6 for line in lines)
        losses.add(lost.SOME_COLOURS, coloured)
        return values[:, :3], None
    losses.add(lost.ALPHA, int((values[:, 6] < 1.0).sum()) if values.shape[1] > 6 else 0)
    return values[:, :3], linear_colours(values[:, 3:6], None, losses)


def _indices(words: Sequence[str]) -> tuple[list[int], list[int | None], list[int | None]]:
    """Vertex, normal and position of each corner, as the file numbers them; None without one."""
    joined = " ".join(words)
    if "/" not in joined:
        return list(map(int, words)), [None] * len(words), [None] * len(words)
    if _COMPLETE.fullmatch(joined):
        numbers = list(map(int, joined.replace("/", " ").split()))
        return numbers[::3], list(numbers[2::3]), list(numbers[1::3])
    parts = [word.split("/") for word in words]

    def numbers_of(place: int) -> list[int | None]:
        return [int(part[place]) if len(part) > place and part[place] else None for part in parts]

    return [int(part[0]) for part in parts], numbers_of(2), numbers_of(1)


def _corners(file: _Statements, path: Path, losses: Losses) -> tuple[Indices, Indices, Indices, Indices]:
    """Sizes of the polygons, and vertex, normal and position (-1: none) of each corner."""
    words = [face.split() for face in file.faces]
    sizes = np.array(list(map(len, words)), dtype=np.int64)
    try:
        vertices, normals, uvs = _indices(list(chain.from_iterable(words)))
    except ValueError:
        raise UserError(f"mesh {path}: a vertex index of a face is not an integer") from None
    if not file.normals:
        losses.add(lost.MISSING, sum(index is not None for index in normals))
        normals = [None] * len(normals)
    for one, several, indices, count in (
        ("vertex", "vertices", vertices, len(file.vertices)),
        ("normal", "normals", normals, len(file.normals)),
    ):
        given = [index for index in indices if index is not None]
        if 0 in given:
            raise UserError(f"mesh {path}: a face names {one} 0; OBJ files number {several} from 1")
        for worst in (min(given, default=1), max(given, default=1)):
            if abs(worst) > count and given:
                raise UserError(f"mesh {path}: a face names {one} {worst}, but the file has {count:,} {several}")
    corners = np.array(vertices, dtype=np.int64)
    beyond = 1 << 40  # indices of texture coordinates are not checked
    corner_normals, corner_uvs = (
        np.array([0 if index is None else max(-beyond, min(index, beyond)) for index in indices], dtype=np.int64)
        for indices in (normals, uvs)
    )
    before = np.repeat(np.array(file.counts, dtype=np.int64).reshape(-1, 3), sizes, axis=0)
    corners = np.where(corners < 0, before[:, 0] + corners, corners - 1)
    corner_normals = np.where(corner_normals < 0, before[:, 1] + corner_normals, corner_normals - 1)
    corner_uvs = np.where(corner_uvs < 0, before[:, 2] + corner_uvs, corner_uvs - 1)
    # A position that does not exist shows no texture, as none does
    corner_uvs = np.where(corner_uvs < len(file.uvs), corner_uvs, -1)
    if len(corners) and corners.min() < 0:
        raise UserError(f"mesh {path}: a relative index of a face names a vertex before the first")
    return sizes, corners, np.maximum(corner_normals, -1), np.maximum(corner_uvs, -1)


def _materials(
    file: _Statements, references: References, losses: Losses
) -> tuple[tuple[MeshMaterial, ...], Indices, list[TextureMap | None], tuple[Texture, ...]]:
    """The materials of the faces, that of each face, int64, their texture maps, and the textures."""
    defined: dict[str, Mapping[str, Any]] = {}
    is_missing = False
    for names in file.libraries:
        library = references.materials(names)
        libraries = [library] if library is not None else [references.materials(name) for name in names.split()]
        missing = sum(content is None for content in libraries)
        losses.add(lost.NO_MATERIALS, 1 if missing == len(libraries) else missing)
        is_missing |= missing > 0
        for content in libraries:
            defined |= {} if content is None else parse_mtl(content)
    used = np.array(file.face_materials, dtype=np.int64)
    materials = [PLAIN] * len(file.names)
    maps: list[TextureMap | None] = [None] * len(file.names)
    textures = MtlTextures(references, losses)
    for index in np.unique(used):
        name = file.names[index]
        if name in defined:
            materials[index], maps[index] = textures.textured(from_mtl(defined[name]), defined[name])
            losses.update(mtl_losses(defined[name]))
            for value in unread_values(defined[name]):
                losses.add(lost.NO_VALUES, name=value)
            losses.add(lost.NEGATIVE_SHININESS, any(word.startswith("-") for word in defined[name].get("ns", [])))
        elif name and (defined or not is_missing):
            losses.add(lost.UNKNOWN_MATERIALS)
    textures.reader.count_losses()
    return tuple(materials), used, maps, tuple(textures.reader.textures)


def parse_mtl(text: str) -> dict[str, dict[str, Sequence[Any]]]:
    """The materials of an MTL file by name: the words after each keyword, in lower case; of `_COLOURS` linear numbers.

    The format leaves the space of its colours open. Viewers take them as sRGB: three.js' MTLLoader and F3D decode them,
    Babylon.js, Godot and those of OpenGL's fixed colours show them as they are. Blender reads and writes linear ones,
    so those of a file that begins with its name are linear.
    """
    materials: dict[str, dict[str, Sequence[Any]]] = {}
    current: dict[str, Sequence[Any]] = {}
    is_linear = re.match(r"\s*#\s*Blender\b", text) is not None
    for line in text.replace("\t", " ").splitlines():
        keyword, rest = _statement(line)
        words = rest.split()
        if keyword.lower() == "newmtl":
            current = materials.setdefault(" ".join(words), {})
        elif keyword.lower() in _COLOURS and not is_linear:
            current[keyword.lower()] = _linear(words)
        elif keyword:
            current[keyword.lower()] = words
    return materials


def _linear(words: Sequence[str]) -> Sequence[Any]:
    """Linear numbers of sRGB ones; the words if they are none."""
    try:
        values = np.array(words[:3], dtype=np.float64)
    except ValueError:
        return words
    is_colour = len(values) == 3 and bool(np.isfinite(values).all())
    return linear_from_srgb(np.clip(values, 0.0, BRIGHTEST)).tolist() if is_colour else words
