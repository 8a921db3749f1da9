"""Metallic-roughness maps of glTF materials: a face is metal or not, and has one roughness."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from colonnade.common import fixed_order
from colonnade.common.types import Floats
from colonnade.mesh.geometry.topology import triangle_points
from colonnade.mesh.materials.materials import MIRROR_ROUGHNESS, MeshMaterial, coat_roughness
from colonnade.mesh.materials.texture import Texture

#: Points along an edge of a face.
_POINTS = 4
#: Channels of the map.
_ROUGHNESS, _METALLIC = 1, 2
#: Steps of the roughness.
_STEPS = 16


def metal_of(texture: Texture, uvs: Floats, factors: tuple[float, float]) -> tuple[NDArray[np.bool_], Floats]:
    """Which faces are metal by a map, bool [m], and their mean roughness in sixteenths, 0 to 1, float64 [m].

    Args:
        texture: The map.
        uvs: Positions of the corners in it, float64 [m, 3, 2].
        factors: Of metallic and roughness.
    """
    points = fixed_order.product(triangle_points(_POINTS), uvs)
    values = texture.codes(points.reshape(-1, 2)).reshape(*points.shape[:2], 3).mean(axis=1) / 255
    is_metal = np.asarray(values[:, _METALLIC] * factors[0] >= 0.5)
    return is_metal, np.rint(_STEPS * np.clip(values[:, _ROUGHNESS] * factors[1], 0.0, 1.0)) / _STEPS


def of_map(material: MeshMaterial, is_metal: bool, roughness: float) -> MeshMaterial:
    """The metal beside a diffuse material, or this one with the coat of a roughness."""
    if not is_metal:
        return replace(material, roughness=coat_roughness(roughness))
    emission = material.emission if roughness > MIRROR_ROUGHNESS else (0.0, 0.0, 0.0)
    return replace(material, kind="mirror", roughness=roughness, emission=emission)
