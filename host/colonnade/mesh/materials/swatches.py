"""Faces that show one colour of their texture: the colour moves to their corners, and they leave the texture.

Swatch maps paint models so: each face lies in one texel. Corner colours are exact and take no texture memory.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from colonnade.common.types import Floats, Indices
from colonnade.mesh.materials.pixel_boxes import PixelCounts, pixel_boxes, unfolded, wrapped
from colonnade.mesh.materials.surface import RawSurface
from colonnade.mesh.materials.texture import Texture


def with_swatches(surface: RawSurface) -> RawSurface:
    """The surface with the colours of its textures at the corners of faces that show a single texel or colour."""
    if surface.uvs is None:
        return surface
    index = surface.material_index.copy()
    materials = surface.materials + tuple(replace(material, texture=None) for material in surface.materials)
    colours = np.full((len(index), 3, 3), np.nan) if surface.colours is None else surface.colours.copy()
    uvs = surface.uvs.copy()
    for number, texture in enumerate(surface.textures):
        users = [place for place, material in enumerate(surface.materials) if material.texture == number]
        faces = np.flatnonzero(np.isin(index, users))
        if not len(faces):
            continue
        first, last = pixel_boxes(uvs[faces], texture)
        plain = _show_one_colour(first, last, texture)
        faces, first, last = faces[plain], first[plain], last[plain]
        albedo = np.array([material.albedo for material in surface.materials])[index[faces]]
        found = _corner_colours(uvs[faces], first, last, texture)
        colours[faces] = found * albedo[:, None]
        index[faces] += len(surface.materials)
        uvs[faces] = 0.0
    if (index < len(surface.materials)).all():
        return surface
    return replace(surface, materials=materials, face_materials=index, colours=colours, uvs=uvs)


def _show_one_colour(first: Indices, last: Indices, texture: Texture) -> npt.NDArray[np.bool_]:
    """Whether all pixels of boxes are equal, bool [k]."""
    (left, top), (right, bottom) = wrapped(first, texture).T, wrapped(last, texture).T
    pixels = unfolded(texture.pixels, texture.wrap)
    # Most boxes of a photograph differ at two corners already
    found: npt.NDArray[np.bool_] = (pixels[top, left] == pixels[bottom, right]).all(axis=1)
    if found.any():
        first, last = first[found], last[found]
        codes = pixels[..., 0] | pixels[..., 1].astype(np.uint32) << 8 | pixels[..., 2].astype(np.uint32) << 16
        changes = np.zeros(len(first), dtype=np.int64)
        for axis in range(2):
            differs = codes != np.roll(codes, -1, axis=1 - axis)
            changes += PixelCounts(differs, texture).within(first, last - np.eye(2, dtype=np.int64)[axis])
        found[found] = changes == 0
    return found


def _corner_colours(uvs: Floats, first: Indices, last: Indices, texture: Texture) -> Floats:
    """Linear colours at the corners of faces of one colour, float64 [k, 3, 3]."""
    column, row = wrapped(first, texture).T
    whole = Texture(texture.name, unfolded(texture.pixels, texture.wrap)[row, column][:, None])
    flat = np.repeat(whole.linear, 3, axis=1)
    # Within a texel the filter of the texture may still blend it with its neighbours
    blended = texture.colours(uvs.reshape(-1, 2)).reshape(-1, 3, 3)
    is_one = (first == last).all(axis=1)
    return np.where(is_one[:, None, None], blended, flat)
