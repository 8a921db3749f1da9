"""Mesh files as trimesh reads them: vertices, triangles, and the material of each."""

from __future__ import annotations

import io
import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from colonnade.errors import UserError
from colonnade.mesh_materials import PLAIN, MeshMaterial, from_gltf, from_mtl

#: As many as a face's material index can tell apart.
MOST_MATERIALS = 256

#: Marks a glTF material's name with its number, since trimesh knows neither transmission nor the file's order.
_MARK = "colonnade material "


@dataclass(frozen=True)
class RawSurface:
    """What a file holds, uncleaned.

    Attributes:
        vertices: [n, 3].
        faces: [m, 3].
        materials: The different ones, at least one.
        face_materials: uint8 [m].
    """

    vertices: npt.NDArray[Any]
    faces: npt.NDArray[Any]
    materials: tuple[MeshMaterial, ...]
    face_materials: npt.NDArray[np.uint8]


def read_surface(path: Path) -> RawSurface:
    """All parts of a mesh file, joined."""
    import logging

    import trimesh

    logging.getLogger("trimesh").setLevel(logging.CRITICAL)
    materials: list[MeshMaterial] = []
    loaded: Any
    if path.suffix.lower() in (".glb", ".gltf"):
        content, materials = _marked_gltf(path)
        resolver = trimesh.resolvers.FilePathResolver(path)
        loaded = trimesh.load_scene(content, file_type=path.suffix.lower()[1:], process=False, resolver=resolver)
    else:
        loaded = trimesh.load_scene(path, process=False)
    parts = [part for part in loaded.dump() if isinstance(part, trimesh.Trimesh)]
    if not parts:
        raise UserError(f"mesh {path} has no faces")
    starts = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    own = [_material_of(part, materials) for part in parts]
    used = tuple(dict.fromkeys(own))
    if len(used) > MOST_MATERIALS:
        raise UserError(f"mesh {path} has {len(used):,} materials: use at most {MOST_MATERIALS}")
    return RawSurface(
        vertices=np.concatenate([part.vertices for part in parts]),
        faces=np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=True)]),
        materials=used,
        face_materials=np.concatenate(
            [
                np.full(len(part.faces), used.index(material), dtype=np.uint8)
                for part, material in zip(parts, own, strict=True)
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


def _marked_gltf(path: Path) -> tuple[io.BytesIO, list[MeshMaterial]]:
    """A glTF file whose materials are named by number, and its materials."""
    data = path.read_bytes()
    binary = data[:4] == b"glTF"
    length = struct.unpack_from("<I", data, 12)[0] if binary else len(data)
    first = 20 if binary else 0
    document = json.loads(data[first : first + length])
    materials = document.get("materials", [])
    for number, material in enumerate(materials):
        material["name"] = f"{_MARK}{number}"
    text = json.dumps(document).encode()
    if binary:
        text += b" " * (-len(text) % 4)
        rest = data[first + length :]
        text = data[:8] + struct.pack("<II", 20 + len(text) + len(rest), len(text)) + b"JSON" + text + rest
    return io.BytesIO(text), [from_gltf(material) for material in materials]
