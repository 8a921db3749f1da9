"""Bounding planes: the planes around the room that rays leaving the view hit.

A plane bounds the room if nearly all of the room's points lie on the camera's side of it: floor, ceiling, walls. A
virtual wall behind the camera closes the room. A memory entry holds, low bit first, the plane (64 bits), then mean
albedo and normal (three fields each).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.common import fixed_order
from colonnade.environment.model import Environment
from colonnade.maps.layout import AttributeLayout
from colonnade.maps.plane_fit import refit_planes, sample_pixels
from colonnade.maps.planes import PlaneProjection, pack_planes, unpack_planes
from colonnade.maps.vectors import AlbedoSpace, NormalSpace

#: Distance of the virtual wall behind the camera, metres.
BEHIND = 0.5
#: Largest fraction of points beyond a bounding plane by more than the tolerance, metres.
_MAX_BEYOND = 0.03
_TOLERANCE = 0.05
#: Largest distance of a plane's inliers, metres, and the smallest fraction of inliers for an entry.
_INLIER_DISTANCE = 0.03
_MIN_INLIERS = 0.01
#: Normals with a larger cosine count as parallel: two such planes are one wall.
_SAME_DIRECTION = 0.94
_STEP = 2


@dataclass(frozen=True)
class BoundingPlanes:
    """Bounding planes and their colours.

    Attributes:
        planes: float64 [n, 3], coefficients A, B, C.
        albedos: float64 [n, 3], linear.
    """

    planes: NDArray[np.float64]
    albedos: NDArray[np.float64]


def choose_bounding_planes(
    environment: Environment, projection: PlaneProjection, planes: NDArray[np.float64], maximum: int
) -> BoundingPlanes:
    """Choose at most ``maximum`` planes: the virtual wall, then ``planes`` around the room, largest first."""
    samples = sample_pixels(environment, projection, _STEP)
    albedo = environment.albedo[::_STEP, ::_STEP].reshape(-1, 3)
    points = environment.points()[::_STEP, ::_STEP].reshape(-1, 3)
    normals = environment.normals[::_STEP, ::_STEP].reshape(-1, 3)
    wall = np.array([0.0, 0.0, -projection.depth_unit / BEHIND])
    chosen, colours = [wall], [albedo.mean(axis=0)]
    inliers = _inliers(samples.errors(planes), normals, projection.normals(planes))
    for k in np.argsort(-inliers.sum(axis=0), kind="stable"):
        if len(chosen) == maximum or inliers[:, k].mean() < _MIN_INLIERS:
            break
        on_plane = inliers[:, k]
        owner = np.where(on_plane, 0, 1).astype(np.intp)
        plane = refit_planes(samples, np.stack([planes[k], wall]), owner)[0]
        q = projection.dual_vectors(plane[np.newaxis])[0]
        beyond = (fixed_order.product(points, q) - 1.0) / np.sqrt(fixed_order.dot(q, q)) > _TOLERANCE
        if beyond.mean() > _MAX_BEYOND:
            continue
        directions = projection.normals(np.stack([*chosen[1:], plane]))
        if (fixed_order.product(directions[:-1], directions[-1]) > _SAME_DIRECTION).any():
            continue
        chosen.append(plane)
        colours.append(albedo[on_plane].mean(axis=0))
    return BoundingPlanes(np.stack(chosen), np.stack(colours))


def _inliers(
    errors: NDArray[np.float32], normals: NDArray[np.float64], directions: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Whether each sample is near each plane and has its normal: bool [samples, planes]."""
    is_parallel = fixed_order.product(normals, directions.T) > _SAME_DIRECTION
    inliers: NDArray[np.bool_] = (errors < _INLIER_DISTANCE) & is_parallel
    return inliers


def pack_bounding_planes(
    bounding: BoundingPlanes, projection: PlaneProjection, layout: AttributeLayout
) -> NDArray[np.uint64]:
    """Pack the entries into words, uint64 [bounding_planes, 3]: bits 63 to 0, 127 to 64, 143 to 128 of each entry."""
    planes = pack_planes(bounding.planes)
    albedos = AlbedoSpace(layout.field_bits).words(bounding.albedos)
    normals = NormalSpace(layout.field_bits).words(projection.normals(unpack_planes(planes)))
    words = np.zeros((layout.bounding_planes, 3), np.uint64)
    for k in range(len(planes)):
        entry = int(planes[k]) | (int(albedos[k]) | int(normals[k]) << layout.vector_bits) << 64
        words[k] = [entry >> (64 * part) & ((1 << 64) - 1) for part in range(3)]
    return words
