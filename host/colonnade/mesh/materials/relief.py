"""Normal maps of mesh files, and what of them each face of a surface has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from colonnade.common import fixed_order
from colonnade.common.types import Floats, Indices
from colonnade.mesh.materials.texture import Texture


@dataclass(frozen=True, eq=False)
class NormalMap:
    """A map of normals in the tangent space of a surface: along u, against v, along its own normal.

    Attributes:
        texture: Its picture; codes 0 to 255 stand for -1 to 1.
        scale: Factor of both tangential components.
    """

    texture: Texture
    scale: float = 1.0


@dataclass(frozen=True, eq=False)
class Relief:
    """The normal maps of a surface's faces.

    Attributes:
        maps: The normal maps.
        index: The map of each face, -1 for none, int64 [m].
        uvs: Positions of the corners in their map, float64 [m, 3, 2].
        tangents: Tangents of the file at the corners, along u, and 1 or -1 where the bitangent is of a mirrored
            map; 0 where it has none, float64 [m, 3, 4].
    """

    maps: tuple[NormalMap, ...]
    index: Indices
    uvs: Floats
    tangents: Floats

    def pieces(self, owners: Indices, weights: Floats) -> Relief:
        """The relief of parts of the faces, by the weights of their corners, float64 [k, 3, 3]."""
        uvs, tangents = (fixed_order.product(weights, values[owners]) for values in (self.uvs, self.tangents))
        return Relief(self.maps, self.index[owners], uvs, tangents)

    def kept(self, faces: Indices) -> Relief:
        """The relief of some of the faces."""
        return Relief(self.maps, self.index[faces], self.uvs[faces], self.tangents[faces])

    def reversed(self, faces: npt.NDArray[np.bool_]) -> Relief:
        """The relief of a surface some of whose faces have the other winding."""
        uvs, tangents = (
            np.where(faces[:, None, None], values[:, ::-1], values) for values in (self.uvs, self.tangents)
        )
        return Relief(self.maps, self.index, uvs, tangents)

    @property
    def without_tangents(self) -> Relief:
        """The relief without the file's tangents: the surface's stand for them."""
        return replace(self, tangents=np.zeros_like(self.tangents))

    @staticmethod
    def joined(parts: Sequence[Relief | None], counts: Sequence[int]) -> Relief | None:
        """The relief of surfaces of so many faces, one after the other; None if none has any."""
        if all(part is None for part in parts):
            return None
        maps: list[NormalMap] = []
        index, uvs, tangents = [], [], []
        for part, count in zip(parts, counts, strict=True):
            if part is None:
                part = Relief((), np.full(count, -1), np.zeros((count, 3, 2)), np.zeros((count, 3, 4)))
            index.append(np.where(part.index >= 0, part.index + len(maps), -1))
            maps += part.maps
            uvs.append(part.uvs)
            tangents.append(part.tangents)
        return Relief(tuple(maps), np.concatenate(index), np.concatenate(uvs), np.concatenate(tangents))
