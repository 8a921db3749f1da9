"""Emission maps of glTF materials: a face emits one of a few colours, and is bisected where the map has more."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats
from colonnade.mesh.geometry.topology import MAX_SPLIT_FACES
from colonnade.mesh.materials.materials import Vector
from colonnade.mesh.materials.surface import Pieces, RawSurface
from colonnade.mesh.materials.texture import LINEAR, Texture

#: Of the faces that a mesh may have more, the part that emission takes; the rest is for alpha and normal maps.
_SHARE = 4


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


def emission_pieces(
    texture: Texture, factor: Vector, surface: RawSurface, shows: NDArray[np.bool_], uvs: Floats
) -> Pieces:
    """The faces of a surface, in order, in pieces where what they emit by a map varies; it stays watertight.

    Args:
        texture: The map.
        factor: Of its values.
        surface: All faces of the file.
        shows: Which faces show the map, bool [m].
        uvs: Positions of the corners in it, float64 [m, 3, 2].
    """
    from colonnade import _core

    return Pieces(
        *_core.emission_pieces(
            texture.compiled,
            np.array(factor),
            np.ascontiguousarray(surface.vertices),
            np.ascontiguousarray(surface.faces, dtype=np.int32),
            shows.astype(np.uint8),
            np.ascontiguousarray(uvs),
            (MAX_SPLIT_FACES - len(surface.faces)) // _SHARE,
            LINEAR,
        )
    )
