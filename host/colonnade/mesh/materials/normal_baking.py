"""Bakes normal maps into corner normals: the device has normals at the corners of faces, and no maps of them.

``cpp/mesh/baking.hpp`` splits the faces inside which a map varies, and fits the normals at the corners to the map.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from colonnade.common import fixed_order
from colonnade.common.types import Floats, Indices
from colonnade.mesh import losses as lost
from colonnade.mesh.geometry.topology import MAX_SPLIT_FACES, Faces
from colonnade.mesh.losses import Losses
from colonnade.mesh.materials.relief import Relief

#: Root of the mean square of the difference that is reported, degrees.
_REPORTED = 3.0


@dataclass(frozen=True)
class BakedSurface:
    """A surface whose corner normals come from its normal maps.

    Attributes:
        vertices: Distinct, ascending, float64 [n, 3].
        faces: int32 [k, 3].
        normals: At the corners, unit length, float64 [k, 3, 3].
        owners: The face of the surface of which each is a part, ascending, int64 [k].
        weights: Weights of its corners at the corners of each, float64 [k, 3, 3].
    """

    vertices: Floats
    faces: Faces
    normals: Floats
    owners: Indices
    weights: Floats

    def corners(self, values: Floats) -> Floats:
        """Values at the corners of the surface's faces, float64 [m, 3, c], as of the parts, float64 [k, 3, c]."""
        return fixed_order.product(self.weights, values[self.owners])


def baked(vertices: Floats, faces: Faces, normals: Floats, relief: Relief, losses: Losses) -> BakedSurface:
    """Split the faces of a clean surface where its normal maps need it, and fit the corner normals to the maps.

    Args:
        vertices: float64 [n, 3], merged by position.
        faces: int32 [m, 3], each with an area.
        normals: At the corners, float64 [m, 3, 3]; 0 for none.
        relief: The maps. Faces without one keep their normals to the bit, but where they share others' normals.
        losses: Counts maps that the corner normals do not show.
    """
    from colonnade import _core

    maps = [(one.texture.compiled, one.scale) for one in relief.maps]
    *parts, error = _core.baked(
        np.ascontiguousarray(vertices),
        np.ascontiguousarray(faces),
        np.ascontiguousarray(normals),
        maps,
        relief.index.astype(np.int32),
        np.ascontiguousarray(relief.uvs),
        np.ascontiguousarray(relief.tangents),
        MAX_SPLIT_FACES - len(faces),
    )
    if error > math.radians(_REPORTED):
        losses.add(lost.smooth_normals(math.degrees(error)), len({id(one.texture) for one in relief.maps}))
    return BakedSurface(*parts)
