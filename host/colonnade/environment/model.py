"""The environment: maps of a room's albedo, normals and depth, and the camera of these maps.

View space is x right, y down, z forward, in metres. The centre of pixel (x, y) is at (x + 0.5, y + 0.5).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.common.notes import add


@dataclass(frozen=True)
class EnvironmentCamera:
    """A pinhole camera.

    Attributes:
        fx, fy: Focal lengths in pixels.
        cx, cy: Principal point in pixels; the map's centre unless the photo was cropped.
        to_world: float64 [3, 4], view space to world space; in world space y is up and the floor is at 0.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    to_world: NDArray[np.float64]

    def directions(self, width: int, height: int) -> NDArray[np.float64]:
        """View rays through the pixel centres, view space, with z = 1: float64 [height, width, 3]."""
        x = (np.arange(width) + 0.5 - self.cx) / self.fx
        y = (np.arange(height) + 0.5 - self.cy) / self.fy
        rays = np.ones((height, width, 3))
        rays[..., 0] = x
        rays[..., 1] = y[:, np.newaxis]
        return rays


@dataclass(frozen=True)
class Environment:
    """A room as maps of one size, and their camera.

    Attributes:
        name: Name for messages and files.
        albedo: float64 [height, width, 3], linear, 0.0 to 1.0.
        normals: float64 [height, width, 3], unit, view space, towards the camera.
        depth: float64 [height, width], metres along z; an estimate unless `has_depth`.
        has_depth: Whether the room came with a depth map.
        camera: The camera of the maps.
        photo: uint8 [height, width, 3], sRGB, or None.
        notes: Assumptions and repairs of the loader, one line each.
        has_albedo: Whether the room came with an albedo map; otherwise the albedo has the shadows of the photo.
    """

    name: str
    albedo: NDArray[np.float64]
    normals: NDArray[np.float64]
    depth: NDArray[np.float64]
    has_depth: bool
    camera: EnvironmentCamera
    photo: NDArray[np.uint8] | None
    notes: tuple[str, ...] = ()
    has_albedo: bool = True

    @property
    def width(self) -> int:
        """Width of the maps, pixels."""
        return int(self.albedo.shape[1])

    @property
    def height(self) -> int:
        """Height of the maps, pixels."""
        return int(self.albedo.shape[0])

    @property
    def fx(self) -> float:
        """Horizontal focal length, pixels."""
        return self.camera.fx

    @property
    def fy(self) -> float:
        """Vertical focal length, pixels."""
        return self.camera.fy

    @property
    def cx(self) -> float:
        """Horizontal principal point, pixels."""
        return self.camera.cx

    @property
    def cy(self) -> float:
        """Vertical principal point, pixels."""
        return self.camera.cy

    @property
    def camera_to_world(self) -> NDArray[np.float64]:
        """Transform from view space to world space, float64 [3, 4]."""
        return self.camera.to_world

    def points(self) -> NDArray[np.float64]:
        """Surface point of each pixel, view space, metres: float64 [height, width, 3]."""
        points: NDArray[np.float64] = self.camera.directions(self.width, self.height) * self.depth[..., np.newaxis]
        return points

    def tell(self, what: str, words: str) -> None:
        """Add words to the one line of notes on the room (`colonnade.common.notes.add`)."""
        add(f"room {self.name}", what, words)

    def tell_notes(self) -> None:
        """Add `notes` to that line."""
        for note in self.notes:
            self.tell(note, note)
