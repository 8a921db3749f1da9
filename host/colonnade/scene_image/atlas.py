"""The atlas: the base-colour textures of a mesh in one square picture, for the texture memory (docs/textures.md).

``cpp/mesh/atlas.hpp`` makes it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.mesh.materials.materials import MeshMaterial
from colonnade.mesh.materials.mesh import Mesh
from colonnade.mesh.materials.texture import LINEAR

#: Edge of a tile, texels.
TILE = 16


@dataclass(frozen=True)
class Atlas:
    """The atlas of a mesh.

    Attributes:
        colours: Linear, float64 [edge, edge, 3].
        uvs: Texture coordinates of the corners of the mesh's faces, texels from the upper left corner, 0 on faces
            without a texture, float64 [m, 3, 2].
        scale: Texels of the atlas for each pixel of a texture that is not enlarged, along an axis.
        source_bytes: Size of the textures, three bytes a pixel.
    """

    colours: Floats
    uvs: Floats
    scale: float
    source_bytes: int


def make_atlas(mesh: Mesh, materials: Sequence[MeshMaterial], headroom: float, edge: int) -> Atlas | None:
    """The atlas of the textured materials; None if there are none.

    Args:
        mesh: The mesh.
        materials: Its materials, in place of its own.
        headroom: Factor of the scene's lights, by which the colours of diffuse faces are darker.
        edge: Edge of the atlas, texels.

    Raises:
        UserError: There are more textured materials than tiles.
    """
    from colonnade import _core

    textures = np.array([-1 if one.texture is None else one.texture for one in materials], dtype=np.int32)
    factors = [np.array(one.albedo) / (headroom if one.kind == "diffuse" else 1.0) for one in materials]
    textured = textures[mesh.face_materials]
    if mesh.corner_uvs is None or (textured < 0).all():
        return None
    found = _core.atlas(
        mesh.corner_uvs,
        textured,
        np.array(factors)[mesh.face_materials],
        [texture.compiled for texture in mesh.textures],
        LINEAR,
        edge,
    )
    if found is None:
        limit, used = (edge // TILE) ** 2, np.unique(mesh.face_materials[textured >= 0])
        raise UserError(f"mesh {mesh.name} has {len(used):,} textured materials: use at most {limit:,}")
    colours, uvs, scale = found
    return Atlas(colours, uvs, scale, sum(mesh.textures[index].pixels.size for index in set(textured[textured >= 0])))


def uv_codes(atlas: Atlas, fraction_bits: int) -> npt.NDArray[np.int64]:
    """The texture coordinates of an atlas as the hardware holds them, int64 [m, 3, 2]: texels with fraction bits."""
    largest = (len(atlas.colours) << fraction_bits) - 1
    return np.clip(np.rint(atlas.uvs * (1 << fraction_bits)), 0, largest).astype(np.int64)
