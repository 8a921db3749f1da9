"""Metallic-roughness maps of glTF materials: a face is metal or not, and the metal of a material has one roughness."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from colonnade.common import fixed_order
from colonnade.common.types import Floats
from colonnade.mesh.materials import MIRROR_ROUGHNESS, MeshMaterial
from colonnade.mesh.texture import Texture

#: Points of a face, as weights of its corners.
_POINTS = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / [[3], [6], [6], [6]]
#: Channels of the map.
_ROUGHNESS, _METALLIC = 1, 2
#: Steps of the roughness, so that a device's table holds many materials.
_STEPS = 8


def metal_of(
    texture: Texture, uvs: Floats, factors: tuple[float, float], areas: Floats
) -> tuple[NDArray[np.bool_], float]:
    """Which faces are metal by a map, bool [m], and their mean roughness in eighths, 0 to 1.

    Args:
        texture: The map.
        uvs: Positions of the corners in it, float64 [m, 3, 2].
        factors: Of metallic and roughness.
        areas: Of the faces, float64 [m].
    """
    points = fixed_order.product(_POINTS, uvs)
    values = texture.codes(points.reshape(-1, 2)).reshape(len(uvs), len(_POINTS), 3).mean(axis=1) / 255
    is_metal = np.asarray(values[:, _METALLIC] * factors[0] >= 0.5)
    weights = areas * is_metal
    roughness = float((weights * values[:, _ROUGHNESS]).sum() / max(weights.sum(), 1e-300)) * factors[1]
    return is_metal, round(_STEPS * min(max(roughness, 0.0), 1.0)) / _STEPS


def as_metal(material: MeshMaterial, roughness: float) -> MeshMaterial:
    """The metal beside a diffuse material."""
    emission = material.emission if roughness > MIRROR_ROUGHNESS else (0.0, 0.0, 0.0)
    return replace(material, kind="mirror", roughness=roughness, emission=emission)
