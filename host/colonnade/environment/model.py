"""What is known of a room: maps of its albedo, normals and depth, and the camera that saw them.

View space is x right, y down, z forward, in metres. The centre of pixel (x, y) lies at (x + 0.5, y + 0.5).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class EnvironmentCamera:
    """A pinhole camera.

    Attributes:
        fx, fy: Focal lengths in pixels.
        cx, cy: Principal point in pixels; the map's centre for a camera that was not cropped.
        to_world: float64 [3, 4], view space to the world; the world's y is up, its floor at 0.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    to_world: NDArray[np.float64]

    def directions(self, width: int, height: int) -> NDArray[np.float64]:
        """Through the centre of every pixel, view space, z = 1: float64 [height, width, 3]."""
        x = (np.arange(width) + 0.5 - self.cx) / self.fx
        y = (np.arange(height) + 0.5 - self.cy) / self.fy
        rays = np.ones((height, width, 3))
        rays[..., 0] = x
        rays[..., 1] = y[:, np.newaxis]
        return rays


@dataclass(frozen=True)
class Environment:
    """Maps of one size and the camera that they belong to.

    Attributes:
        name: For messages and pictures.
        albedo: float64 [height, width, 3], linear, 0.0 to 1.0.
        normals: float64 [height, width, 3], unit, view space, towards the camera.
        depth: float64 [height, width], metres along z; an estimate unless `has_depth`.
        has_depth: Whether the room came with a depth map.
        camera: What saw them.
        photo: uint8 [height, width, 3], sRGB, or None.
        notes: What was assumed or mended, one line each.
    """

    name: str
    albedo: NDArray[np.float64]
    normals: NDArray[np.float64]
    depth: NDArray[np.float64]
    has_depth: bool
    camera: EnvironmentCamera
    photo: NDArray[np.uint8] | None
    notes: tuple[str, ...] = ()

    @property
    def width(self) -> int:
        """Pixels in a row of the maps."""
        return int(self.albedo.shape[1])

    @property
    def height(self) -> int:
        """Rows of the maps."""
        return int(self.albedo.shape[0])

    @property
    def fx(self) -> float:
        """Focal length across, pixels."""
        return self.camera.fx

    @property
    def fy(self) -> float:
        """Focal length down, pixels."""
        return self.camera.fy

    @property
    def cx(self) -> float:
        """Principal point across, pixels."""
        return self.camera.cx

    @property
    def cy(self) -> float:
        """Principal point down, pixels."""
        return self.camera.cy

    @property
    def camera_to_world(self) -> NDArray[np.float64]:
        """float64 [3, 4], view space to the world."""
        return self.camera.to_world

    def points(self) -> NDArray[np.float64]:
        """What each pixel sees, view space, metres: float64 [height, width, 3]."""
        points: NDArray[np.float64] = self.camera.directions(self.width, self.height) * self.depth[..., np.newaxis]
        return points
