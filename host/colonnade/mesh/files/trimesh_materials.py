"""The materials and pictures of trimesh as those of glTF, for `colonnade.mesh.files.trimesh_program`."""

from __future__ import annotations

import io
import json
import posixpath
from typing import Any
from urllib.parse import quote, unquote

import numpy as np
from PIL import Image, PngImagePlugin

from colonnade.common.srgb import linear_from_srgb
from colonnade.common.types import Floats
from colonnade.mesh import losses as lost
from colonnade.mesh.files.glb import Glb
from colonnade.mesh.files.mesh_archive import MeshArchive
from colonnade.mesh.losses import Losses


class Pictures:
    """The pictures of materials.

    For the name of a file trimesh gets a picture of one pixel with a number, by which the file is found here. The host
    reads it, beside the mesh or in the archive.

    Attributes:
        images: Those of the glTF document.
    """

    def __init__(self, glb: Glb, losses: Losses, archive: MeshArchive | None, folder: str) -> None:
        self._glb, self._losses, self._archive, self._folder = glb, losses, archive, folder
        self._names: list[str] = []
        self._found: dict[str, int | None] = {}
        self.images: list[dict[str, Any]] = []

    def get(self, name: str) -> bytes:
        """A picture with a number for a name; a method of trimesh's resolvers."""
        info, content = PngImagePlugin.PngInfo(), io.BytesIO()
        info.add_text("number", str(len(self._names)))
        self._names.append(name)
        Image.new("L", (1, 1)).save(content, "PNG", pnginfo=info)
        return content.getvalue()

    def texture(self, picture: Any) -> dict[str, int] | None:
        """A material's reference to a picture; None without one, or if its file is missing."""
        if picture is None:
            return None
        number = picture.info.get("number")
        key = str(id(picture)) if number is None else self._names[int(number)]
        if key not in self._found:
            # A picture without a number is one of the archive that trimesh has opened, and not decoded
            image = self._image(key) if number is not None else self._embedded(picture.fp.getvalue())
            self._losses.add(lost.NO_PICTURES, image is None, key)
            self._found[key] = None if image is None else len(self.images)
            self.images += [] if image is None else [image]
        index = self._found[key]
        return None if index is None else {"index": index}

    def _image(self, name: str) -> dict[str, Any] | None:
        if self._archive is None:
            return {"uri": quote(unquote(name))}
        path = posixpath.normpath(posixpath.join(self._folder, unquote(name)))
        members = self._archive.names
        same = [one for one in members if posixpath.basename(one) == posixpath.basename(path)]
        found = path if path in members else next(iter(same), None)
        if found is not None and found.lower().endswith(".bmp"):
            return self._embedded(self._archive.read(found))
        return None if found is None else {"uri": quote(found)}

    def _embedded(self, data: bytes) -> dict[str, Any]:
        """A picture's bytes; those of a BMP file, which the host does not read, as PNG."""
        if data.startswith(b"BM"):
            content = io.BytesIO()
            Image.open(io.BytesIO(data), formats=["BMP"]).save(content, "PNG")
            data = content.getvalue()
        return {"bufferView": self._glb.view(data)}


class Materials:
    """The materials, each once.

    Attributes:
        written: Those of the glTF document.
    """

    def __init__(self, pictures: Pictures, is_linear: bool) -> None:
        self._pictures, self._is_linear = pictures, is_linear
        self._numbers: dict[str, int] = {}
        self.written: list[dict[str, Any]] = []

    def linear(self, colours: Floats) -> Floats:
        """Linear colours of those of the file."""
        return colours if self._is_linear else linear_from_srgb(colours)

    def number(self, material: Any) -> int:
        """The number of a material of trimesh, a ``PBRMaterial`` or a ``SimpleMaterial``; of a white one for None."""
        simple = hasattr(material, "diffuse")
        picture = material.image if simple else getattr(material, "baseColorTexture", None)
        factor = material.diffuse if simple and picture is None else getattr(material, "baseColorFactor", None)
        colour = np.ones(4) if factor is None else np.asarray(factor, dtype=np.float64) / 255.0
        surface = {
            "baseColorFactor": [*self.linear(colour[:3]).tolist(), float(colour[3])],
            "metallicFactor": _number(getattr(material, "metallicFactor", None), 0.0),
            "roughnessFactor": _number(getattr(material, "roughnessFactor", None), 1.0),
            "baseColorTexture": self._pictures.texture(picture),
        }
        emission = getattr(material, "emissiveFactor", None)
        written = {
            "pbrMetallicRoughness": {key: value for key, value in surface.items() if value is not None},
            "doubleSided": True,
            "emissiveFactor": self.linear(np.zeros(3) if emission is None else np.asarray(emission)[:3]).tolist(),
            # Files that mean opaque in another mode than the one that trimesh reads have an alpha of 0
            "alphaMode": "BLEND" if 0.0 < colour[3] < 1.0 else "OPAQUE",
        }
        normals = self._pictures.texture(getattr(material, "normalTexture", None))
        written |= {} if normals is None else {"normalTexture": normals}
        key = json.dumps(written)
        if key not in self._numbers:
            self._numbers[key] = len(self.written)
            self.written.append(written)
        return self._numbers[key]


def _number(value: Any, default: float) -> float:
    return default if value is None else float(value)
