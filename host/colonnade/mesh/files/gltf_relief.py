"""Normal maps of glTF primitives: positions in the map and tangents of their faces."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from colonnade.common import fixed_order
from colonnade.common.types import Floats, Indices
from colonnade.mesh import losses as lost
from colonnade.mesh.files.gltf_textures import TextureUse
from colonnade.mesh.losses import Losses
from colonnade.mesh.materials.relief import NormalMap, Relief
from colonnade.mesh.materials.texture import MAX_UV


def relief_of(
    given: tuple[TextureUse, NormalMap] | None,
    attribute: Callable[[str, int], Floats | None],
    faces: Indices,
    linear: Floats,
    losses: Losses,
) -> Relief | None:
    """The relief of a primitive.

    Args:
        given: Its normal map; None: it has none.
        attribute: Values of an attribute of its vertices, float64 [n, width]; None: it has none.
        faces: The faces of its copies in the winding of the scene, int64 [m, 3].
        linear: Transforms of the directions of each copy to the scene, float64 [c, 3, 3].
        losses: Counts faces without positions in the map.
    """
    if given is None:
        return None
    use, normal_map = given
    uvs, tangents = attribute(use.coordinates, 2), attribute("TANGENT", 4)
    if uvs is not None:
        uvs = use.uvs(uvs)
    if uvs is None or not (np.abs(uvs) <= MAX_UV).all():
        losses.add(lost.NO_MAP_UVS, len(faces))
        return None
    if tangents is None or not np.isfinite(tangents).all():
        tangents = np.zeros((len(uvs), 4))
    x, y, z = (linear[:, :, axis] for axis in range(3))
    is_mirrored = fixed_order.dot(x, np.cross(y, z))[:, np.newaxis, np.newaxis] < 0
    turned = fixed_order.product(tangents[:, :3], linear.transpose(0, 2, 1))
    sides = np.sign(tangents[:, 3:]) * np.where(is_mirrored, -1.0, 1.0)
    tangents = np.concatenate([turned, sides], axis=2).reshape(-1, 4)
    return Relief((normal_map,), np.zeros(len(faces), dtype=np.int64), uvs[faces % len(uvs)], tangents[faces])
