"""Operations on indexed triangle meshes: subdivision and merging."""

from __future__ import annotations

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
    a, b, c = faces.T
    ab, bc, ca = middle.T
    quarters = np.stack([np.stack(corners, 1) for corners in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))], 1)
    return np.concatenate([vertices, vertices[unique].mean(axis=1)]), quarters.reshape(-1, 3)


def subdivide_corners(values: Floats) -> Floats:
    """Values of the corners of faces after `subdivide`: float64 [m, 3, k] becomes [4·m, 3, k]."""
    a, b, c = np.moveaxis(values, 1, 0)
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    quarters = np.stack([np.stack(corners, 1) for corners in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))], 1)
    return quarters.reshape(-1, 3, values.shape[2])


def triangle_points(steps: int) -> Floats:
    """Weights of the corners at points that are spread evenly over a triangle, float64 [steps · (steps + 1) / 2, 3]."""
    a, b = np.meshgrid(np.arange(steps), np.arange(steps), indexing="ij")
    inside = a + b < steps
    first, second = (a[inside] + 1 / 3) / steps, (b[inside] + 1 / 3) / steps
    return np.stack([first, second, 1 - first - second], axis=1)


def merge_rows(rows: Floats) -> tuple[Floats, npt.NDArray[np.int64]]:
    """The distinct rows [k, 3] in ascending order, and each row's index among them, int64 [n]."""
    from colonnade import _core

    merged: tuple[Floats, npt.NDArray[np.int64]] = _core.merge_rows(rows)
    return merged
