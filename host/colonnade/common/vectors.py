"""Operations on arrays of vectors."""

from __future__ import annotations

import numpy as np

from colonnade.common.types import Floats


def unit_vectors(vectors: Floats) -> Floats:
    """Scale vectors [..., 3] of any finite length to length 1; zero vectors stay zero."""
    scale = np.abs(vectors).max(axis=-1, keepdims=True)
    safe = vectors / np.where(scale > 0, scale, 1.0)
    length = np.linalg.norm(safe, axis=-1, keepdims=True)
    return np.asarray(safe / np.where(length > 0, length, 1.0), dtype=np.float64)


def cofactors(linear: Floats) -> Floats:
    """What turns normals as ``linear`` [..., 3, 3] turns surfaces: its inverse transpose, times its determinant.

    It also exists for flat transforms.
    """
    x, y, z = (linear[..., i] for i in range(3))
    return np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=-1)
