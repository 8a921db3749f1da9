"""Cuts away what the alpha of materials does not show: the device's surfaces have no alpha.

A face whose texels are all below the cutoff is dropped. One with texels on both sides is split into four, the largest
first, until its pieces are as small as a texel or the mesh has `MAX_SPLIT_FACES`. What is left is cut along a line.
The alpha of corners multiplies that of the texture. Without one it is linear on a face, so the line is exact.
Of blended materials the cutoff is 1/2, and faces that are thinner everywhere become tinted panes without refraction.
Their factor is the coverage of the material, which passes show (`colonnade.mesh.materials.materials.in_pass`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from colonnade.common import fixed_order
from colonnade.common.errors import UserError
from colonnade.common.types import Floats, Indices
from colonnade.mesh import losses as lost
from colonnade.mesh.geometry.topology import MAX_SPLIT_FACES, SMALLEST_SPLIT, subdivide_corners, triangle_points
from colonnade.mesh.losses import Losses
from colonnade.mesh.materials.materials import Alpha, MeshMaterial
from colonnade.mesh.materials.pixel_boxes import PixelCounts, pixel_boxes, unfolded
from colonnade.mesh.materials.surface import RawSurface
from colonnade.mesh.materials.texture import Texture

#: Steps of samples along an edge of a face, at most.
_STEPS = 32
#: Samples that are taken at a time.
_SAMPLES = 1 << 21
#: Blended faces of less alpha are not shown.
_THIN = 0.05


@dataclass(frozen=True)
class _Pieces:
    """Parts of faces.

    Attributes:
        owners: The face of each, int64 [k].
        weights: Weights of the owner's corners at the corners of each, float64 [k, 3, 3].
    """

    owners: Indices
    weights: Floats

    def __getitem__(self, chosen: npt.NDArray[np.bool_] | Indices) -> _Pieces:
        return _Pieces(self.owners[chosen], self.weights[chosen])

    @classmethod
    def joined(cls, *parts: _Pieces) -> _Pieces:
        owners = np.concatenate([part.owners for part in parts])
        return cls(owners, np.concatenate([part.weights for part in parts]))

    def uvs(self, surface: RawSurface) -> Floats:
        """Positions in their textures, float64 [k, 3, 2]."""
        assert surface.uvs is not None
        found: Floats = fixed_order.product(self.weights, surface.uvs[self.owners])
        return found


def without_alpha(surface: RawSurface, losses: Losses) -> RawSurface:
    """The surface without what its materials' alpha hides; faces that were cut name theirs in `source_faces`.

    Raises:
        UserError: Nothing of the surface is left.
    """
    if all(material.alpha is None for material in surface.materials):
        return surface
    if surface.clip is not None:
        losses.add(lost.BENT_ALPHA, sum(material.alpha is not None for material in surface.materials))
        return replace(surface, materials=tuple(replace(material, alpha=None) for material in surface.materials))
    index = surface.material_index
    whole = [np.flatnonzero(np.array([material.alpha is None for material in surface.materials])[index])]
    textures, materials = list(surface.textures), [replace(material, alpha=None) for material in surface.materials]
    pieces, panes = [], []
    budget = MAX_SPLIT_FACES - len(index)
    for number, material in enumerate(surface.materials):
        faces = np.flatnonzero(index == number)
        if material.alpha is None or not len(faces):
            continue
        texture = None if material.texture is None else surface.textures[material.texture]
        has_mask = texture is not None and texture.alpha is not None
        has_corners = surface.alphas is not None and bool((surface.alphas[faces] < 1.0).any())
        if not has_mask and not has_corners:
            if material.alpha.blends and material.alpha.factor > 0.0:
                materials[number] = replace(materials[number], coverage=material.alpha.factor)
                whole.append(faces)
            elif material.alpha.factor >= material.alpha.cutoff:
                whole.append(faces)
            continue
        alpha = material.alpha
        if alpha.blends and alpha.factor > 0.0:
            materials[number] = replace(materials[number], coverage=alpha.factor)
            alpha = replace(alpha, factor=1.0)
        cut = _Cut(surface, texture if has_mask else None, alpha, has_corners)
        inside, mixed, outside = cut.sorted(faces)
        whole.append(inside)
        if len(mixed):
            found = cut.pieces(mixed, max(budget, 0), losses)
            budget -= len(found.owners) - len(mixed)
            pieces.append(found)
        if material.alpha.blends:
            panes.append(_panes(surface, texture, material.alpha.factor, outside))
            losses.add(lost.BLENDED, int(cut.is_blended(faces)))
        if has_mask:
            materials[number] = replace(materials[number], texture=len(textures))
            textures.append(cut.filled())
    surface = replace(surface, materials=tuple(materials), textures=tuple(textures))
    surface, thin = _with_panes(surface, panes)
    kept = np.sort(np.concatenate([*whole, thin]))
    found = _Pieces.joined(_Pieces(kept, np.repeat(np.eye(3)[None], len(kept), axis=0)), *pieces)
    if not len(found.owners):
        raise UserError("all its faces are transparent by their alpha: export it with alphaMode OPAQUE")
    return _split(surface, found[np.argsort(found.owners, kind="stable")])


def _panes(
    surface: RawSurface, texture: Texture | None, factor: float, faces: Indices
) -> tuple[Indices, Floats, Floats]:
    """Of faces that are not opaque, those that can be seen, their alpha and the colour of their texture."""
    weights = triangle_points(4)
    alpha, colours = np.full((len(faces), len(weights)), factor), np.ones((len(faces), 3))
    if surface.alphas is not None:
        alpha *= fixed_order.product(weights, surface.alphas[faces][..., None])[..., 0]
    if texture is not None and surface.uvs is not None and len(faces):
        at = fixed_order.product(weights, surface.uvs[faces]).reshape(-1, 2)
        alpha *= texture.alphas(at).reshape(len(faces), -1)
        shown = texture.colours(at).reshape(len(faces), -1, 3) * alpha[..., None]
        colours = shown.sum(axis=1) / np.maximum(alpha.sum(axis=1, keepdims=True), 1e-12)
    mean = alpha.mean(axis=1)
    seen = mean >= _THIN
    return faces[seen], mean[seen], colours[seen]


def _with_panes(surface: RawSurface, panes: list[tuple[Indices, Floats, Floats]]) -> tuple[RawSurface, Indices]:
    """The surface with thin faces as panes of their tint, and these faces, of their alpha and texture's colour."""
    faces = np.concatenate([np.zeros(0, dtype=np.int64), *(pane[0] for pane in panes)])
    if not len(faces):
        return surface, faces
    alpha = np.concatenate([pane[1] for pane in panes])[:, None]
    index = surface.material_index.copy()
    albedo = np.array([material.albedo for material in surface.materials])[index[faces]]
    albedo = albedo * np.concatenate([pane[2] for pane in panes])
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


class _Cut:
    """The cut of a material's faces by the alpha of its texture, if that has one, times that of their corners."""

    def __init__(self, surface: RawSurface, texture: Texture | None, alpha: Alpha, has_corners: bool) -> None:
        self._surface, self._texture, self._alpha = surface, texture, alpha
        self._corners = surface.alphas if has_corners else None
        #: Least product of both that is shown.
        self._least = alpha.cutoff / max(alpha.factor, 1e-6)
        if texture is not None:
            assert texture.alpha is not None
            self._opaque = unfolded(texture.alpha >= self._least * 255.0, texture.wrap)
            self._marked = [PixelCounts(marks, texture) for marks in (~self._opaque, self._opaque)]

    def sorted(self, faces: Indices) -> tuple[Indices, Indices, Indices]:
        """Faces that are shown, those on both sides of the cutoff, and those that are hidden."""
        kinds = self._kinds(_Pieces(faces, np.repeat(np.eye(3)[None], len(faces), axis=0)))
        return faces[kinds == 1], faces[kinds == 0], faces[kinds == -1]

    def pieces(self, faces: Indices, budget: int, losses: Losses) -> _Pieces:
        """The shown parts of faces, of at most so many more."""
        surface = self._surface
        corners = surface.vertices[surface.faces]
        smallest = float(np.ptp(surface.vertices, axis=0).max()) * SMALLEST_SPLIT
        mixed, shown = _Pieces(faces, np.repeat(np.eye(3)[None], len(faces), axis=0)), []
        while True:
            own = fixed_order.product(mixed.weights, corners[mixed.owners])
            edges = np.linalg.norm(own - np.roll(own, -1, axis=1), axis=2).max(axis=1)
            texels = self._texels(mixed)
            can_split = (edges > smallest) & (texels > 1.0)
            # Pieces of about the same size at a time, the largest of them within the budget
            chosen = np.flatnonzero(can_split & (edges > 0.5 * edges[can_split].max(initial=0.0)))
            chosen = chosen[np.argsort(-edges[chosen], kind="stable")][: budget // 3]
            if not len(chosen):
                break
            budget -= 3 * len(chosen)
            rest = np.ones(len(edges), dtype=np.bool_)
            rest[chosen] = False
            parts = _Pieces(np.repeat(mixed.owners[chosen], 4), subdivide_corners(mixed.weights[chosen]))
            kinds = self._kinds(parts)
            budget += int((kinds == -1).sum())
            shown.append(parts[kinds == 1])
            mixed = _Pieces.joined(mixed[rest], parts[kinds == 0])
        losses.add(lost.COARSE_CUTS, int(can_split.any()))
        return _Pieces.joined(*shown, self._cut_straight(mixed))

    def is_blended(self, faces: Indices) -> bool:
        """Whether faces show texels, or points between their corners, that are neither opaque nor invisible."""
        if self._corners is not None:
            alphas = self._corners[faces] * self._alpha.factor
            if ((alphas.max(axis=1) > 0.01) & (alphas.min(axis=1) < 0.99)).any():
                return True
        if self._texture is None:
            return False
        assert self._surface.uvs is not None and self._texture.alpha is not None
        alpha = unfolded(self._texture.alpha, self._texture.wrap) * self._alpha.factor
        counts = PixelCounts((alpha > 2.0) & (alpha < 253.0), self._texture)
        return bool(counts.within(*pixel_boxes(self._surface.uvs[faces], self._texture)).any())

    def filled(self) -> Texture:
        """The texture with the nearest shown colour where it is hidden, so that filters find no other."""
        from scipy.ndimage import distance_transform_edt

        assert self._texture is not None
        height, width = self._texture.pixels.shape[:2]
        shown = self._opaque[:height, :width]
        if not shown.any():
            return replace(self._texture, alpha=None)
        rows, columns = distance_transform_edt(~shown, return_distances=False, return_indices=True)
        return replace(self._texture, pixels=self._texture.pixels[rows, columns], alpha=None)

    def _alphas(self, pieces: _Pieces, weights: Floats) -> Floats:
        """Alpha at points of pieces, by the weights of their corners, without the factor, float64 [k, n]."""
        found = np.ones((len(pieces.owners), len(weights)))
        if self._texture is not None:
            at = fixed_order.product(weights, pieces.uvs(self._surface))
            found *= self._texture.alphas(at.reshape(-1, 2)).reshape(found.shape)
        if self._corners is not None:
            own = fixed_order.product(pieces.weights, self._corners[pieces.owners][..., None])
            found *= fixed_order.product(weights, own)[..., 0]
        return found

    def _texels(self, pieces: _Pieces) -> Floats:
        """Texels of the texture along the longer side of each piece, float64 [k]."""
        if self._texture is None:
            return np.zeros(len(pieces.owners))
        return np.asarray(np.ptp(pieces.uvs(self._surface) * self._texture.size, axis=1).max(axis=1))

    def _kinds(self, pieces: _Pieces) -> npt.NDArray[np.int8]:
        """1 for pieces that are shown, -1 for those that are hidden, 0 for others, int8 [k]."""
        if self._texture is None:
            shown = self._alphas(pieces, np.eye(3)) >= self._least
            return np.where(shown.all(axis=1), 1, np.where(shown.any(axis=1), 0, -1)).astype(np.int8)
        kinds = np.zeros(len(pieces.owners), dtype=np.int8)
        if self._corners is None:
            first, last = pixel_boxes(pieces.uvs(self._surface), self._texture)
            hides, shows = (marked.within(first, last) > 0 for marked in self._marked)
            kinds = np.where(hides & shows, 0, np.where(shows, 1, -1)).astype(np.int8)
        # The box of a face is larger than the face: look at its own texels
        extent = self._texels(pieces)
        fraction, exponent = np.frexp(np.maximum(extent, 1.0))
        steps = np.clip(2 ** (exponent - (fraction == 0.5)).astype(np.int64), 2, _STEPS)  # the next power of two
        for count in np.unique(steps[kinds == 0]):
            weights = triangle_points(int(count))
            asked = np.flatnonzero((kinds == 0) & (steps == count))
            for chunk in np.array_split(asked, -(-len(asked) * len(weights) // _SAMPLES) or 1):
                shown = (self._alphas(pieces[chunk], weights) >= self._least).mean(axis=1)
                is_sure = extent[chunk] <= 2 * count
                kinds[chunk] = np.where(is_sure & (shown == 1), 1, np.where(is_sure & (shown == 0), -1, 0))
        return kinds

    def _cut_straight(self, pieces: _Pieces) -> _Pieces:
        """The shown side of pieces, cut where the alpha of their corners crosses the cutoff."""
        above = self._alphas(pieces, np.eye(3)) - self._least
        shown = above >= 0
        count = shown.sum(axis=1)
        found = [pieces[count == 3]]
        for inside in (1, 2):
            # The corner that is alone comes first
            chosen = np.flatnonzero(count == inside)
            alone = (shown[chosen] if inside == 1 else ~shown[chosen]).argmax(axis=1)
            order = (alone[:, None] + np.arange(3)) % 3
            own = np.take_along_axis(pieces.weights[chosen], order[:, :, None], axis=1)
            value = np.take_along_axis(above[chosen], order, axis=1)
            share = (value[:, :1] / (value[:, :1] - value[:, 1:]))[:, :, None]
            tip, cut = own[:, :1], own[:, :1] + share * (own[:, 1:] - own[:, :1])
            owners = pieces.owners[chosen]
            if inside == 1:
                found.append(_Pieces(owners, np.concatenate([tip, cut], axis=1)))
            else:
                found.append(_Pieces(owners, np.stack([cut[:, 0], own[:, 1], own[:, 2]], axis=1)))
                found.append(_Pieces(owners, np.stack([cut[:, 0], own[:, 2], cut[:, 1]], axis=1)))
        return _Pieces.joined(*found)


def _split(surface: RawSurface, pieces: _Pieces) -> RawSurface:
    """The surface of pieces of its faces."""
    owners, weights = pieces.owners, pieces.weights

    def interpolated(values: Floats | None) -> Floats | None:
        return None if values is None else fixed_order.product(weights, values[owners])

    # Corners that are kept keep their vertex
    kept = weights.max(axis=2) == 1.0
    corner = np.take_along_axis(surface.faces[owners], weights.argmax(axis=2), axis=1)
    own = fixed_order.product(weights, surface.vertices[surface.faces[owners]])
    faces = np.where(kept, corner, 0)
    faces[~kept] = len(surface.vertices) + np.arange(int((~kept).sum()))
    return replace(
        surface,
        vertices=np.concatenate([surface.vertices, own[~kept]]),
        faces=faces,
        normals=interpolated(surface.normals),
        face_materials=surface.material_index[owners],
        colours=interpolated(surface.colours),
        uvs=interpolated(surface.uvs),
        source_faces=owners,
        single_sided=None if surface.single_sided is None else surface.single_sided[owners],
        source_count=len(surface.faces),
        relief=None if surface.relief is None else surface.relief.pieces(owners, weights),
        alphas=None,
    )
