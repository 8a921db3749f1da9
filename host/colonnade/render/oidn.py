"""Open Image Denoise as the filter of gathered light, guided by what pixels show (docs/gather.md, "Denoising")."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats, Indices
from colonnade.mesh.materials.mesh import Mesh
from colonnade.render.denoise import Guide


def filtered(colour: Floats, around: Floats, guide: Guide, albedo: Floats) -> Floats:
    """Filter the colours of the object's pixels.

    Args:
        colour: Linear, float64 [height, width, 3].
        around: What it sees outside the mask, linear, float64 [height, width, 3].
        guide: What the pixels show.
        albedo: float64 [height, width, 3].

    Returns:
        float64 [height, width, 3]; pixels outside the mask are unchanged.
    """
    import pyoidn

    if not guide.mask.any():
        return colour

    def seen(values: Floats, outside: Floats | float = 0.0) -> NDArray[np.float32]:
        return np.ascontiguousarray(np.where(guide.mask[..., None], values, outside), dtype=np.float32)

    found = pyoidn.denoise(seen(colour, around), albedo=seen(albedo), normal=seen(guide.normals), hdr=True)
    return np.where(guide.mask[..., None], np.maximum(found, 0.0), colour)


def albedo_of(mesh: Mesh, hits: Indices, position: Floats) -> Floats:
    """The albedo of points on a mesh, linear, float64 [height, width, 3]; 0 where there is none.

    Args:
        mesh: The mesh, with the materials of the scene.
        hits: The face of the file at each, -1 for none, int64 [height, width].
        position: The points, in its space, float64 [height, width, 3].
    """
    found = np.zeros(position.shape)
    is_hit = hits >= 0
    # Any part of a face of the file serves: positions in textures and colours are linear on all of it
    part = np.zeros(mesh.source_count, dtype=np.int64)
    part[mesh.source_faces] = np.arange(len(mesh.faces))
    faces = part[hits[is_hit]]
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces[faces]], 1, 0)
    across, up, way = b - a, c - a, position[is_hit] - a
    along, slope, rise = (across**2).sum(axis=1), (across * up).sum(axis=1), (up**2).sum(axis=1)
    first, second = (way * across).sum(axis=1), (way * up).sum(axis=1)
    area = np.maximum(along * rise - slope**2, 1e-300)
    beta, gamma = (first * rise - second * slope) / area, (second * along - first * slope) / area
    weights = np.stack([1 - beta - gamma, beta, gamma], axis=1)[..., None]
    index = mesh.face_materials[faces]
    colours = np.array([material.albedo for material in mesh.materials])[index]
    for number, material in enumerate(mesh.materials):
        users = np.flatnonzero(index == number)
        if material.texture is not None and mesh.corner_uvs is not None:
            uvs = (mesh.corner_uvs[faces[users]] * weights[users]).sum(axis=1)
            colours[users] *= mesh.textures[material.texture].colours(uvs)
        elif material.has_corner_colours and mesh.corner_colours is not None:
            colours[users] *= (mesh.corner_colours[faces[users]] * weights[users]).sum(axis=1)
    found[is_hit] = colours.clip(0.0, 1.0)
    return found
