"""Reads mesh files with trimesh: vertices, triangles, and a material for each triangle."""

from __future__ import annotations

import io
import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from colonnade.common.errors import UserError
from colonnade.common.input_files import parse_json, read_input
from colonnade.common.limits import MAX_MESH_BYTES
from colonnade.mesh.checks import check_gltf, check_obj, check_ply
from colonnade.mesh.materials import PLAIN, MeshMaterial, from_gltf, from_mtl

#: Suffixes of mesh files.
SUFFIXES = (".ply", ".obj", ".stl", ".off", ".glb", ".gltf")

#: Limit of the 8-bit material index of a face.
MAX_MATERIALS = 256

#: Prefix of glTF material names, followed by the index: trimesh keeps neither transmission nor the file's order.
_MARK = "colonnade material "


@dataclass(frozen=True)
class RawSurface:
    """The content of a mesh file, before cleaning.

    Attributes:
        vertices: [n, 3].
        faces: [m, 3].
        materials: Distinct materials, at least one.
        face_materials: uint8 [m], index into `materials`.
    """

    vertices: npt.NDArray[Any]
    faces: npt.NDArray[Any]
    materials: tuple[MeshMaterial, ...]
    face_materials: npt.NDArray[np.uint8]


def read_surface(path: Path) -> RawSurface:
    """Read a mesh file and join its parts.

    Raises:
        UserError: The file is invalid, or has no faces or too many materials.
    """
    import logging

    import trimesh

    from colonnade.mesh.resolver import MeshResolver

    logging.getLogger("trimesh").setLevel(logging.CRITICAL)
    materials: list[MeshMaterial] = []
    content = read_input(path, "the mesh", MAX_MESH_BYTES)
    kind = path.suffix.lower()[1:]
    if kind in ("glb", "gltf"):
        content, materials = _marked_gltf(content, path)
    elif kind == "obj":
        check_obj(content, path)
    elif kind == "ply":
        check_ply(content, path)
    resolver = MeshResolver(path)
    try:
        loaded: Any = trimesh.load_scene(io.BytesIO(content), file_type=kind, process=False, resolver=resolver)
    finally:
        if resolver.refused is not None:
            raise resolver.refused
    parts = [part for part in loaded.dump() if isinstance(part, trimesh.Trimesh)]
    if not parts:
        raise UserError(f"mesh {path} has no faces")
    starts = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    part_materials = [_material_of(part, materials) for part in parts]
    used = tuple(dict.fromkeys(part_materials))
    if len(used) > MAX_MATERIALS:
        raise UserError(f"mesh {path} has {len(used):,} materials: use at most {MAX_MATERIALS}")
    return RawSurface(
        vertices=np.concatenate([part.vertices for part in parts]),
        faces=np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=True)]),
        materials=used,
        face_materials=np.concatenate(
            [
                np.full(len(part.faces), used.index(material), dtype=np.uint8)
                for part, material in zip(parts, part_materials, strict=True)
            ]
        ),
    )


def _material_of(part: Any, materials: list[MeshMaterial]) -> MeshMaterial:
    material = getattr(part.visual, "material", None)
    name = str(getattr(material, "name", "") or "")
    if name.startswith(_MARK):
        return materials[int(name[len(_MARK) :])]
    entries = getattr(material, "kwargs", None)
    return from_mtl(entries) if entries else PLAIN


def _marked_gltf(data: bytes, path: Path) -> tuple[bytes, list[MeshMaterial]]:
    """Replace a glTF file's materials by numbered names and remove its textures; also returns the materials."""
    binary = data[:4] == b"glTF"
    length = struct.unpack_from("<I", data, 12)[0] if binary else len(data)
    first = 20 if binary else 0
    document = parse_json(
        data[first : first + length], f"{path} cannot be read as a mesh: its glTF document", len(data)
    )
    check_gltf(document, path)
    materials = document.get("materials", [])
    if materials:
        document["materials"] = [{"name": f"{_MARK}{number}"} for number in range(len(materials))]
    for unused in ("images", "textures", "samplers"):
        document.pop(unused, None)
    text = json.dumps(document).encode()
    if binary:
        text += b" " * (-len(text) % 4)
        rest = data[first + length :]
        text = data[:8] + struct.pack("<II", 20 + len(text) + len(rest), len(text)) + b"JSON" + text + rest
    return text, [from_gltf(material) for material in materials]
