"""The base-colour textures of glTF materials: their pictures, samplers, and the texture coordinates of a primitive."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from colonnade.common import fixed_order
from colonnade.common.types import Floats
from colonnade.mesh import losses as lost
from colonnade.mesh.files.gltf_document import GltfDocument
from colonnade.mesh.files.resolver import References
from colonnade.mesh.losses import Losses
from colonnade.mesh.materials.materials import gltf_surface, normal_scale
from colonnade.mesh.materials.relief import NormalMap
from colonnade.mesh.materials.texture import Wrap
from colonnade.mesh.materials.texture_reader import TextureReader

_WRAPS: dict[int, Wrap] = {33071: "clamp", 33648: "mirror", 10497: "repeat"}
#: Filter of a sampler without interpolation.
_NEAREST = 9728
#: Extension of a texture whose picture has a format that is read.
_WEBP = "EXT_texture_webp"


@dataclass(frozen=True)
class TextureUse:
    """The use of a texture by a material.

    Attributes:
        texture: Index in `TextureReader.textures`.
        coordinates: Name of the texture coordinates in a primitive, ``TEXCOORD_0``.
        matrix: Transform of the texture coordinates, float64 [2, 3].
    """

    texture: int
    coordinates: str
    matrix: Floats

    def uvs(self, values: Floats) -> Floats:
        """Positions in the texture of those of a file, float64 [n, 2]."""
        return fixed_order.product(values, self.matrix[:, :2].T) + self.matrix[:, 2]


class GltfTextures:
    """The textures of a document, read when they are first used."""

    def __init__(self, document: GltfDocument, references: References, losses: Losses) -> None:
        self._document, self._references, self._losses = document, references, losses
        self._uses: dict[int, TextureUse | None] = {}
        self._metals: dict[int, TextureUse | None] = {}
        self._emissions: dict[int, TextureUse | None] = {}
        self._normals: dict[int, tuple[TextureUse, NormalMap] | None] = {}
        self._read: dict[tuple[int, Wrap, Wrap, bool], int | None] = {}
        self.reader = TextureReader(losses)

    @property
    def uses(self) -> Mapping[int, TextureUse | None]:
        """The textures of the materials that `use_of` was asked for."""
        return self._uses

    def use_of(self, number: int) -> TextureUse | None:
        """As `of`, for a material's number."""
        if number not in self._uses:
            self._uses[number] = self.of(self._document.entry("materials", number))
        return self._uses[number]

    def of(self, material: Mapping[str, Any]) -> TextureUse | None:
        """The base-colour texture of a material; None without one, or if its picture is missing or not readable.

        Raises:
            UserError: The texture does not exist, or its transform is not valid.
        """
        return self._use(gltf_surface(material).get("baseColorTexture"))

    def metal_of(self, number: int) -> TextureUse | None:
        """As `use_of`, of the metallic-roughness map of a material."""
        if number not in self._metals:
            surface = gltf_surface(self._document.entry("materials", number))
            self._metals[number] = self._use(surface.get("metallicRoughnessTexture"))
        return self._metals[number]

    def emission_of(self, number: int) -> TextureUse | None:
        """As `use_of`, of the emission map of a material."""
        if number not in self._emissions:
            self._emissions[number] = self._use(self._document.entry("materials", number).get("emissiveTexture"))
        return self._emissions[number]

    def normals_of(self, number: int) -> tuple[TextureUse, NormalMap] | None:
        """As `use_of`, of the normal map of a material."""
        if number not in self._normals:
            material = self._document.entry("materials", number)
            use = self._use(material.get("normalTexture"))
            self._normals[number] = (
                None if use is None else (use, NormalMap(self.reader.textures[use.texture], normal_scale(material)))
            )
        return self._normals[number]

    def _use(self, info: Any) -> TextureUse | None:
        if not isinstance(info, Mapping):
            return None
        index = self._index_of(info)
        transform = info.get("extensions", {}).get("KHR_texture_transform", {})
        coordinates = f"TEXCOORD_{transform.get('texCoord', info.get('texCoord', 0))}"
        return None if index is None else TextureUse(index, coordinates, self._matrix(transform))

    def _index_of(self, info: Mapping[str, Any]) -> int | None:
        """The index in `TextureReader.textures` of a reference to a texture; None if there is no picture."""
        entry = self._document.entry("textures", info.get("index"))
        extensions = entry.get("extensions", {})
        source = entry.get("source")
        if _WEBP in extensions:
            source = extensions[_WEBP].get("source", source)
        if source is None:
            loss = lost.PICTURE_FORMATS if extensions else lost.NO_PICTURES
            self._losses.add(loss, name=f"texture {info.get('index')}")
            return None
        sampler = self._document.entry("samplers", entry["sampler"]) if "sampler" in entry else {}
        wrap_u, wrap_v = (_WRAPS.get(sampler.get(key, 10497), "repeat") for key in ("wrapS", "wrapT"))
        key = (int(source), wrap_u, wrap_v, sampler.get("magFilter") == _NEAREST)
        if key not in self._read:
            self._read[key] = self._texture(*key)
        return self._read[key]

    def _texture(self, source: int, wrap_u: Wrap, wrap_v: Wrap, is_nearest: bool) -> int | None:
        data, file = self._document.image(source)
        if file is not None:
            data = self._references.picture(file, self._losses)
        if data is None:
            return None
        return self.reader.read(data, f"image {source}" if file is None else file, (wrap_u, wrap_v), is_nearest)

    def _matrix(self, transform: Mapping[str, Any]) -> Floats:
        """A KHR_texture_transform: scale, then rotation, then offset."""
        try:
            scale = np.array(transform.get("scale", (1.0, 1.0)), dtype=np.float64).reshape(2)
            offset = np.array(transform.get("offset", (0.0, 0.0)), dtype=np.float64).reshape(2)
            angle = float(transform.get("rotation", 0.0))
        except (TypeError, ValueError):
            raise self._document.error("the transform of a texture is not valid: export it again") from None
        cosine, sine = math.cos(angle), math.sin(angle)
        return np.column_stack([np.array([[cosine, sine], [-sine, cosine]]) * scale, offset])
