"""What the mesh has at the points that pixels show: albedo and shading normals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats, Indices
from colonnade.common.vectors import unit_vectors
from colonnade.mesh.materials.mesh import Mesh


@dataclass(frozen=True)
class HitPoints:
    """The points of a mesh that a frame shows.

    Attributes:
        mesh: The mesh, with the materials of the scene.
        is_hit: The pixel shows one, bool [height, width].
        faces: The faces of the mesh there, int64 [n].
        weights: Barycentric coordinates of the points in them, float64 [n, 3].
    """

    mesh: Mesh
    is_hit: NDArray[np.bool_]
    faces: Indices
    weights: Floats

    @staticmethod
    def of(mesh: Mesh, hits: Indices, position: Floats) -> HitPoints:
        """The points of pixels.

        Args:
            mesh: The mesh, with the materials of the scene.
            hits: The face of the file at each, -1 for none, int64 [height, width].
            position: The points, in its space, float64 [height, width, 3].
        """
        is_hit = hits >= 0
        # Any part of a face of the file serves: normals, textures and colours are about linear on all of it
        part = np.zeros(mesh.source_count, dtype=np.int64)
        part[mesh.source_faces] = np.arange(len(mesh.faces))
        faces = part[hits[is_hit]]
        a, b, c = np.moveaxis(mesh.vertices[mesh.faces[faces]], 1, 0)
        across, up, way = b - a, c - a, position[is_hit] - a
        along, slope, rise = (across**2).sum(axis=1), (across * up).sum(axis=1), (up**2).sum(axis=1)
        first, second = (way * across).sum(axis=1), (way * up).sum(axis=1)
        area = np.maximum(along * rise - slope**2, 1e-300)
        beta, gamma = (first * rise - second * slope) / area, (second * along - first * slope) / area
        return HitPoints(mesh, is_hit, faces, np.stack([1 - beta - gamma, beta, gamma], axis=1))

    def albedo(self) -> Floats:
        """Linear, float64 [height, width, 3]; 0 where there is no point."""
        mesh, faces = self.mesh, self.faces
        index = mesh.face_materials[faces]
        colours = np.array([material.albedo for material in mesh.materials])[index]
        for number, material in enumerate(mesh.materials):
            users = np.flatnonzero(index == number)
            if material.texture is not None and mesh.corner_uvs is not None:
                colours[users] *= mesh.textures[material.texture].colours(self._between(mesh.corner_uvs, users))
            elif material.has_corner_colours and mesh.corner_colours is not None:
                colours[users] *= self._between(mesh.corner_colours, users)
        return self._picture(colours.clip(0.0, 1.0))

    def normals(self) -> Floats:
        """Shading normals in the space of the mesh, unit length, float64 [height, width, 3]; 0 where there is none."""
        return self._picture(unit_vectors(self._between(self.mesh.corner_normals)))

    def _between(self, corners: Floats, which: Indices | slice = np.s_[:]) -> Floats:
        """Values of corners, [faces, 3, k], at the points."""
        return np.asarray(np.einsum("nci,nc->ni", corners[self.faces[which]], self.weights[which]))

    def _picture(self, values: Floats) -> Floats:
        found = np.zeros((*self.is_hit.shape, 3))
        found[self.is_hit] = values
        return found
