"""Vectors as rows of arrays."""

from __future__ import annotations

import numpy as np

from colonnade.common.types import Floats


def unit_vectors(vectors: Floats) -> Floats:
    """Vectors [..., 3] scaled to length 1, of any length that float64 holds; zero vectors stay zero."""
    scale = np.abs(vectors).max(axis=-1, keepdims=True)
    safe = vectors / np.where(scale > 0, scale, 1.0)
    length = np.linalg.norm(safe, axis=-1, keepdims=True)
    return np.asarray(safe / np.where(length > 0, length, 1.0), dtype=np.float64)
