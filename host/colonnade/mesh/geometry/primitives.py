"""Generated solids within the cube from -1 to 1, counter-clockwise seen from outside.

They are our own code and not `trimesh.creation`'s for three reasons. The sphere takes a number of triangles, not only
powers of four. Coordinates on shared edges are bit-equal, so the mesh closes without tolerances. And the vertices stay
the same when a library changes, as tests and benchmarks compare exact counters.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from random import Random

import numpy as np
import numpy.typing as npt

from colonnade.common import fixed_order

Geometry = tuple[npt.NDArray[np.float64], npt.NDArray[np.int32]]


def sphere(size: int = 4) -> Geometry:
    """A geodesic unit sphere: each face of an icosahedron is split into f² triangles.

    Args:
        size: Up to 10, the subdivision level, f = 2^size. Above 10, the number of triangles, rounded to a
            near 20·f².
    """
    frequency = 2**size if size <= 10 else max(1, round(math.sqrt(size / 20)))
    golden = (1 + math.sqrt(5)) / 2
    corners = np.array(
        [
            [-1, golden, 0], [1, golden, 0], [-1, -golden, 0], [1, -golden, 0],
            [0, -1, golden], [0, 1, golden], [0, -1, -golden], [0, 1, -golden],
            [golden, 0, -1], [golden, 0, 1], [-golden, 0, -1], [-golden, 0, 1],
        ]
    )  # fmt: skip
    triangles = np.array(
        [
            [0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6],
            [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10],
            [8, 6, 7], [9, 8, 1],
        ]
    )  # fmt: skip
    # Row i of a triangle has i + 1 points; both triangles at an edge compute equal sums
    i = np.repeat(np.arange(frequency + 1), np.arange(1, frequency + 2))
    j = np.concatenate([np.arange(n) for n in range(1, frequency + 2)])
    a, b, c = (corners[triangles[:, k]][:, None, :] for k in range(3))
    points = (frequency - i)[:, None] * a + (i - j)[:, None] * b + j[:, None] * c
    vertices = (points / np.linalg.norm(points, axis=2, keepdims=True)).reshape(-1, 3)

    start = i * (i + 1) // 2 + j
    up = i < frequency
    down = up & (j > 0)
    below = start + i + 1
    upward = np.stack([start[up], below[up], below[up] + 1], axis=1)
    downward = np.stack([start[down], start[down] - 1, below[down]], axis=1)
    face_triangles = np.concatenate([upward, downward])
    faces = (face_triangles[None] + (np.arange(20) * len(i))[:, None, None]).reshape(-1, 3)
    return vertices, faces.astype(np.int32)


def rock(size: int = 100_000) -> Geometry:
    """A sphere of ``size`` triangles that is displaced along its radii: by waves of all scales, and by a hash of each
    vertex's position about half as long as an edge.
    """
    vertices, faces = sphere(size)
    height, random = np.zeros(len(vertices)), Random(1)
    for octave in range(8):
        x, y, z, phase = (4.0 * random.random() - 2.0 for _ in range(4))
        wave = fixed_order.sin(2.0**octave * (vertices[:, 0] * x + vertices[:, 1] * y + vertices[:, 2] * z) + phase)
        height += 0.2 * 0.6**octave * wave
    words = (vertices + 0.0).view(np.uint64) * np.array(
        [0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64
    )
    hashed = words[:, 0] ^ (words[:, 1] >> np.uint64(7)) ^ (words[:, 2] >> np.uint64(13))
    hashed = (hashed ^ (hashed >> np.uint64(32))) * np.uint64(0xD6E8FEB86659FD93)
    height += (hashed >> np.uint64(11)) * 2.0**-53 * 2.0 / math.sqrt(len(faces) / 20)
    radii = 1.0 + height
    return vertices * (radii / radii.max())[:, None], faces


def cube() -> Geometry:
    """The cube of edge 2: 12 triangles."""
    vertices = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return vertices, np.array([t for a, b, c, d in quads for t in ([a, b, c], [a, c, d])], dtype=np.int32)


def torus(size: int = 48) -> Geometry:
    """A torus about y, radii 0.7 and 0.3, of ``size`` segments around the axis and half as many around the tube."""
    across = max(3, size // 2)
    u = 2 * np.pi * np.arange(size) / size
    v = 2 * np.pi * np.arange(across) / across
    u, v = (angle.reshape(-1) for angle in np.meshgrid(u, v, indexing="ij"))
    radius = 0.7 + 0.3 * fixed_order.cos(v)
    vertices = np.stack([radius * fixed_order.cos(u), 0.3 * fixed_order.sin(v), radius * fixed_order.sin(u)], axis=1)
    i, j = (index.reshape(-1) for index in np.meshgrid(np.arange(size), np.arange(across), indexing="ij"))
    a, b = i * across + j, i * across + (j + 1) % across
    c, d = (i + 1) % size * across + (j + 1) % across, (i + 1) % size * across + j
    return vertices, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)


def cylinder(size: int = 64) -> Geometry:
    """A closed cylinder about y of ``size`` sides, radius 0.6, height 2."""
    return _turned([(0.6, -1.0), (0.6, 1.0)], size)


def cone(size: int = 64) -> Geometry:
    """A closed cone about y of ``size`` sides, radius 0.8, height 2."""
    return _turned([(0.8, -1.0), (0.0, 1.0)], size)


def _turned(profile: list[tuple[float, float]], size: int) -> Geometry:
    """A surface of revolution about y from two rings (radius, height), the lower first, closed by fans."""
    angle = 2 * np.pi * np.arange(size) / size
    cos, sin = fixed_order.cos(angle), fixed_order.sin(angle)
    rings = [np.stack([r * cos, np.full(size, h), r * sin], axis=1) for r, h in profile]
    centres = np.array([[0.0, h, 0.0] for _, h in profile])
    low = np.arange(size)
    low_next, high, high_next = np.roll(low, -1), low + size, np.roll(low, -1) + size
    faces = [
        np.stack([np.full(size, 2 * size), low, low_next], axis=1),
        np.stack([low, high_next, low_next], axis=1),
    ]
    if profile[1][0] > 0:
        faces.append(np.stack([low, high, high_next], axis=1))
        faces.append(np.stack([np.full(size, 2 * size + 1), high_next, high], axis=1))
    else:
        faces[1] = np.stack([low, np.full(size, 2 * size + 1), low_next], axis=1)
    return np.concatenate([*rings, centres]), np.concatenate(faces).astype(np.int32)


def tetrahedron() -> Geometry:
    """The tetrahedron on four corners of the cube: 4 triangles."""
    vertices = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    return vertices, np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]], dtype=np.int32)


def octahedron() -> Geometry:
    """The octahedron on the axes' unit points: 8 triangles."""
    vertices = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    faces = [[2, 4, 0], [2, 0, 5], [2, 5, 1], [2, 1, 4], [3, 0, 4], [3, 5, 0], [3, 1, 5], [3, 4, 1]]
    return vertices, np.array(faces, dtype=np.int32)


def triangle() -> Geometry:
    """One triangle in the plane z = 0, facing +z."""
    return np.array([[-1.0, -1, 0], [1, -1, 0], [0, 1, 0]]), np.array([[0, 1, 2]], dtype=np.int32)


def square() -> Geometry:
    """Two triangles in the plane z = 0, facing +z."""
    vertices = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    return vertices, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)


#: Solids with a size, ``name:SIZE``: function, default, smallest and largest size.
SIZED: dict[str, tuple[Callable[[int], Geometry], int, int, int]] = {
    "sphere": (sphere, 4, 0, 4_000_000),
    "rock": (rock, 100_000, 11, 4_000_000),
    "torus": (torus, 48, 3, 2000),
    "cylinder": (cylinder, 64, 3, 1_000_000),
    "cone": (cone, 64, 3, 1_000_000),
}
#: Solids without a size.
PLAIN: dict[str, Callable[[], Geometry]] = {
    "cube": cube,
    "tetrahedron": tetrahedron,
    "octahedron": octahedron,
    "triangle": triangle,
    "square": square,
}
