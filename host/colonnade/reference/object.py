"""The object in the float reference: its triangles, materials and shadows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats, Indices
from colonnade.common.vectors import unit_vectors
from colonnade.mesh.materials.materials import ROUGH_METAL
from colonnade.reference.embree import RayTracer, Triangles

if TYPE_CHECKING:
    from colonnade.mesh.materials.mesh import Mesh
    from colonnade.scene.view import View


#: Kinds of materials as numbers.
DIFFUSE, MIRROR, GLASS = range(3)
_KINDS = {"diffuse": DIFFUSE, "mirror": MIRROR, "glass": GLASS, ROUGH_METAL: DIFFUSE}


@dataclass(frozen=True)
class ObjectPoints:
    """Hit points of rays on the object, in mesh space.

    Attributes:
        position: float64 [n, 3].
        facing: Unit geometric normals that face the ray, float64 [n, 3].
        normals: Unit shading normals, flipped as `facing`; they may still face away from the ray, float64 [n, 3].
        front: The ray hits the triangle's front, bool [n].
        t: Distance in lengths of the ray's direction, float64 [n].
        albedo: Linear, float64 [n, 3].
        emission: Linear, float64 [n, 3].
    """

    position: Floats
    facing: Floats
    normals: Floats
    front: NDArray[np.bool_]
    t: Floats
    albedo: Floats
    emission: Floats


class PlacedObject:
    """A mesh with the materials of a view.

    Attributes:
        tracer: Of its triangles.
        kinds: Of each face: `DIFFUSE` (also rough metal), `MIRROR` or `GLASS`, int64 [faces].
        alpha: Of each face of rough metal, mirrors and glass the square of its roughness, else 0, float64 [faces].
        ior: Of each face, float64 [faces].
    """

    def __init__(self, mesh: Mesh, view: View) -> None:
        self._mesh, self._flat = mesh, view.flat
        self.tracer = RayTracer(mesh)
        index = np.minimum(mesh.face_materials, len(view.materials) - 1)
        self.kinds = np.array([_KINDS[material.kind] for material in view.materials])[index]
        self._albedo: Floats = np.array([material.albedo for material in view.materials])[index]
        self._emission: Floats = np.array([material.emission for material in view.materials])[index]
        self._has_colours = np.array([material.has_corner_colours for material in view.materials])[index]
        textures = [-1 if material.texture is None else material.texture for material in view.materials]
        self._textures = np.array(textures)[index]
        self.alpha: Floats = np.array([material.roughness**2 for material in view.materials])[index]
        self.ior: Floats = np.array([material.ior for material in view.materials])[index]
        is_glass = self.kinds == GLASS
        self._transmittance = view.shadow_transmittance
        self._opaque = self._tracer_of(~is_glass)
        self._glass = self._tracer_of(is_glass)

    def _tracer_of(self, selected: NDArray[np.bool_]) -> RayTracer | None:
        """A tracer for the selected faces; None if there are none."""
        if selected.all():
            return self.tracer
        if not selected.any():
            return None
        faces = self._mesh.faces[selected]
        return RayTracer(Triangles(self._mesh.vertices, faces))

    def points(self, faces: Indices, origins: Floats, directions: Floats) -> ObjectPoints:
        """Hit points of rays on the faces that `RayTracer.first_hits` returned for them."""
        hits = self.tracer.surface_points(faces, origins, directions)
        corners = self.tracer.corners[faces]
        geometric = unit_vectors(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        is_back = np.einsum("ni,ni->n", geometric, directions) > 0
        sign = np.where(is_back, -1.0, 1.0)[:, None]
        facing = geometric * sign
        normals = facing
        if not self._flat:
            smooth = np.einsum("nj,njk->nk", hits.weights, self._mesh.corner_normals[faces]) * sign
            normals = np.where(smooth.any(axis=1, keepdims=True), smooth, facing)
        albedo = self._albedo[faces]
        if self._mesh.corner_colours is not None:
            colours = np.einsum("nj,njk->nk", hits.weights, self._mesh.corner_colours[faces])
            albedo = np.where(self._has_colours[faces][:, None], albedo * colours, albedo)
        if self._mesh.corner_uvs is not None:
            uvs = np.einsum("nj,njk->nk", hits.weights, self._mesh.corner_uvs[faces])
            for number, texture in enumerate(self._mesh.textures):
                shows = np.flatnonzero(self._textures[faces] == number)
                albedo[shows] = albedo[shows] * texture.colours(uvs[shows])
        return ObjectPoints(
            hits.position, facing, unit_vectors(normals), ~is_back, hits.t, albedo, self._emission[faces]
        )

    def light_transmittance(self, origins: Floats, to_light: Floats) -> Floats:
        """Transmittance from the light at origin + ``to_light`` to each origin, 0 behind opaque faces, float64 [n]."""
        transmittance = np.ones(len(origins))
        if self._glass is not None:
            transmittance[self._glass.occluded(origins, to_light)] = self._transmittance
        if self._opaque is not None:
            transmittance[self._opaque.occluded(origins, to_light)] = 0.0
        return transmittance
