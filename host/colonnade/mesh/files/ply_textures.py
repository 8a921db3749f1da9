"""The textures of PLY files, in the forms of MeshLab and Blender.

``comment TextureFile NAME`` names a picture. A vertex has its position as ``s t``, ``u v`` or ``texture_u texture_v``,
or a face has those of its corners as the list ``texcoord``, and the number of its picture as ``texnumber``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from colonnade.common.types import Floats, Indices
from colonnade.mesh import losses as lost
from colonnade.mesh.files.ply_elements import Columns, ListColumn
from colonnade.mesh.files.resolver import References
from colonnade.mesh.losses import Losses
from colonnade.mesh.materials.materials import PLAIN, MeshMaterial
from colonnade.mesh.materials.texture import MAX_UV, Texture
from colonnade.mesh.materials.texture_reader import TextureReader

#: Names of a vertex's position, which goes up.
_POSITIONS = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("tx", "ty"))
_CORNERS, _NUMBER = "texcoord", "texnumber"


@dataclass(frozen=True)
class TexturedPolygons:
    """What polygons with textures show.

    Attributes:
        materials: `PLAIN`, and one for each texture.
        polygon_materials: int64 [p].
        textures: The textures.
        corner_uvs: Texture coordinates of all polygons' corners, float64 [k, 2].
        read: Names of the properties that were read.
    """

    materials: tuple[MeshMaterial, ...]
    polygon_materials: Indices
    textures: tuple[Texture, ...]
    corner_uvs: Floats
    read: tuple[str, ...]


def textured_polygons(
    names: Sequence[str],
    corners: Indices,
    sizes: Indices,
    vertex: Columns,
    face: Columns,
    references: References,
    losses: Losses,
) -> TexturedPolygons | None:
    """The textures of polygons, of which those of ``face`` come first; None if the file names no picture."""
    if not names:
        return None
    numbers = np.zeros(len(sizes), dtype=np.int64)
    if isinstance(given := face.get(_NUMBER), np.ndarray):
        given = np.clip(np.nan_to_num(given[: len(sizes)], nan=-1.0), -1, len(names))
        numbers[: len(given)] = given
    reader = TextureReader(losses)
    # Material of each number; 0 shows no texture
    materials = np.zeros(len(names) + 2, dtype=np.int64)
    for number in np.unique(numbers[(numbers >= 0) & (numbers < len(names))]).tolist():
        picture = references.picture(names[number], losses)
        found = None if picture is None else reader.read(picture, names[number], ("repeat", "repeat"))
        materials[number] = 0 if found is None else found + 1
    reader.count_losses()
    kinds = materials[numbers]
    uvs = np.full((len(corners), 2), np.nan)
    read = next((one for one in _POSITIONS if all(isinstance(vertex.get(name), np.ndarray) for name in one)), ())
    if read:
        uvs = np.stack([vertex[name] for name in read], axis=1)[corners]
    own = face.get(_CORNERS)
    if isinstance(own, ListColumn) and len(own.sizes) <= len(sizes):
        # A list that does not fit is none
        fits = own.sizes == 2 * sizes[: len(own.sizes)]
        of_corners = np.repeat(np.append(fits, np.zeros(len(sizes) - len(fits), dtype=np.bool_)), sizes)
        uvs[of_corners] = own.values[np.repeat(fits, own.sizes)].reshape(-1, 2)
    owner = np.repeat(np.arange(len(sizes)), sizes)
    is_known = (np.abs(uvs) <= MAX_UV).all(axis=1)
    lacks = np.bincount(owner, ~is_known, len(sizes)) > 0
    losses.add(lost.NO_UVS, int((lacks & (kinds > 0)).sum()))
    textured = (MeshMaterial(albedo=(1.0, 1.0, 1.0), texture=number) for number in range(len(reader.textures)))
    return TexturedPolygons(
        (PLAIN, *textured),
        np.where(lacks, 0, kinds),
        tuple(reader.textures),
        np.where(is_known[:, None], uvs * (1, -1) + (0, 1), 0.0),
        (*read, _CORNERS, _NUMBER),
    )
