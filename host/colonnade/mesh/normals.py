"""Corner normals: the normals of a face at its three corners, from the file or smoothed up to a crease angle.

Two faces that share an edge have one normal at its ends if the angle between their own normals is at most the crease
angle. Across a sharper edge each face keeps the normal of its side. So a cube keeps its edges, a cylinder is smooth
around its axis, and its caps are flat.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from colonnade.common import fixed_order
from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors
from colonnade.mesh.topology import Faces, edge_keys

#: The crease angle of meshes without normals, degrees.
CREASE = 60.0

#: Edges of more faces than this link each face with so many of the following ones.
_MAX_FAN = 8


@dataclass(frozen=True)
class CornerNormals:
    """Corner normals, and what was done with those of the file.

    Attributes:
        normals: Unit length, or 0 where the adjacent faces' normals cancel, float64 [m, 3, 3].
        flipped: Faces whose normals all pointed to their back, and were negated.
        replaced: Corners whose normal pointed to the back of their face, and was computed anew.
        missing: Corners without a normal in a file that has some.
    """

    normals: Floats
    flipped: int = 0
    replaced: int = 0
    missing: int = 0


def corner_normals(vertices: Floats, faces: Faces, authored: Floats | None, crease: float | None) -> CornerNormals:
    """The corner normals of a clean mesh.

    Args:
        vertices: float64 [n, 3], merged by position.
        faces: int32 [m, 3], each with an area.
        authored: The file's normals of any length, 0 where it has none, float64 [m, 3, 3]; None: it has none.
        crease: Crease angle, degrees; it replaces the file's normals. None: the file's, elsewhere `CREASE`.
    """
    if authored is None or crease is not None or not authored.any():
        return CornerNormals(crease_normals(vertices, faces, CREASE if crease is None else crease))
    lengths = np.abs(authored).max(axis=2)  # not a number for a normal that is none
    given: npt.NDArray[np.bool_] = np.isfinite(lengths) & (lengths > 0)
    normals = unit_vectors(np.where(given[:, :, None], authored, 0.0))
    heights = fixed_order.dot(normals, face_normals(vertices, faces)[:, None])
    is_flipped = np.asarray(given.all(axis=1) & (heights < 0).all(axis=1))
    normals[is_flipped] *= -1.0
    is_back = given & (heights < 0) & ~is_flipped[:, None]
    if (is_back | ~given).any():
        normals = np.where((given & ~is_back)[:, :, None], normals, crease_normals(vertices, faces, CREASE))
    return CornerNormals(normals, int(is_flipped.sum()), int(is_back.sum()), int((~given).sum()))


def face_normals(vertices: Floats, faces: Faces) -> Floats:
    """Unit normals of faces by their winding, float64 [m, 3]."""
    corners = _corners(vertices, faces)
    return unit_vectors(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


def crease_normals(vertices: Floats, faces: Faces, crease: float) -> Floats:
    """Corner normals float64 [m, 3, 3] smoothed up to a crease angle, degrees.

    A corner's normal is the sum of the face normals, weighted by their angle, over the faces around its vertex that
    are connected over edges that are not sharper than the crease angle; 0 where they cancel.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    corners = _corners(vertices, faces)
    sides = np.roll(corners, -1, axis=1) - corners
    normals = unit_vectors(np.cross(sides[:, 0], -sides[:, 2]))
    sides = unit_vectors(sides)
    cosine = -fixed_order.dot(sides, np.roll(sides, 1, axis=1))
    weighted = (fixed_order.arccos(np.clip(cosine, -1.0, 1.0))[:, :, None] * normals[:, None, :]).reshape(-1, 3)

    one, other = _smooth_links(faces, normals, crease)
    shape = (faces.size, faces.size)
    graph = coo_matrix((np.ones(len(one), dtype=np.bool_), (one, other)), shape=shape)
    count, group = connected_components(graph, directed=False)
    sums = [np.bincount(group, weighted[:, axis], count) for axis in range(3)]
    total = np.stack(sums, axis=1).astype(np.float64)
    total[np.linalg.norm(total, axis=1) < 1e-9] = 0.0
    return np.asarray(unit_vectors(total)[group].reshape(-1, 3, 3), dtype=np.float64)


def _smooth_links(faces: Faces, normals: Floats, crease: float) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Pairs of corners, numbered 3 · face + corner, that have one normal: those at the ends of a smooth edge."""
    keys = edge_keys(faces)
    order = np.argsort(keys, kind="stable")
    ordered = keys[order]
    limit = math.cos(math.radians(crease)) - 1e-9
    links: list[tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]] = []
    for step in range(1, _MAX_FAN + 1):
        same = np.flatnonzero(ordered[step:] == ordered[:-step])
        if len(same) == 0:
            break
        one, other = order[same], order[same + step]
        smooth = fixed_order.dot(normals[one // 3], normals[other // 3]) >= limit
        one, other = one[smooth], other[smooth]
        flat = faces.reshape(-1)
        one_end, other_end = _next(one), _next(other)
        against = flat[one] != flat[other]  # the faces run along their edge in opposite directions
        links.append((one, np.where(against, other_end, other)))
        links.append((one_end, np.where(against, other, other_end)))
    if not links:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    return np.concatenate([pair[0] for pair in links]), np.concatenate([pair[1] for pair in links])


def _next(corners: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """The following corner of the same face."""
    return np.where(corners % 3 == 2, corners - 2, corners + 1)


def _corners(vertices: Floats, faces: Faces) -> Floats:
    """Corner positions in units of the mesh's size, float64 [m, 3, 3]."""
    scaled: Floats = vertices / float((vertices.max(axis=0) - vertices.min(axis=0)).max())
    return scaled[faces]
