"""Background surfaces, in a room's view space: what the reference shades where rays miss the object.

A `Backdrop` combines any `Geometry` (depth mesh or reconstructed room) with any maps (full or decoded). So a study can
measure the loss of each separately.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors

if TYPE_CHECKING:
    from colonnade.environment.model import Environment


@dataclass(frozen=True)
class SurfaceHits:
    """Hits of rays on a room's geometry.

    Attributes:
        position: View space, metres, undefined where `outside`, float64 [n, 3].
        u, v: Position in the maps, pixels with centres at halves, float64 [n].
        outside: No map covers the hit, bool [n].
    """

    position: Floats
    u: Floats
    v: Floats
    outside: NDArray[np.bool_]


class Geometry(Protocol):
    """The geometry of a room in view space."""

    def intersect(self, origins: Floats, directions: Floats) -> SurfaceHits:
        """First hits of rays, float64 [n, 3] each."""


@dataclass(frozen=True)
class BackdropPoints:
    """Points on background surfaces.

    Attributes:
        position: View space, metres, float64 [n, 3].
        normals: Unit normals, view space, float64 [n, 3].
        albedo: Linear, float64 [n, 3].
        outside: No map covers the point, bool [n].
    """

    position: Floats
    normals: Floats
    albedo: Floats
    outside: NDArray[np.bool_]


class BoundingSurface(Protocol):
    """A surface around a room, for rays that leave the space that its maps cover."""

    def intersect(self, origins: Floats, directions: Floats) -> BackdropPoints:
        """Points where rays of view space, float64 [n, 3] each, hit the surface."""


@dataclass(frozen=True)
class Backdrop:
    """A room as background: geometry and maps.

    Attributes:
        environment: The room, for its camera and size.
        geometry: Intersects rays with the room.
        albedo, normals: The maps, as in `Environment`, float64 [height, width, 3].
        depth: Depth of directly visible pixels, metres, float64 [height, width]; None: the depth map of the room.
        bounding: Surface for rays that miss the geometry; None: they get the scene's background colour, and their
            pixels are marked as outside.
    """

    environment: Environment
    geometry: Geometry
    albedo: Floats
    normals: Floats
    depth: Floats | None = None
    bounding: BoundingSurface | None = None

    def visible_points(self, u: Floats, v: Floats) -> BackdropPoints:
        """Points that the camera sees at pixels (u, v) of the maps, float64 [n] each."""
        environment, (row, column) = self.environment, self._texels(u, v)
        x, y = (u - environment.cx) / environment.fx, (v - environment.cy) / environment.fy
        depth = environment.depth if self.depth is None else self.depth
        position = np.stack([x, y, np.ones(len(u))], axis=1) * depth[row, column, None]
        return self._of_texels(position, row, column, np.zeros(len(u), dtype=np.bool_))

    def seen_points(self, origins: Floats, directions: Floats) -> BackdropPoints:
        """Points of the maps that rays of another camera see, view space, float64 [n, 3] each; others are outside."""
        hits = self.geometry.intersect(origins, unit_vectors(directions))
        return self._of_texels(hits.position, *self._texels(hits.u, hits.v), hits.outside)

    def intersect(self, origins: Floats, directions: Floats) -> BackdropPoints:
        """Points where rays of view space, float64 [n, 3] each, hit the room."""
        hits = self.geometry.intersect(origins, directions)
        points = self._of_texels(hits.position, *self._texels(hits.u, hits.v), hits.outside)
        uncovered = np.flatnonzero(hits.outside)
        if self.bounding is None or len(uncovered) == 0:
            return points
        beyond = self.bounding.intersect(origins[uncovered], directions[uncovered])
        position, normals, albedo = points.position.copy(), points.normals.copy(), points.albedo.copy()
        position[uncovered], normals[uncovered], albedo[uncovered] = beyond.position, beyond.normals, beyond.albedo
        outside = points.outside.copy()
        outside[uncovered] = beyond.outside
        return BackdropPoints(position, normals, albedo, outside)

    def _texels(self, u: Floats, v: Floats) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Row and column of the nearest texel, intp [n] each."""
        column = np.clip(np.floor(np.nan_to_num(u)), 0, self.environment.width - 1).astype(np.intp)
        row = np.clip(np.floor(np.nan_to_num(v)), 0, self.environment.height - 1).astype(np.intp)
        return row, column

    def _of_texels(
        self, position: Floats, row: NDArray[np.intp], column: NDArray[np.intp], outside: NDArray[np.bool_]
    ) -> BackdropPoints:
        return BackdropPoints(position, unit_vectors(self.normals[row, column]), self.albedo[row, column], outside)
