"""Fewer triangles, by quadric error metrics (fast-simplification). What corners and faces have comes from the nearest
face of the mesh before."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colonnade.common.errors import UserError
from colonnade.common.types import Floats, Indices
from colonnade.mesh.geometry.normals import face_normals
from colonnade.mesh.geometry.topology import Faces
from colonnade.mesh.materials.mesh import Mesh

#: Faces whose distances are compared: those with the nearest centres.
_CANDIDATES = 12
#: Where the attributes of a corner are taken: so far from it to the middle of its face, which keeps creases.
_INWARD = 0.1
#: Texture coordinates lie at a seam if a face spans so many times what the nearest face's mapping gives it.
_SEAM = 2.0


@dataclass(frozen=True)
class Simplified:
    """A mesh before it is cleaned, with the attributes of its faces and corners as in `Mesh`.

    Attributes:
        owners: The nearest face of the mesh before, int64 [m].
        seams: Faces across a seam of textures, with the coordinates of one side.
    """

    vertices: Floats
    faces: Faces
    owners: Indices
    corner_normals: Floats
    corner_colours: Floats | None
    corner_uvs: Floats | None
    seams: int


def simplified(mesh: Mesh, triangles: int) -> Simplified:
    """About so many triangles, fewer than the mesh has.

    Normals, colours and texture coordinates of corners are interpolated on the surface before.

    Raises:
        UserError: No triangle is left.
    """
    import fast_simplification

    # Its thresholds are lengths, for a mesh as long as 1
    scale = mesh.extent.edge
    vertices, faces = fast_simplification.simplify(mesh.vertices / scale, mesh.faces, target_count=triangles)
    vertices = vertices * scale
    if len(faces) == 0:
        raise UserError(f"mesh {mesh.name} has no shape of {triangles:,} triangles: simplify it less")
    surface = _Surface(mesh)
    corners = vertices[faces]
    middles, normals = corners.mean(axis=1), face_normals(vertices, faces)
    owners, _ = surface.nearest(middles, normals)
    inward = corners + _INWARD * (middles[:, None] - corners)
    places, weights = surface.nearest(inward.reshape(-1, 3), np.repeat(normals, 3, axis=0))

    def of_corners(values: Floats | None) -> Floats | None:
        return None if values is None else (weights[..., None] * values[places]).sum(axis=1).reshape(len(faces), 3, -1)

    normals_of_corners, uvs, seams = of_corners(mesh.corner_normals), of_corners(mesh.corner_uvs), 0
    assert normals_of_corners is not None
    if uvs is not None and mesh.corner_uvs is not None:
        shares = surface.weights(corners, owners[:, None])
        of_side = (shares[..., None] * mesh.corner_uvs[owners][:, None]).sum(axis=2)
        torn = np.ptp(uvs, axis=1).max(axis=1) > _SEAM * np.ptp(of_side, axis=1).max(axis=1)
        uvs[torn], seams = of_side[torn], int(torn.sum())
    colours = of_corners(mesh.corner_colours)
    return Simplified(vertices, faces.astype(np.int32), owners, normals_of_corners, colours, uvs, seams)


class _Surface:
    """The faces of a mesh, searched by position and normal."""

    def __init__(self, mesh: Mesh) -> None:
        from scipy.spatial import cKDTree

        self._corners = mesh.vertices[mesh.faces]
        self._normals = face_normals(mesh.vertices, mesh.faces)
        self._tree = cKDTree(self._corners.mean(axis=1))

    def nearest(self, points: Floats, normals: Floats) -> tuple[Indices, Floats]:
        """The nearest face on the same side for each point, int64 [n], and its weights of corners, float64 [n, 3]."""
        count = min(_CANDIDATES, len(self._corners))
        faces = self._tree.query(points, count)[1].reshape(len(points), count)
        weights = np.maximum(self.weights(points[:, None], faces), 0.0)
        weights /= weights.sum(axis=2, keepdims=True)
        found = (weights[..., None] * self._corners[faces]).sum(axis=2)
        distances = ((found - points[:, None]) ** 2).sum(axis=2)
        distances[(self._normals[faces] * normals[:, None]).sum(axis=2) < 0] += distances.max()
        best = np.argmin(distances, axis=1)
        rows = np.arange(len(points))
        return faces[rows, best].astype(np.int64), weights[rows, best]

    def weights(self, points: Floats, faces: Indices) -> Floats:
        """Barycentric weights [..., 3] of points [..., 3], projected into the planes of faces [...]."""
        a, b, c = (self._corners[faces][..., corner, :] for corner in range(3))
        u, v, w = b - a, c - a, points - a
        uu, uv, vv = (u * u).sum(-1), (u * v).sum(-1), (v * v).sum(-1)
        uw, vw = (u * w).sum(-1), (v * w).sum(-1)
        area = np.maximum(uu * vv - uv * uv, 1e-12 * uu * vv)  # a sliver's may round to 0
        first, second = (vv * uw - uv * vw) / area, (uu * vw - uv * uw) / area
        return np.stack([1 - first - second, first, second], axis=-1)
