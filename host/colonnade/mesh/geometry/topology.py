"""Operations on indexed triangle meshes: subdivision and merging."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from colonnade.common.types import Floats

Faces = npt.NDArray[np.int32]

#: Faces up to which a mesh is split where its maps vary.
MAX_SPLIT_FACES = 49152
#: Edge of the smallest parts, of the longest edge of the mesh.
SMALLEST_SPLIT = 1 / 400


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
    return np.concatenate([vertices, vertices[unique].mean(axis=1)]), _quarters(faces, middle)


def subdivide_corners(values: Floats) -> Floats:
    """Values of the corners of faces after `subdivide`: float64 [m, 3, k] becomes [4·m, 3, k]."""
    return _quarters(values, (values + values[:, [1, 2, 0]]) / 2)


def _quarters(corners: npt.NDArray[Any], middles: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The corners of the four parts of faces: [m, 3, …] and the middles of their edges become [4·m, 3, …]."""
    (a, b, c), (ab, bc, ca) = np.moveaxis(corners, 1, 0), np.moveaxis(middles, 1, 0)
    parts = [np.stack(part, 1) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    return np.stack(parts, 1).reshape(-1, *corners.shape[1:])


def merge_rows(rows: Floats) -> tuple[Floats, npt.NDArray[np.int64]]:
    """The distinct rows [k, 3] in ascending order, and each row's index among them, int64 [n]."""
    from colonnade import _core

    merged: tuple[Floats, npt.NDArray[np.int64]] = _core.merge_rows(rows)
    return merged
