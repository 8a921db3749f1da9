"""Newell's teapot of 1975, tessellated from its control points: 28 published Bézier patches and the later bottom.

Body, lid and bottom are surfaces of revolution: a profile and Newell's cubic quarter circle (an approximation) give
their control points. Handle and spout are mirrored halves.

This is our own code because no library that we use contains the teapot, and the default scene needs a mesh without a
download. Adjacent patches share their edges bit for bit, so the mesh is closed without a merging tolerance.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from colonnade.common.types import Floats

# Profiles of the surfaces of revolution: (radius, height), starting at the rim.
_PROFILES: tuple[tuple[tuple[float, float], ...], ...] = (
    ((1.4, 2.4), (1.3375, 2.53125), (1.4375, 2.53125), (1.5, 2.4)),  # rim
    ((1.5, 2.4), (1.75, 1.875), (2.0, 1.35), (2.0, 0.9)),  # upper body
    ((2.0, 0.9), (2.0, 0.45), (1.5, 0.225), (1.5, 0.15)),  # lower body
    ((0.0, 3.15), (0.8, 3.15), (0.0, 2.85), (0.2, 2.7)),  # knob of the lid
    ((0.2, 2.7), (0.4, 2.55), (1.3, 2.55), (1.3, 2.4)),  # lid
    ((1.5, 0.15), (1.5, 0.075), (1.425, 0.0), (0.0, 0.0)),  # bottom
)
# Control point of the quarter circle of radius 1. The original data rounds 0.448, for radius 0.8, to 0.45.
_QUARTER = 0.56
_ROUNDED = {0.8: 0.5625}

# Handle and spout: rows of four points (x, half width, height), from symmetry plane to symmetry plane.
_HALVES: tuple[tuple[tuple[tuple[float, float, float], ...], ...], ...] = (
    (  # upper handle
        ((-1.6, 0.0, 2.025), (-1.6, 0.3, 2.025), (-1.5, 0.3, 2.25), (-1.5, 0.0, 2.25)),
        ((-2.3, 0.0, 2.025), (-2.3, 0.3, 2.025), (-2.5, 0.3, 2.25), (-2.5, 0.0, 2.25)),
        ((-2.7, 0.0, 2.025), (-2.7, 0.3, 2.025), (-3.0, 0.3, 2.25), (-3.0, 0.0, 2.25)),
        ((-2.7, 0.0, 1.8), (-2.7, 0.3, 1.8), (-3.0, 0.3, 1.8), (-3.0, 0.0, 1.8)),
    ),
    (  # lower handle
        ((-2.7, 0.0, 1.8), (-2.7, 0.3, 1.8), (-3.0, 0.3, 1.8), (-3.0, 0.0, 1.8)),
        ((-2.7, 0.0, 1.575), (-2.7, 0.3, 1.575), (-3.0, 0.3, 1.35), (-3.0, 0.0, 1.35)),
        ((-2.5, 0.0, 1.125), (-2.5, 0.3, 1.125), (-2.65, 0.3, 0.9375), (-2.65, 0.0, 0.9375)),
        ((-2.0, 0.0, 0.9), (-2.0, 0.3, 0.9), (-1.9, 0.3, 0.6), (-1.9, 0.0, 0.6)),
    ),
    (  # lower spout
        ((1.7, 0.0, 1.425), (1.7, 0.66, 1.425), (1.7, 0.66, 0.6), (1.7, 0.0, 0.6)),
        ((2.6, 0.0, 1.425), (2.6, 0.66, 1.425), (3.1, 0.66, 0.825), (3.1, 0.0, 0.825)),
        ((2.3, 0.0, 2.1), (2.3, 0.25, 2.1), (2.4, 0.25, 2.025), (2.4, 0.0, 2.025)),
        ((2.7, 0.0, 2.4), (2.7, 0.25, 2.4), (3.3, 0.25, 2.4), (3.3, 0.0, 2.4)),
    ),
    (  # upper spout
        ((2.7, 0.0, 2.4), (2.7, 0.25, 2.4), (3.3, 0.25, 2.4), (3.3, 0.0, 2.4)),
        ((2.8, 0.0, 2.475), (2.8, 0.25, 2.475), (3.525, 0.25, 2.49375), (3.525, 0.0, 2.49375)),
        ((2.9, 0.0, 2.475), (2.9, 0.15, 2.475), (3.45, 0.15, 2.5125), (3.45, 0.0, 2.5125)),
        ((2.8, 0.0, 2.4), (2.8, 0.15, 2.4), (3.2, 0.15, 2.4), (3.2, 0.0, 2.4)),
    ),
)


def patches() -> Floats:
    """Control points of the 32 bicubic Bézier patches: float64 [32, 4, 4, 3], y up, normals outward."""
    result: list[Floats] = []
    for profile in _PROFILES:
        patch = np.array([_quarter_turn(radius, height) for radius, height in profile])
        result.extend(_rotated(patch, quadrant) for quadrant in range(4))
    for half in _HALVES:
        patch = np.array([[[x, height, width] for x, width, height in row] for row in half])
        result.append(patch)
        result.append((patch * (1.0, 1.0, -1.0))[:, ::-1])
    return np.stack(result)


def _quarter_turn(radius: float, height: float) -> list[tuple[float, float, float]]:
    """Four control points of the quarter circle from +x to +z."""
    flat = radius * _ROUNDED.get(radius, _QUARTER)
    return [(radius, height, 0.0), (radius, height, flat), (flat, height, radius), (0.0, height, radius)]


def _rotated(patch: Floats, quarters: int) -> Floats:
    """Rotate a patch about y by exact quarter turns, so that adjacent patches share their edges bit for bit."""
    for _ in range(quarters):
        patch = np.stack([-patch[..., 2], patch[..., 1], patch[..., 0]], axis=-1)
    return patch


def tessellate(level: int) -> tuple[Floats, npt.NDArray[np.int32]]:
    """Tessellate each patch into level × level cells of two triangles, without the degenerate ones at the poles.

    Returns:
        Vertices float64 [n, 3], not merged between patches, and faces int32 [32·2·level² − 8·level, 3].
    """
    t = np.arange(level + 1) / level
    basis = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3], axis=1)
    control = patches()
    # Sum in a fixed order: on a shared edge all other terms are exactly 0, so adjacent patches agree bit for bit
    rows = np.zeros((len(control), level + 1, 4, 3))
    grid = np.zeros((len(control), level + 1, level + 1, 3))
    for i in range(4):
        rows += basis[:, i, None, None] * control[:, None, i]
    for j in range(4):
        grid += basis[:, j, None] * rows[:, :, None, j]
    for row in (0, -1):
        pole = (control[:, row] == control[:, row, :1]).all(axis=(1, 2))
        grid[pole, row] = control[pole, row, :1]
    vertices = grid.reshape(-1, 3) + 0.0

    side = level + 1
    corner = (np.arange(level)[:, None] * side + np.arange(level)).reshape(-1)
    cells = np.stack([corner, corner + 1, corner + side + 1, corner, corner + side + 1, corner + side], axis=1)
    faces = (cells.reshape(1, -1, 3) + (np.arange(len(control)) * side * side)[:, None, None]).reshape(-1, 3)
    corners = vertices[faces]
    collapsed = np.zeros(len(faces), dtype=bool)
    for one, other in ((0, 1), (1, 2), (2, 0)):
        collapsed |= (corners[:, one] == corners[:, other]).all(axis=1)
    return vertices, faces[~collapsed].astype(np.int32)
