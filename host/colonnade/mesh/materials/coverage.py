"""Cuts away what the alpha of materials does not show: the device's surfaces have no alpha.

``cpp/mesh/alpha_cut.hpp`` cuts the faces of a material. Of blended materials the cutoff is 1/2, and faces that are
thinner everywhere become tinted panes without refraction. Their factor is the coverage of the material, which passes
show (`colonnade.mesh.materials.materials.in_pass`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from colonnade.common.errors import UserError
from colonnade.common.types import Floats, Indices
from colonnade.mesh import losses as lost
from colonnade.mesh.geometry.topology import MAX_SPLIT_FACES, SMALLEST_SPLIT
from colonnade.mesh.losses import Losses
from colonnade.mesh.materials.materials import Alpha, MeshMaterial
from colonnade.mesh.materials.surface import Pieces, RawSurface
from colonnade.mesh.materials.texture import LINEAR, Texture

#: Blended faces of less alpha are not shown.
_THIN = 0.05


@dataclass(frozen=True)
class _Cut:
    """The cut of a material's faces.

    Attributes:
        kinds: 1 for faces that are shown, -1 for hidden ones, 0 for faces of which pieces are shown, int8 [m].
        pieces: The shown pieces.
        panes: Of a blended material, alpha and mean colour of hidden faces, float64 [m, 4].
        is_coarse: Pieces ended before they were small enough.
        is_blended: Of a blended material, faces show alpha that is neither opaque nor invisible.
        filled: The texture with the nearest shown colour where it is hidden; None without alpha.
    """

    kinds: npt.NDArray[np.int8]
    pieces: Pieces
    panes: Floats
    is_coarse: bool
    is_blended: bool
    filled: Texture | None


def _cut(
    surface: RawSurface, faces: Indices, texture: Texture | None, alpha: Alpha, factor: float, budget: int
) -> _Cut:
    """Cut a material's faces by the alpha of its texture, if that has one, times their corners' alpha.

    Args:
        surface: The surface.
        faces: The material's faces, int64 [m].
        texture: Its texture; None: without.
        alpha: What counts.
        factor: Of the alpha of panes.
        budget: The most faces that pieces add.
    """
    from colonnade import _core

    corners = surface.vertices[surface.faces[faces]]
    uvs = np.zeros((len(faces), 3, 2)) if surface.uvs is None else surface.uvs[faces]
    alphas = np.ones((len(faces), 3)) if surface.alphas is None else surface.alphas[faces]
    kinds, owners, weights, panes, is_coarse, is_blended, filled = _core.cut_alpha(
        np.ascontiguousarray(corners),
        np.ascontiguousarray(uvs),
        np.ascontiguousarray(alphas),
        None if texture is None else texture.compiled,
        None if texture is None else texture.alpha,
        LINEAR,
        alpha.factor,
        alpha.cutoff,
        factor if alpha.blends else None,
        float(np.ptp(surface.vertices, axis=0).max()) * SMALLEST_SPLIT,
        budget,
    )
    whole = None if texture is None or texture.alpha is None else replace(texture, pixels=filled, alpha=None)
    return _Cut(kinds, Pieces(faces[owners], weights), panes, is_coarse, is_blended, whole)


def without_alpha(surface: RawSurface, losses: Losses) -> RawSurface:
    """The surface without what its materials' alpha hides; faces that were cut name theirs in `source_faces`.

    Raises:
        UserError: Nothing of the surface is left.
    """
    if all(material.alpha is None for material in surface.materials):
        return surface
    index = surface.material_index
    whole = [np.flatnonzero(np.array([material.alpha is None for material in surface.materials])[index])]
    textures, materials = list(surface.textures), [replace(material, alpha=None) for material in surface.materials]
    pieces, panes = [], []
    budget = MAX_SPLIT_FACES - len(index)
    # Materials that differ in other than alpha and its picture share the faces that pieces may add
    groups: dict[tuple[Alpha, int | None], list[int]] = {}
    for number, material in enumerate(surface.materials):
        if material.alpha is not None:
            groups.setdefault((material.alpha, material.texture), []).append(number)
    for (alpha, picture), numbers in groups.items():
        faces = np.flatnonzero(np.isin(index, numbers))
        if not len(faces):
            continue
        texture = None if picture is None else surface.textures[picture]
        factor, is_covering = alpha.factor, alpha.blends and alpha.factor > 0.0
        if is_covering:
            alpha = replace(alpha, factor=1.0)
            for number in numbers:
                materials[number] = replace(materials[number], coverage=factor)
        has_mask = texture is not None and texture.alpha is not None
        has_corners = surface.alphas is not None and bool((surface.alphas[faces] < 1.0).any())
        if not has_mask and not has_corners:
            if is_covering or factor >= alpha.cutoff:
                whole.append(faces)
            continue
        cut = _cut(surface, faces, texture, alpha, factor, max(budget, 0))
        whole.append(faces[cut.kinds > 0])
        budget -= len(cut.pieces.owners) - int((cut.kinds == 0).sum())
        pieces.append(cut.pieces)
        losses.add(lost.COARSE_CUTS, cut.is_coarse)
        if alpha.blends:
            seen = (cut.kinds < 0) & (cut.panes[:, 0] >= _THIN)
            panes.append((faces[seen], cut.panes[seen]))
            losses.add(lost.BLENDED, cut.is_blended)
        if cut.filled is not None:
            for number in numbers:
                materials[number] = replace(materials[number], texture=len(textures))
            textures.append(cut.filled)
    surface = replace(surface, materials=tuple(materials), textures=tuple(textures))
    surface, thin = _with_panes(surface, panes)
    kept = np.sort(np.concatenate([*whole, thin]))
    found = Pieces.joined(Pieces.whole(kept), *pieces)
    if not len(found.owners):
        raise UserError("all its faces are transparent by their alpha: export it with alphaMode OPAQUE")
    return replace(surface.pieces(found[np.argsort(found.owners, kind="stable")]), alphas=None)


def _with_panes(surface: RawSurface, panes: list[tuple[Indices, Floats]]) -> tuple[RawSurface, Indices]:
    """The surface with thin faces as panes of their tint, and these faces.

    Args:
        surface: The surface.
        panes: Faces, int64 [k], and their alpha and texture's colour, float64 [k, 4].
    """
    faces = np.concatenate([np.zeros(0, dtype=np.int64), *(pane[0] for pane in panes)])
    if not len(faces):
        return surface, faces
    alpha, shown = np.split(np.concatenate([pane[1] for pane in panes]), [1], axis=1)
    index = surface.material_index.copy()
    albedo = np.array([material.albedo for material in surface.materials])[index[faces]]
    albedo = albedo * shown
    if surface.colours is not None:
        own = surface.colours[faces].mean(axis=1)
        albedo = np.where(np.isfinite(own), own, albedo)
    tints, kinds = np.unique(np.round(1.0 - alpha + alpha * albedo, 3), axis=0, return_inverse=True)
    index[faces] = len(surface.materials) + kinds.reshape(-1)
    materials = [MeshMaterial("glass", (float(red), float(green), float(blue)), 1.0) for red, green, blue in tints]
    colours = None if surface.colours is None else surface.colours.copy()
    if colours is not None:
        colours[faces] = np.nan
    all_materials = (*surface.materials, *materials)
    return replace(surface, materials=all_materials, face_materials=index, colours=colours), faces
