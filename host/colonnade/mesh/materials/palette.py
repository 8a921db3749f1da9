"""Materials of coloured faces: with the colours of the corners, or reduced to the number that a device has."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from colonnade.common.srgb import linear_from_srgb, srgb_from_linear
from colonnade.common.types import Floats, Indices
from colonnade.mesh import losses as lost
from colonnade.mesh.losses import Losses
from colonnade.mesh.materials.materials import (
    BLACK,
    DARK,
    MARKS,
    PLAIN,
    SMOOTH_ROUGHNESS,
    MeshMaterial,
    as_rendered,
    in_layer,
    in_pass,
)
from colonnade.mesh.materials.mesh import Mesh

#: Limit of the 8-bit material index of a face.
MAX_MATERIALS = 256

#: How to get hardware with textures, for messages.
TEXTURE_HARDWARE = "take --config small, or set geometry.cornerColours=true and geometry.textureBytes=16384"

#: What a material loses whose roughness is not rendered, by kind.
_WITHOUT_ROUGHNESS = {"diffuse": lost.COATS, "mirror": lost.ROUGH_MIRROR, "glass": lost.ROUGH_GLASS}

#: Steps of the clustering, at most.
_STEPS = 30
#: Colours in which materials that are merged may differ; the second ones if the first do not suffice.
_MERGED: tuple[dict[str, Any], ...] = ({"albedo": DARK}, {"albedo": DARK, "emission": DARK})


def coloured_materials(
    materials: tuple[MeshMaterial, ...], face_materials: Indices, colours: Floats | None
) -> tuple[tuple[MeshMaterial, ...], Indices, int]:
    """Materials of the faces, with their colours as albedo.

    Args:
        materials: Materials of the file.
        face_materials: int64 [m].
        colours: Linear colours of the faces, NaN for none, float64 [m, 3]; None: no face has one.

    Returns:
        The distinct used materials, any number of them without colours, else at most `MAX_MATERIALS` if the materials
        without a colour leave space; the material of each face, int64 [m]; and the number of distinct colours.
    """
    distinct = {material: index for index, material in enumerate(dict.fromkeys(materials))}
    index = np.array([distinct[material] for material in materials], dtype=np.int64)[face_materials]
    found = list(distinct)
    if colours is None:
        return (*_used(found, index), 0)
    has_colour = np.isfinite(colours).all(axis=1)
    # 8 bits of sRGB per channel, as files have them
    codes = np.rint(srgb_from_linear(colours[has_colour]) * 255).astype(np.int64)
    rows = np.column_stack([index[has_colour], codes])
    unique, owner = np.unique(rows, axis=0, return_inverse=True)
    owner = owner.reshape(-1)
    plain = len(np.unique(index[~has_colour]))
    space = max(1, MAX_MATERIALS - plain)
    if len(unique) > space:
        # Colours of one kind of material share an equal part
        bases = np.unique(unique[:, 0])
        weights = np.bincount(owner, minlength=len(unique))
        merged = np.empty_like(unique)
        for base in bases:
            of_base = np.flatnonzero(unique[:, 0] == base)
            centres, nearest = clustered(unique[of_base, 1:] / 255.0, weights[of_base], max(1, space // len(bases)))
            merged[of_base, 0] = base
            merged[of_base, 1:] = np.rint(centres[nearest] * 255)
        unique = merged
    linear = linear_from_srgb(unique[:, 1:] / 255.0)
    tinted = [
        replace(found[int(base)], albedo=(float(red), float(green), float(blue)))
        for base, (red, green, blue) in zip(unique[:, 0], linear, strict=True)
    ]
    index[has_colour] = len(found) + owner
    number = len(np.unique(rows, axis=0))
    return (*_used([*found, *tinted], index), number)


def corner_coloured_materials(
    materials: tuple[MeshMaterial, ...], face_materials: Indices, colours: Floats
) -> tuple[tuple[MeshMaterial, ...], Indices, Floats]:
    """Materials of the faces that leave their colours to the corners.

    Args:
        materials: Materials of the file.
        face_materials: int64 [m].
        colours: Linear colours of the corners, NaN on faces without, float64 [m, 3, 3].

    Returns:
        The distinct used materials, the material of each face, int64 [m], and the colours with 0 for NaN.
    """
    has_colour = np.asarray(np.isfinite(colours).all(axis=(1, 2)))
    coloured = [replace(material, albedo=(1.0, 1.0, 1.0), has_corner_colours=True) for material in materials]
    index = face_materials + np.where(has_colour, len(materials), 0)
    return (*_used([*materials, *coloured], index), np.where(has_colour[:, None, None], colours, 0.0))


def table_entries(materials: Sequence[MeshMaterial]) -> tuple[tuple[MeshMaterial, ...], Indices]:
    """The entries of a device's table for materials, and the entry of each, int64 [k].

    Textured materials that differ in texture and albedo share one: the atlas holds both.
    """
    textured = [
        material if material.texture is None else replace(material, albedo=(1.0, 1.0, 1.0), texture=0)
        for material in materials
    ]
    entries = {material: number for number, material in enumerate(dict.fromkeys(textured))}
    return tuple(entries), np.array([entries[material] for material in textured], dtype=np.int64)


def with_corner_albedo(mesh: Mesh) -> Mesh:
    """The mesh with the plain colours of its materials at the corners of their faces, where they take no materials."""
    albedo = np.array([material.albedo for material in mesh.materials])[mesh.face_materials]
    is_plain = [material.texture is None and not material.has_corner_colours for material in mesh.materials]
    colours = np.repeat(albedo[:, None], 3, axis=1) * np.array(is_plain)[mesh.face_materials][:, None, None]
    if mesh.corner_colours is not None:
        colours += mesh.corner_colours * ~np.array(is_plain)[mesh.face_materials][:, None, None]
    coloured = [
        replace(material, albedo=(1.0, 1.0, 1.0), has_corner_colours=True) if plain else material
        for material, plain in zip(mesh.materials, is_plain, strict=True)
    ]
    materials, index = _used(coloured, mesh.face_materials.astype(np.int64))
    return replace(mesh, materials=materials, face_materials=index.astype(np.uint8), corner_colours=colours)


def with_face_colours(mesh: Mesh) -> tuple[Mesh, tuple[str, ...]]:
    """A mesh with corner colours as one with a colour for each face, the mean of its corners, and lines on this."""
    if mesh.corner_colours is None:
        return mesh, ()
    is_coloured = np.array([material.has_corner_colours for material in mesh.materials])[mesh.face_materials]
    colours = np.where(is_coloured[:, None], mesh.corner_colours.mean(axis=1), np.nan)
    plain = tuple(replace(material, has_corner_colours=False) for material in mesh.materials)
    materials, index, number = coloured_materials(plain, mesh.face_materials.astype(np.int64), colours)
    losses = Losses()
    losses.add(lost.COLOURS, number)
    faces = replace(mesh, materials=materials, face_materials=index.astype(np.uint8), corner_colours=None)
    return faces, losses.lines(f"mesh {mesh.name}")


def without_textures(mesh: Mesh) -> tuple[Mesh, tuple[str, ...]]:
    """A mesh whose textured materials have the mean colours of their textures, and a line on this."""
    if all(material.texture is None for material in mesh.materials):
        return mesh, ()
    materials = tuple(_untextured(material, mesh) for material in mesh.materials)
    count = len({material.texture for material in mesh.materials} - {None})
    line = (
        f"mesh {mesh.name}: {count} {'texture is' if count == 1 else 'textures are'} not shown: surfaces have their"
        f" mean colour, as the hardware has no textures: {TEXTURE_HARDWARE}"
    )
    return replace(mesh, materials=materials, textures=(), corner_uvs=None), (line,)


def _untextured(material: MeshMaterial, mesh: Mesh) -> MeshMaterial:
    if material.texture is None:
        return material
    red, green, blue = (mesh.textures[material.texture].mean * material.albedo).tolist()
    return replace(material, albedo=(red, green, blue), texture=None)


def with_whole_surfaces(mesh: Mesh) -> tuple[Mesh, tuple[str, ...]]:
    """A mesh whose partly covering materials are opaque, or panes, in one pass (`in_pass`), and a line on this."""
    found = Losses()
    found.add(lost.COVERED, sum(material.coverage < 1.0 for material in mesh.materials))
    materials = tuple(
        in_pass(_untextured(material, mesh) if material.coverage < 0.5 else material, None)
        for material in mesh.materials
    )
    return replace(mesh, materials=materials), found.lines(f"mesh {mesh.name}")


def with_rendered_metal(mesh: Mesh, gathers: bool, has_layers: bool = False) -> tuple[Mesh, tuple[str, ...]]:
    """A mesh whose rough metal, glass and coats are as the device shows them (`as_rendered`), and lines on the losses.

    Args:
        mesh: The mesh.
        gathers: The scene gathers light.
        has_layers: It also has the passes of coats and highlights.
    """
    found = Losses()
    materials = tuple(
        as_rendered(
            material if has_layers else replace(material, clear_coat=PLAIN.clear_coat),
            gathers and (has_layers or material.kind != "diffuse"),
        )
        for material in mesh.materials
    )
    left_out: dict[lost.Loss, set[MeshMaterial]] = {}
    for material, rendered in zip(mesh.materials, materials, strict=True):
        smooth = replace(material, roughness=0.0)  # a map gives a material several roughnesses
        if material.clear_coat[0] > 0.0 and not (gathers and has_layers):
            left_out.setdefault(lost.CLEAR_COATS, set()).add(smooth)
        if rendered.kind != material.kind:
            left_out.setdefault(lost.ROUGH_METAL, set()).add(smooth)
        elif rendered.roughness == 0.0 and material.roughness > SMOOTH_ROUGHNESS:
            left_out.setdefault(_WITHOUT_ROUGHNESS[material.kind], set()).add(smooth)
        elif material.kind == "glass" and rendered.roughness < material.roughness:
            left_out.setdefault(lost.ROUGHEST_GLASS, set()).add(smooth)
        if gathers and not has_layers and any(in_layer(rendered, layer) != BLACK for layer in MARKS):
            left_out.setdefault(lost.LAMPS, set()).add(smooth)
    found.update((loss, len(those)) for loss, those in left_out.items())
    return replace(mesh, materials=materials), found.lines(f"mesh {mesh.name}")


def without_emission(mesh: Mesh) -> tuple[Mesh, tuple[str, ...]]:
    """A mesh whose materials do not emit, and a line on this."""
    count = sum(any(material.emission) for material in mesh.materials)
    if count == 0:
        return mesh, ()
    dark = [replace(material, emission=(0.0, 0.0, 0.0)) for material in mesh.materials]
    materials, index = _used(dark, mesh.face_materials.astype(np.int64))
    line = (
        f"mesh {mesh.name}: {count} emissive {'material is' if count == 1 else 'materials are'} not emitting: the"
        " hardware has no emission: set frame.emission=true"
    )
    return replace(mesh, materials=materials, face_materials=index.astype(np.uint8)), (line,)


def reduced(mesh: Mesh, count: int) -> tuple[Mesh, str | None]:
    """Reduce a mesh to so many materials by merging similar colours of the same kind and index of refraction.

    Emissions that differ are merged only if there are too many of them.

    Returns:
        The mesh, and a line on what was merged; the mesh itself and None if it has no more materials, or too many
        kinds.
    """
    if len(mesh.materials) <= count:
        return mesh, None
    materials, index = _used(list(mesh.materials), mesh.face_materials.astype(np.int64))
    if len(materials) <= count:
        return replace(mesh, materials=materials, face_materials=index.astype(np.uint8)), None
    for merged in _MERGED:
        kinds: dict[MeshMaterial, list[int]] = {}
        for number, material in enumerate(materials):
            kinds.setdefault(replace(material, **merged), []).append(number)
        if len(kinds) <= count:
            break
    else:
        return mesh, None
    weights = np.bincount(index, minlength=len(materials))
    table = np.zeros(len(materials), dtype=np.uint8)
    found: list[MeshMaterial] = []
    squares = 0.0
    # Small kinds keep all of their colours, if an equal share suffices
    for done, members in enumerate(sorted(kinds.values(), key=len)):
        space = (count - len(found)) // (len(kinds) - done)
        own = [[channel for key in merged for channel in getattr(materials[number], key)] for number in members]
        colours = srgb_from_linear(np.array(own))
        centres, nearest = clustered(colours, weights[members], space)
        squares += float((weights[members, None] * (centres[nearest] - colours) ** 2).sum()) / colours.shape[1]
        table[members] = len(found) + nearest
        for centre in linear_from_srgb(centres).reshape(len(centres), len(merged), 3).tolist():
            values: dict[str, Any] = dict(zip(merged, map(tuple, centre), strict=True))
            found.append(replace(materials[members[0]], **values))
    line = (
        f"mesh {mesh.name}: {len(materials)} materials become {len(found)}, their colours off by"
        f" {255 * math.sqrt(squares / len(index)):.1f}/255 on average: frame.materials is {count}"
    )
    return replace(mesh, materials=tuple(found), face_materials=table[index]), line


def clustered(colours: Floats, weights: npt.NDArray[np.int64], count: int) -> tuple[Floats, Indices]:
    """Weighted k-means of colours: at most ``count`` centres, float64 [k, c], and the nearest one of each, int64 [n].

    It begins with the heaviest colour, then the one with the largest weighted distance to those chosen.
    """
    from scipy.spatial import cKDTree

    chosen = [int(weights.argmax())]
    distance = ((colours - colours[chosen[0]]) ** 2).sum(axis=1)
    while len(chosen) < count and distance.max() > 0:
        chosen.append(int((distance * weights).argmax()))
        distance = np.minimum(distance, ((colours - colours[chosen[-1]]) ** 2).sum(axis=1))
    centres = colours[chosen].astype(np.float64)
    nearest = np.zeros(len(colours), dtype=np.int64)
    for _ in range(_STEPS):
        previous = nearest
        nearest = np.asarray(cKDTree(centres).query(colours)[1], dtype=np.int64)
        if (nearest == previous).all():
            break
        total = np.bincount(nearest, weights, len(centres))
        sums = np.stack([np.bincount(nearest, weights * colour, len(centres)) for colour in colours.T], axis=1)
        filled = total > 0
        centres[filled] = sums[filled] / total[filled, None]
    return centres, nearest


def _used(materials: list[MeshMaterial], index: Indices) -> tuple[tuple[MeshMaterial, ...], Indices]:
    """The distinct materials that faces use, in their order, and the material of each face."""
    distinct: dict[MeshMaterial, int] = {}
    table = np.zeros(len(materials), dtype=np.int64)
    for used in np.unique(index):
        table[used] = distinct.setdefault(materials[used], len(distinct))
    return tuple(distinct), table[index]
