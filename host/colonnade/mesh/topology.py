"""Operations on indexed triangle meshes: subdivision, merging, cleaning and vertex normals."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors

Faces = npt.NDArray[np.int32]


def subdivide(vertices: Floats, faces: npt.NDArray[np.int64]) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Split each triangle into four at its edge midpoints; the surface does not change.

    Args:
        vertices: float64 [n, 3].
        faces: int64 [m, 3].

    Returns:
        All vertices, the old ones first, and faces int64 [4·m, 3]; the four of a triangle are consecutive.
    """
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    unique, inverse = np.unique(edges, axis=0, return_inverse=True)
    middle = inverse.reshape(-1, 3) + len(vertices)
    a, b, c = faces.T
    ab, bc, ca = middle.T
    quarters = np.stack([np.stack(corners, 1) for corners in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))], 1)
    return np.concatenate([vertices, vertices[unique].mean(axis=1)]), quarters.reshape(-1, 3)


def merge_rows(rows: npt.NDArray[Any]) -> tuple[npt.NDArray[Any], npt.NDArray[np.int64]]:
    """The distinct rows [k, 3] in ascending order, and each row's index among them, int64 [n]."""
    order = np.lexsort((rows[:, 2], rows[:, 1], rows[:, 0]))
    ordered = rows[order]
    first = np.ones(len(rows), dtype=bool)
    first[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    index = np.empty(len(rows), dtype=np.int64)
    index[order] = np.cumsum(first) - 1
    return ordered[first], index


def drop_faces(vertices: npt.NDArray[Any], faces: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
    """Indices of the faces to keep, ascending: with an area, and the first of each vertex set."""
    corners = vertices[faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).any(axis=1)
    candidates = np.flatnonzero(area)
    ordered = np.sort(faces[candidates], axis=1)
    sets, index = merge_rows(ordered)
    first = np.full(len(sets), len(faces), dtype=np.int64)
    np.minimum.at(first, index, candidates)
    return np.sort(first)


def vertex_normals(vertices: Floats, faces: Faces) -> Floats:
    """Unit normals float64 [n, 3]: the face normals weighted by their angle at the vertex; 0 where they cancel."""
    corners = vertices[faces] / float((vertices.max(axis=0) - vertices.min(axis=0)).max())
    sides = np.roll(corners, -1, axis=1) - corners
    normals = unit_vectors(np.cross(sides[:, 0], -sides[:, 2]).astype(np.float64))
    sides = unit_vectors(sides)
    cosine = -np.einsum("mcx,mcx->mc", sides, np.roll(sides, 1, axis=1))
    weighted = np.arccos(np.clip(cosine, -1.0, 1.0))[:, :, None] * normals[:, None, :]
    flat, target = weighted.reshape(-1, 3), faces.reshape(-1)
    sums = [np.bincount(target, flat[:, axis], len(vertices)) for axis in range(3)]
    total = np.stack(sums, axis=1).astype(np.float64)
    total[np.linalg.norm(total, axis=1) < 1e-9] = 0.0
    return unit_vectors(total)
