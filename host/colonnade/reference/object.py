"""The object as the float reference sees it: its triangles, their materials, and what they let through of a light."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats, Indices
from colonnade.common.vectors import unit_vectors
from colonnade.reference.embree import RayTracer, Triangles

if TYPE_CHECKING:
    from colonnade.mesh.mesh import Mesh
    from colonnade.scene.view import View


#: Kinds of materials as numbers.
DIFFUSE, MIRROR, GLASS = range(3)
_KINDS = {"diffuse": DIFFUSE, "mirror": MIRROR, "glass": GLASS}


@dataclass(frozen=True)
class ObjectPoints:
    """Where rays meet the object, mesh space.

    Attributes:
        position: float64 [n, 3].
        facing: Geometric normals against the ray, float64 [n, 3], unit.
        normals: Shading normals, turned as those, float64 [n, 3], unit; may still turn away from the ray.
        front: bool [n], the ray meets the triangle's front.
        t: float64 [n], in lengths of the ray's direction.
    """

    position: Floats
    facing: Floats
    normals: Floats
    front: NDArray[np.bool_]
    t: Floats


class PlacedObject:
    """A mesh with the materials of a placement."""

    def __init__(self, mesh: Mesh, view: View) -> None:
        self._mesh, self._flat = mesh, view.flat
        self.tracer = RayTracer(mesh)
        index = np.minimum(mesh.face_materials, len(view.materials) - 1)
        self.kinds = np.array([_KINDS[material.kind] for material in view.materials])[index]
        self.albedo: Floats = np.array([material.albedo for material in view.materials])[index]
        self.ior: Floats = np.array([material.ior for material in view.materials])[index]
        is_clear = self.kinds == GLASS
        self._transmittance = view.shadow_transmittance
        self._opaque = self._tracer_of(~is_clear)
        self._clear = self._tracer_of(is_clear)

    def _tracer_of(self, chosen: NDArray[np.bool_]) -> RayTracer | None:
        if chosen.all():
            return self.tracer
        if not chosen.any():
            return None
        faces = self._mesh.faces[chosen]
        return RayTracer(Triangles(self._mesh.vertices, faces))

    def points(self, faces: Indices, origins: Floats, directions: Floats) -> ObjectPoints:
        """Where rays meet the faces that they were found to meet first."""
        met = self.tracer.surface_points(faces, origins, directions)
        corners = self.tracer.corners[faces]
        geometric = unit_vectors(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        back_side = np.einsum("ni,ni->n", geometric, directions) > 0
        turned = np.where(back_side, -1.0, 1.0)[:, None]
        facing = geometric * turned
        normals = facing
        if not self._flat:
            mesh = self._mesh
            smooth = np.einsum("nj,njk->nk", met.weights, mesh.vertex_normals[mesh.faces[faces]]) * turned
            normals = np.where(smooth.any(axis=1, keepdims=True), smooth, facing)
        return ObjectPoints(met.position, facing, unit_vectors(normals), ~back_side, met.t)

    def let_through(self, origins: Floats, to_light: Floats) -> Floats:
        """What reaches each origin of a light at origin + ``to_light``: 0 behind something opaque; float64 [n]."""
        share = np.ones(len(origins))
        if self._clear is not None:
            share[self._clear.occluded(origins, to_light)] = self._transmittance
        if self._opaque is not None:
            share[self._opaque.occluded(origins, to_light)] = 0.0
        return share
