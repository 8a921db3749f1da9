"""Loads triangle meshes by name, or from a file that trimesh reads (OBJ, PLY, STL, OFF, glTF).

Every loaded mesh is clean: vertices are merged by position, and degenerate faces, duplicate faces and unused vertices
are removed. Smooth normals are computed from the merged faces, weighted by angle; the file's normals are ignored.
"""

from __future__ import annotations

import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from colonnade.common.errors import UserError
from colonnade.common.input_files import is_file, require_regular
from colonnade.common.types import Floats
from colonnade.mesh import catalog, primitives, teapot
from colonnade.mesh.formats import SUFFIXES, read_surface
from colonnade.mesh.materials import PLAIN, MeshMaterial
from colonnade.mesh.mesh import Mesh
from colonnade.mesh.topology import Faces, drop_faces, merge_rows, subdivide, vertex_normals

TEAPOT_LEVEL = 10
TEAPOT_LIMIT = 200


def load_mesh(name_or_path: str | Path) -> Mesh:
    """Load the mesh of a name or a file.

    Names are ``teapot`` and ``teapot:LEVEL``, the solids (``sphere:TRIANGLES``, ``cube`` …), the well-known meshes
    (``bunny`` …), and the files without their suffix in the folders of the environment variable COLONNADE_MESHES.

    Raises:
        UserError: The mesh does not exist or cannot be rendered.
    """
    text = str(name_or_path)
    if isinstance(name_or_path, str) and (built := _built_in(text)) is not None:
        return clean_mesh(*built, name=text)
    looks_like_path = os.sep in text or Path(text).suffix.lower() in SUFFIXES
    if isinstance(name_or_path, str) and not looks_like_path and not is_file(Path(text)):
        found = catalog.find(text)
        mesh = _read(found.path, found.subdivisions)
        return replace(mesh, name=text)
    return _read(Path(text), 0)


def _built_in(name: str) -> tuple[Floats, Faces] | None:
    """Make the teapot or a solid; None for other names."""
    base, colon, argument = name.partition(":")
    if base in primitives.PLAIN and not colon:
        return primitives.PLAIN[base]()
    if base == "teapot":
        return teapot.tessellate(_size(name, argument, TEAPOT_LEVEL, 1, TEAPOT_LIMIT, bool(colon)))
    if base in primitives.SIZED:
        make, default, minimum, maximum = primitives.SIZED[base]
        return make(_size(name, argument, default, minimum, maximum, bool(colon)))
    return None


def _size(name: str, argument: str, default: int, minimum: int, maximum: int, given: bool) -> int:
    if not given:
        return default
    if not re.fullmatch("[0-9]{1,9}", argument) or not minimum <= int(argument) <= maximum:
        raise UserError(f"mesh {name}: the number after the colon must be from {minimum} to {maximum:,}")
    return int(argument)


def _read(path: Path, subdivisions: int) -> Mesh:
    """Read a mesh file and split each triangle into four ``subdivisions`` times."""
    require_regular(path, "mesh file")
    if path.suffix.lower() not in SUFFIXES:
        raise UserError(f"{path}: the suffix of a mesh file must be one of {', '.join(SUFFIXES)}")
    if path.stat().st_size == 0:
        raise UserError(f"mesh file {path} is empty")
    try:
        surface = read_surface(path)
    except (UserError, ImportError, MemoryError):
        raise
    except IndexError:
        raise UserError(f"mesh {path}: a face names a vertex, or a node another part, that does not exist") from None
    except Exception as error:  # readers raise many types on invalid data
        raise UserError(f"{path} cannot be read as a mesh: {type(error).__name__}: {error}") from None
    vertices, faces = surface.vertices, surface.faces
    if len(faces) == 0:
        raise UserError(f"mesh {path} has no faces")
    vertices, faces = np.asarray(vertices, dtype=np.float64), np.asarray(faces, dtype=np.int64)
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise UserError(f"{path} cannot be read as a mesh of triangles")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise UserError(f"mesh {path}: a face names a vertex that does not exist")
    for _ in range(subdivisions):
        vertices, faces = subdivide(vertices, faces)
    return clean_mesh(
        vertices,
        faces.astype(np.int32),
        name=path.stem,
        where=str(path),
        materials=surface.materials,
        face_materials=np.repeat(surface.face_materials, 4**subdivisions),
    )


def clean_mesh(
    vertices: Floats,
    faces: Faces,
    name: str,
    where: str | None = None,
    materials: tuple[MeshMaterial, ...] = (PLAIN,),
    face_materials: npt.NDArray[np.uint8] | None = None,
) -> Mesh:
    """Clean raw vertices [n, 3] and faces [m, 3]; ``where`` names the source in errors.

    Without ``face_materials``, uint8 [m], all faces have the first material.

    Raises:
        UserError: A vertex is not finite, the size is out of range, or no face has an area.
    """
    label = f"mesh {where or name}"
    if len(faces) == 0:
        raise UserError(f"{label} has no faces")
    if not np.isfinite(vertices).all():
        bad = int(np.flatnonzero(~np.isfinite(vertices).all(axis=1))[0])
        raise UserError(f"{label}: vertex {bad} is not a finite number: repair the file")
    source_count = len(faces)
    used, numbered = np.unique(faces, return_inverse=True)
    vertices = vertices[used]
    if np.abs(vertices).max() > 1e100:
        raise UserError(f"{label} has coordinates beyond 1e100: scale it down")
    merged, index = merge_rows(vertices + 0.0)
    corners = index[numbered.reshape(-1, 3)]
    edge = float((merged.max(axis=0) - merged.min(axis=0)).max())
    if edge > 0:
        keep = drop_faces((merged - merged.min(axis=0)) / edge, corners)
    if edge == 0 or len(keep) == 0:
        raise UserError(f"{label} has only degenerate triangles ({source_count:,}, all without area)")
    if edge < 1e-100:
        raise UserError(f"{label} is smaller than 1e-100: scale it up")
    used, renumbered = np.unique(corners[keep], return_inverse=True)
    vertices, faces = merged[used], renumbered.reshape(-1, 3).astype(np.int32)
    return Mesh(
        vertices=vertices,
        faces=faces,
        vertex_normals=vertex_normals(vertices, faces),
        materials=materials,
        face_materials=np.zeros(len(faces), dtype=np.uint8) if face_materials is None else face_materials[keep],
        source_faces=keep.astype(np.int32),
        source_count=source_count,
        name=name,
    )
