"""Emission maps of glTF materials: a face emits one of a few colours."""

from __future__ import annotations

import numpy as np

from colonnade.common.types import Floats
from colonnade.mesh.materials.texture import LINEAR, Texture


def emission_of(texture: Texture, uvs: Floats, corners: Floats) -> Floats:
    """What faces emit by a map, at most four colours, linear, float64 [m, 3].

    Args:
        texture: The map.
        uvs: Positions of the corners in it, float64 [m, 3, 2].
        corners: Of the faces, float64 [m, 3, 3].
    """
    from colonnade import _core

    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.sqrt((across**2).sum(axis=1))
    found: Floats = _core.emission_of(texture.compiled, np.ascontiguousarray(uvs), areas, LINEAR)
    return found
