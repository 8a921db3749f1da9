"""Normals of a depth map (host/cpp/environment/depth_normals.hpp): planes of windows, and large planes of all of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats
from colonnade.environment.model import EnvironmentCamera

#: Most large planes.
MAX_PLANES = 128


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


def normals_of_depth(
    depth: Floats, holes: NDArray[np.bool_], camera: EnvironmentCamera, max_planes: int = MAX_PLANES
) -> DepthNormals:
    """Fit normals to depth.

    Args:
        depth: Metres along z, filled, float64 [height, width].
        holes: Pixels whose depth was filled from a neighbour, bool [height, width].
        camera: The camera of the map.
        max_planes: Most large planes.
    """
    from colonnade import _core

    noise = depth_noise(depth, holes)
    lens = (camera.fx, camera.fy, camera.cx, camera.cy)
    normals, planes, on_planes = _core.depth_normals(depth, holes, lens, noise, max_planes)
    return DepthNormals(normals, noise, planes, on_planes)


def depth_noise(depth: Floats, holes: NDArray[np.bool_]) -> float:
    """Root mean square error of the depth on flat surfaces, as a share of the depth; see `normals_of_depth`."""
    from colonnade import _core

    return float(_core.depth_noise(depth, holes))
