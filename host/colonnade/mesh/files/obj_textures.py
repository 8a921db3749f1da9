"""The textures of MTL files: ``map_Kd`` and ``map_d`` with the options ``-s``, ``-o`` and ``-clamp``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from colonnade.common.types import Floats
from colonnade.mesh import losses as lost
from colonnade.mesh.files.resolver import References
from colonnade.mesh.losses import Losses
from colonnade.mesh.materials.materials import MeshMaterial
from colonnade.mesh.materials.texture import Wrap
from colonnade.mesh.materials.texture_reader import TextureReader

#: Options of a map, and their largest number of values.
_OPTIONS = {"-s": 3, "-o": 3, "-t": 3, "-clamp": 1, "-blendu": 1, "-blendv": 1, "-cc": 1, "-mm": 2, "-bm": 1}
_OPTIONS |= {"-boost": 1, "-texres": 1, "-imfchan": 1, "-type": 1}


@dataclass(frozen=True)
class TextureMap:
    """A texture map: its file, and the transform of (u, v) with v upwards."""

    name: str
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    is_clamped: bool = False


class MtlTextures:
    """Textures of MTL files, read when they are first used, and the materials' transforms of texture coordinates."""

    def __init__(self, references: References, losses: Losses) -> None:
        self._references, self._losses = references, losses
        self._read: dict[tuple[TextureMap | None, TextureMap | None], int | None] = {}
        self.reader = TextureReader(losses)

    def textured(self, material: MeshMaterial, entries: Mapping[str, Any]) -> tuple[MeshMaterial, TextureMap | None]:
        """The material with the texture of its maps, if they are there; a colour Kd of black counts as white.

        Raises:
            UserError: The picture is no regular file.
        """
        colour, alpha = (
            self._parsed(words) if (words := entries.get(keyword)) else None for keyword in ("map_kd", "map_d")
        )
        # One position of a corner serves both
        placed = colour if colour is not None else alpha
        if placed is None:
            return material, None
        key = colour, alpha
        if key not in self._read:
            self._read[key] = self._texture(colour, alpha)
        index = self._read[key]
        if index is None:
            return replace(material, alpha=None), None
        albedo = material.albedo if any(material.albedo) else (1.0, 1.0, 1.0)
        return replace(material, albedo=albedo if colour is not None else material.albedo, texture=index), placed

    def _texture(self, colour: TextureMap | None, alpha: TextureMap | None) -> int | None:
        index = None if colour is None else self._picture(colour)
        number = None if alpha is None else self._picture(alpha)
        textures = self.reader.textures
        if number is None:
            if index is not None:
                textures[index] = replace(textures[index], alpha=None)
            return index
        mask = textures[number]
        values = mask.pixels.max(axis=2) if mask.alpha is None else mask.alpha
        if index is None:
            index = number
            textures[index] = replace(mask, pixels=np.full_like(mask.pixels, 255))
        rows, columns = (
            np.arange(count) * of // count
            for count, of in zip(textures[index].pixels.shape[:2], values.shape, strict=True)
        )
        textures[index] = replace(textures[index], alpha=values[np.ix_(rows, columns)])
        return index

    def _picture(self, described: TextureMap) -> int | None:
        data = self._references.picture(described.name, self._losses)
        if data is None:
            return None
        wrap: tuple[Wrap, Wrap] = ("clamp", "clamp") if described.is_clamped else ("repeat", "repeat")
        return self.reader.read(data, described.name, wrap)

    def _parsed(self, words: Sequence[str]) -> TextureMap:
        found, at = TextureMap(""), 0
        while at < len(words) - 1 and words[at].lower() in _OPTIONS:
            option, values = words[at].lower(), []
            at += 1
            for word in words[at : at + _OPTIONS[option]]:
                if at == len(words) - 1 or (_OPTIONS[option] > 1 and not _is_number(word)):
                    break
                values.append(word)
                at += 1
            if option == "-clamp":
                found = replace(found, is_clamped=values == ["on"])
            elif option in ("-s", "-o") and values:
                default = 1.0 if option == "-s" else 0.0
                pair = (float(values[0]), float(values[1]) if len(values) > 1 else default)
                found = replace(found, scale=pair) if option == "-s" else replace(found, offset=pair)
            else:
                self._losses.add(lost.TEXTURE_OPTIONS)
        return replace(found, name=" ".join(words[at:]).strip('"'))


def uvs_of(values: Floats, maps: Sequence[TextureMap | None], materials: Any) -> Floats:
    """Texture coordinates, v downwards, of corners with those of an OBJ file, float64 [k, 2].

    Args:
        values: Positions (u, v) of the file, v upwards, float64 [k, 2].
        maps: The texture map of each material.
        materials: The material of each corner, int64 [k].
    """
    scale = np.array([(1.0, 1.0) if one is None else one.scale for one in maps])[materials]
    offset = np.array([(0.0, 0.0) if one is None else one.offset for one in maps])[materials]
    at = values * scale + offset
    return np.column_stack([at[:, 0], 1.0 - at[:, 1]])


def _is_number(word: str) -> bool:
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False
