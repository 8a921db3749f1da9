"""Normals of a depth map.

A plane is linear in inverse depth: w = m · (x, y, 1) at the view ray (x, y, 1), and its normal is -m / \\|m\\|. Planes
are fitted twice:

1. In windows around each pixel, as large as the noise of the depth map asks for. Of nine windows that hold the pixel
   the one that is flattest counts, so a window does not reach across an edge.
2. To the whole map: planes that many windows agree with, the largest first. They have far less noise than a window.

A pixel takes the normal of the large plane that it lies on, else that of its window.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.common import fixed_order
from colonnade.common.types import Floats
from colonnade.environment.model import EnvironmentCamera

#: Radius of the windows that measure the noise, and the least and largest radius of those that give normals, pixels.
_NOISE_RADIUS = 14
_RADII = (2, 11)
#: Share of the windows that is flat; their largest residual is the noise. A residual of rounding alone counts as this.
_FLAT_SHARE = 0.3
_LEAST_NOISE = 1e-4
#: Slope error of a window that is accepted, radians, and distance over which a sensor's noise is correlated, pixels.
_SLOPE_ERROR = 0.06
_CORRELATION = 2.5
#: Pixels that vote for large planes, about; a quarter of them are tried as their centres.
_VOTERS = 4800
#: Most large planes, and votes of the smallest one.
_PLANES, _LEAST_VOTES = 128, 20
#: A pixel lies on a plane if its depth differs by this many times the noise, or by this share of the depth, and its
#: window's normal by this angle, as a cosine.
_DEVIATIONS, _LEAST_TOLERANCE = 3.0, 0.002
_AGREES = 0.85


@dataclass(frozen=True)
class DepthNormals:
    """Normals of a depth map.

    Attributes:
        normals: Unit, view space, towards the camera, float64 [height, width, 3].
        noise: Root mean square error of the depth on flat surfaces, as a share of the depth.
        planes: Number of large planes.
        on_planes: Share of the pixels that lie on one.
    """

    normals: Floats
    noise: float
    planes: int
    on_planes: float


def normals_of_depth(depth: Floats, holes: NDArray[np.bool_], camera: EnvironmentCamera) -> DepthNormals:
    """Fit normals to depth.

    Args:
        depth: Metres along z, filled, float64 [height, width].
        holes: Pixels whose depth was filled from a neighbour, bool [height, width].
        camera: The camera of the map.
    """
    rays = camera.directions(depth.shape[1], depth.shape[0])
    noise = max(_noise(depth, holes), _LEAST_NOISE)
    size = np.sqrt(noise * camera.fx * np.sqrt(12.0) * _CORRELATION / _SLOPE_ERROR)
    radius = int(np.clip(round(size / 2), *_RADII))
    windows = _Windows(1.0 / depth, holes, radius)
    local, is_seen = _planes_of(windows, camera, rays)
    planes = _large_planes(depth, rays, local, is_seen, noise)
    on_plane = np.full(depth.shape, -1)
    window = _box(np.ones(depth.shape), radius // 2)
    best = np.full(depth.shape, 0.5)
    for number, plane in enumerate(planes):
        share = _box(_agrees(plane, depth, rays, local, noise).astype(np.float64), radius // 2) / window
        better = share > best
        on_plane[better], best[better] = number, share[better]
    chosen = np.where((on_plane >= 0)[..., np.newaxis], np.array([*planes, np.ones(3)])[on_plane], local)
    unknown = ~is_seen & (on_plane < 0)
    if unknown.any() and not unknown.all():
        from scipy import ndimage

        nearest = ndimage.distance_transform_edt(unknown, return_distances=False, return_indices=True)
        chosen = chosen[tuple(nearest)]
    normals = -chosen / np.sqrt(fixed_order.dot(chosen, chosen))[..., np.newaxis]
    # A plane seen from behind its own ray, at a hole or an edge, faces the camera
    away = fixed_order.dot(normals, rays) >= 0
    normals[away] = -rays[away] / np.sqrt(fixed_order.dot(rays[away], rays[away]))[..., np.newaxis]
    return DepthNormals(normals, noise, len(planes), float((on_plane >= 0).mean()))


def depth_noise(depth: Floats, holes: NDArray[np.bool_]) -> float:
    """Root mean square error of the depth on flat surfaces, as a share of the depth; see `normals_of_depth`."""
    return max(_noise(depth, holes), _LEAST_NOISE)


def _noise(depth: Floats, holes: NDArray[np.bool_]) -> float:
    windows = _Windows(1.0 / depth, holes, _NOISE_RADIUS)
    whole = windows.holes == 0
    if not whole.any():
        return 0.0
    residuals = np.sort((np.sqrt(windows.residual) / windows.value)[whole])
    return float(residuals[int(_FLAT_SHARE * (residuals.size - 1))])


class _Windows:
    """Planes fitted to inverse depth in each square window that lies in the map.

    Attributes:
        radius: Of the windows.
        value, across, down: Inverse depth at the centre, and its slopes for a pixel, float64 [rows, columns].
        residual: Mean squared residual.
        holes: Share of holes.
    """

    def __init__(self, inverse: Floats, holes: NDArray[np.bool_], radius: int) -> None:
        radius = min(radius, (min(inverse.shape) - 1) // 2)
        height, width = inverse.shape
        inner = np.s_[radius : height - radius, radius : width - radius]
        count = float((2 * radius + 1) ** 2)
        spread = count * radius * (radius + 1) / 3.0  # of one coordinate
        v, u = np.mgrid[:height, :width] - np.array([height / 2, width / 2])[:, np.newaxis, np.newaxis]
        total = _box(inverse, radius)
        self.radius = radius
        self.value = (total / count)[inner]
        self.across = ((_box(inverse * u, radius) - u * total) / spread)[inner] if radius else np.zeros_like(self.value)
        self.down = ((_box(inverse * v, radius) - v * total) / spread)[inner] if radius else np.zeros_like(self.value)
        squares = _box(inverse * inverse, radius)[inner] / count - self.value * self.value
        self.residual = (squares - (self.across**2 + self.down**2) * spread / count).clip(min=0.0)
        self.holes = _box(holes.astype(np.float64), radius)[inner] / count


def _planes_of(windows: _Windows, camera: EnvironmentCamera, rays: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """The plane of each pixel's flattest window, float64 [height, width, 3], and whether it holds enough depth."""
    height, width = rays.shape[:2]
    radius, (rows, columns) = windows.radius, windows.value.shape
    v, u = np.mgrid[:height, :width]
    best = np.full((height, width), np.inf)
    planes, is_seen = np.zeros((height, width, 3)), np.zeros((height, width), bool)
    for dv in (0, -radius, radius):
        for du in (0, -radius, radius):
            row, column = (v + dv - radius).clip(0, rows - 1), (u + du - radius).clip(0, columns - 1)
            holes = windows.holes[row, column]
            # A window around the pixel is preferred: it has the same noise and no preferred side
            cost = windows.residual[row, column] * (1.0 if du == dv == 0 else 1.5) + holes
            better = cost < best
            best[better] = cost[better]
            row, column = row[better], column[better]
            a, b = windows.across[row, column] * camera.fx, windows.down[row, column] * camera.fy
            centre = rays[row + radius, column + radius]
            planes[better] = np.stack([a, b, windows.value[row, column] - a * centre[:, 0] - b * centre[:, 1]], axis=1)
            is_seen[better] = holes[better] < 0.5
    return planes, is_seen


def _large_planes(depth: Floats, rays: Floats, local: Floats, is_seen: NDArray[np.bool_], noise: float) -> list[Floats]:
    """Planes that many windows agree with, the largest first, float64 [3] each."""
    step = max(1, round(float(np.sqrt(depth.size / _VOTERS))))
    trial, vote = np.s_[step :: 2 * step, step :: 2 * step], np.s_[step // 2 :: step, step // 2 :: step]
    trials = local[trial][is_seen[trial]]
    seen = is_seen[vote]
    voters = (depth[vote][seen], rays[vote][seen], local[vote][seen])
    if not (len(trials) and seen.any()):
        return []
    agree = np.stack([_agrees(plane, *voters, noise) for plane in trials])
    is_free = np.ones(agree.shape[1], bool)
    planes: list[Floats] = []
    while len(planes) < _PLANES:
        votes = (agree & is_free).sum(axis=1)
        first = int(votes.argmax())
        if votes[first] < _LEAST_VOTES:
            break
        plane, found = trials[first], agree[first] & is_free
        for _ in range(3):
            plane = _fitted(voters[0][found], voters[1][found])
            found = _agrees(plane, *voters, noise) & is_free
            if found.sum() < _LEAST_VOTES:
                break
        is_free &= ~(found | agree[first])
        if found.sum() >= _LEAST_VOTES:
            planes.append(plane)
    return planes


def _fitted(depth: Floats, rays: Floats) -> Floats:
    """The plane with the least squared relative error of depth, float64 [3]."""
    points = rays * depth[:, np.newaxis]
    matrix = np.array([[(points[:, i] * points[:, j]).sum() for j in range(3)] for i in range(3)])
    # The second term is of depth in kilometres, whose rounding would make the matrix singular
    least = max(1e-9 * depth.size, 1e-12 * float(matrix.trace()))
    return fixed_order.solve(matrix + np.eye(3) * least, points.sum(axis=0))


def _agrees(plane: Floats, depth: Floats, rays: Floats, local: Floats, noise: float) -> NDArray[np.bool_]:
    """Whether pixels lie on a plane: by their depth, and by the normals of their windows."""
    tolerance = max(_DEVIATIONS * noise, _LEAST_TOLERANCE)
    near = np.abs(fixed_order.dot(rays, plane) * depth - 1.0) < tolerance
    cosine = fixed_order.dot(local, plane)
    lengths = np.sqrt(fixed_order.dot(local, local) * fixed_order.dot(plane, plane))
    return np.asarray(near & (cosine > _AGREES * lengths))


def _box(values: Floats, radius: int) -> Floats:
    """Sums over square windows that are cut at the border."""
    for axis in (0, 1):
        sums = np.insert(np.cumsum(values, axis=axis), 0, 0.0, axis=axis)
        size = values.shape[axis]
        last = (np.arange(size) + radius + 1).clip(max=size)
        first = (np.arange(size) - radius).clip(min=0)
        values = np.take(sums, last, axis=axis) - np.take(sums, first, axis=axis)
    return values
