"""Faces that show one colour of their texture: the colour moves to their corners, and they leave the texture.

Swatch maps paint models so: each face lies in one texel. Corner colours are exact and take no texture memory.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from colonnade.mesh.materials.surface import RawSurface
from colonnade.mesh.materials.texture import LINEAR


def with_swatches(surface: RawSurface) -> RawSurface:
    """The surface with the colours of its textures at the corners of faces that show a single texel or colour."""
    from colonnade import _core

    if surface.uvs is None:
        return surface
    index = surface.material_index.copy()
    materials = surface.materials + tuple(replace(material, texture=None) for material in surface.materials)
    colours = np.full((len(index), 3, 3), np.nan) if surface.colours is None else surface.colours.copy()
    uvs = surface.uvs.copy()
    for number, texture in enumerate(surface.textures):
        # Metal that emits has no second entry of the material table
        users = [
            place
            for place, material in enumerate(surface.materials)
            if material.texture == number and not (material.kind == "mirror" and any(material.emission))
        ]
        faces = np.flatnonzero(np.isin(index, users))
        if not len(faces):
            continue
        plain, found = _core.swatches(texture.compiled, np.ascontiguousarray(uvs[faces]), LINEAR)
        faces, found = faces[plain], found[plain]
        albedo = np.array([material.albedo for material in surface.materials])[index[faces]]
        colours[faces] = found * albedo[:, None]
        index[faces] += len(surface.materials)
        uvs[faces] = 0.0
    if (index < len(surface.materials)).all():
        return surface
    return replace(surface, materials=materials, face_materials=index, colours=colours, uvs=uvs)
