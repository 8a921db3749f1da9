"""Reads OFF files: polygons, normals and colours of vertices, colours of faces.

This is our own code because trimesh splits concave polygons wrongly and drops colours.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from colonnade.common.errors import UserError
from colonnade.common.input_files import text_of
from colonnade.common.srgb import linear_from_srgb
from colonnade.common.types import Floats
from colonnade.mesh import losses as lost
from colonnade.mesh.losses import Losses
from colonnade.mesh.materials.surface import RawSurface, from_polygons, linear_colours

#: The keyword of the header: texture coordinates, colours and normals of the vertices.
_KEYWORD = re.compile(r"(ST)?(C)?(N)?OFF")


def read_off(data: bytes, path: Path, losses: Losses) -> RawSurface:
    """Read an ASCII OFF file.

    Raises:
        UserError: The file is invalid or truncated, or a face names a vertex that does not exist.
    """
    text = re.sub(r"#[^\r\n]*", "", text_of(data))
    # Some programs write the counts right after the keyword, as those of ModelNet40
    text = re.sub(r"\A(\s*[A-Z]*OFF)(?=[0-9])", r"\1 ", text)
    lines = [words for line in text.splitlines() if (words := line.split())]
    keyword = _KEYWORD.fullmatch(lines[0][0]) if lines else None
    if keyword is None or "BINARY" in lines[0]:
        raise UserError(f"{path} cannot be read as a mesh: it is no text that starts with OFF, COFF or NOFF")
    counts = lines[0][1:] or (lines[1] if len(lines) > 1 else [])
    first = 1 if lines[0][1:] else 2
    if len(counts) < 2 or not all(re.fullmatch("[0-9]{1,18}", count) for count in counts[:2]):
        raise UserError(f"{path} cannot be read as a mesh: its OFF header has no numbers of vertices and faces")
    vertex_count, face_count = int(counts[0]), int(counts[1])
    if first + vertex_count + face_count > len(lines):
        raise UserError(
            f"mesh {path} is truncated: its header states {vertex_count:,} vertices and {face_count:,} faces"
        )
    rows = lines[first : first + vertex_count]
    has_normals, has_colours = keyword[3] is not None, keyword[2] is not None
    if not has_normals and not has_colours:
        has_colours = bool(rows) and all(len(row) in (6, 7) for row in rows)  # some programs leave the C out
    columns = 3 + 3 * has_normals + 3 * has_colours
    if any(len(row) < columns for row in rows):
        raise UserError(f"mesh {path}: a vertex has fewer than {columns} numbers")
    values = np.array([[float(word) for word in row[:columns]] for row in rows], dtype=np.float64).reshape(-1, columns)
    polygons = lines[first + vertex_count : first + vertex_count + face_count]
    counts_of_faces = [int(row[0]) for row in polygons]
    if any(not 0 <= size < len(row) for size, row in zip(counts_of_faces, polygons, strict=True)):
        raise UserError(f"mesh {path}: a face has fewer corners than it states")
    sizes = np.array(counts_of_faces, dtype=np.int64)
    corners = [int(word) for size, row in zip(sizes, polygons, strict=True) for word in row[1 : 1 + size]]
    worst = [index for index in (min(corners, default=0), max(corners, default=-1)) if not 0 <= index < vertex_count]
    if corners and worst:
        raise UserError(f"mesh {path}: a face names vertex {worst[0]}, but the file has {vertex_count:,} vertices")
    flat = np.array(corners, dtype=np.int64)
    colours = [_colour(row[1 + size :]) for size, row in zip(sizes, polygons, strict=True)]
    if has_colours:
        alphas = np.array([float(row[columns]) if len(row) > columns else np.inf for row in rows])
        losses.add(lost.ALPHA, int((alphas < _white(values[:, columns - 3 :])).sum()))
    losses.add(
        lost.FACE_ALPHA, sum(_is_transparent(row[1 + size :]) for size, row in zip(sizes, polygons, strict=True))
    )
    return from_polygons(
        values[:, :3],
        flat,
        sizes,
        losses,
        corner_normals=values[flat, 3:6] if has_normals else None,
        vertex_colours=linear_colours(values[:, columns - 3 :], None, losses) if has_colours else None,
        polygon_colours=np.array(colours) if any(colour[0] >= 0 for colour in colours) else None,
    )


def _colour(words: list[str]) -> tuple[float, float, float]:
    """The linear colour after a face's corners: three or four numbers; NaN for none."""
    if len(words) < 3:
        return np.nan, np.nan, np.nan
    white = 255.0 if all("." not in word for word in words) else 1.0
    red, green, blue = linear_from_srgb(np.clip(np.nan_to_num([float(word) for word in words[:3]]) / white, 0.0, 1.0))
    return red, green, blue


def _is_transparent(words: list[str]) -> bool:
    """Whether the fourth number after a face's corners is below that of an opaque face."""
    return len(words) > 3 and float(words[3]) < (255.0 if all("." not in word for word in words[:3]) else 1.0)


def _white(colours: Floats) -> float:
    """The largest value of colours without a type: that of bytes, or 1."""
    return 255.0 if bool((colours > 1.0).any()) else 1.0
