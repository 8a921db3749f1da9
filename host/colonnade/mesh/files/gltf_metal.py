"""Metallic-roughness maps of glTF materials: a face is metal or not, and has one roughness."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats
from colonnade.mesh.materials.materials import DARK, MIRROR_ROUGHNESS, MeshMaterial, coat_roughness
from colonnade.mesh.materials.texture import Texture

#: Metal that emits at least so much by its maps has this roughness: a mirror emits nothing, and tables are small.
_GLOW, _GLOWING_ROUGHNESS = 1 / 8, 3 / 8


def metal_of(texture: Texture, uvs: Floats, factors: tuple[float, float]) -> tuple[NDArray[np.bool_], Floats]:
    """Which faces are metal by a map, bool [m], and their mean roughness in sixteenths, 0 to 1, float64 [m].

    Args:
        texture: The map.
        uvs: Positions of the corners in it, float64 [m, 3, 2].
        factors: Of metallic and roughness.
    """
    from colonnade import _core

    is_metal, roughness = _core.metal_of(texture.compiled, np.ascontiguousarray(uvs), *factors)
    return is_metal, roughness


def of_map(material: MeshMaterial, is_metal: bool, roughness: float) -> MeshMaterial:
    """The metal beside a diffuse material, or this one with the coat of a roughness."""
    if not is_metal:
        return replace(material, roughness=coat_roughness(roughness))
    if max(material.emission) >= _GLOW:
        roughness = _GLOWING_ROUGHNESS
    emission = material.emission if roughness > MIRROR_ROUGHNESS else DARK
    return replace(material, kind="mirror", roughness=roughness, emission=emission)
