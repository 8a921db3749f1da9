"""Mesh files with a texture."""

from __future__ import annotations

import base64
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from colonnade.mesh.files.formats import read_surface
from colonnade.mesh.materials.materials import MeshMaterial

#: Red, green, blue, white, from the upper left corner on.
FOUR = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)


def png(pixels: np.ndarray) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG")
    return stream.getvalue()


def gltf(folder: Path, pixels: np.ndarray = FOUR, **changes: Any) -> Path:
    """A triangle with a texture that a buffer holds."""
    picture = png(pixels)
    arrays = [np.eye(3, dtype=np.float32), np.array([(0, 0), (1, 0), (0, 1)], np.float32)]
    data = b"".join(array.tobytes() for array in arrays) + picture
    document = {
        "asset": {"version": "2.0"},
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}],
        "materials": [
            {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0}, "doubleSided": True}
        ],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"wrapS": 33648, "wrapT": 33071}],
        "images": [{"bufferView": 2, "mimeType": "image/png"}],
        "accessors": [{"bufferView": i, "componentType": 5126, "count": 3, "type": f"VEC{3 - i}"} for i in range(2)],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 24},
            {"buffer": 0, "byteOffset": 60, "byteLength": len(picture)},
        ],
        "buffers": [{"byteLength": len(data), "uri": "data:;base64," + base64.b64encode(data).decode()}],
    }
    (folder / "a.gltf").write_text(json.dumps(document | changes))
    return folder / "a.gltf"


def of_mtl(folder: Path, *lines: str) -> MeshMaterial:
    """The material of lines of an MTL file, whose colours are linear."""
    (folder / "a.mtl").write_text("\n".join(("# Blender", "newmtl a", *lines)))
    (folder / "a.obj").write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n")
    return read_surface(folder / "a.obj").surface.materials[1]
