"""What rays meet that miss the object, in a room's view space: surfaces to be lit, wherever they come from.

The reference takes any `Geometry` and any maps: the depth map's mesh or a rebuilt room, full maps or clustered ones. So
what each of them costs can be told apart.
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
class Meetings:
    """Where rays meet a room's geometry.

    Attributes:
        position: float64 [n, 3], view space, metres; anything where `outside`.
        u, v: float64 [n], pixels of the maps, centres at halves.
        outside: bool [n]: nothing is known of what the ray meets.
    """

    position: Floats
    u: Floats
    v: Floats
    outside: NDArray[np.bool_]


class Geometry(Protocol):
    """Something that rays of a room's view space meet."""

    def meet(self, origins: Floats, directions: Floats) -> Meetings:
        """Where rays, float64 [n, 3] each, meet it first."""


@dataclass(frozen=True)
class BackdropPoints:
    """Surfaces of the background.

    Attributes:
        position: float64 [n, 3], view space, metres.
        normals: float64 [n, 3], unit, view space.
        albedo: float64 [n, 3], linear.
        outside: bool [n]: nothing is known of what the ray meets.
    """

    position: Floats
    normals: Floats
    albedo: Floats
    outside: NDArray[np.bool_]


class Shell(Protocol):
    """What stands for the room where no map reaches: points that are not `outside`."""

    def meet(self, origins: Floats, directions: Floats) -> BackdropPoints:
        """Where rays of view space, float64 [n, 3] each, meet it."""


@dataclass(frozen=True)
class Backdrop:
    """A room that rays can meet.

    Attributes:
        room: Its camera and size.
        geometry: Where rays meet it.
        albedo, normals: Its maps, float64 [height, width, 3], as those of `Room`.
        depth: What it takes for the depth of pixels that are seen directly, metres, float64 [height, width]; None: the
            room's own.
        shell: Stands in where the geometry does not reach; None: such rays meet the scene's background colour, and
            their pixels are marked.
    """

    environment: Environment
    geometry: Geometry
    albedo: Floats
    normals: Floats
    depth: Floats | None = None
    shell: Shell | None = None

    def seen(self, u: Floats, v: Floats) -> BackdropPoints:
        """What the camera itself sees at pixels of the maps, float64 [n] each."""
        environment, (row, column) = self.environment, self._texels(u, v)
        across, along = (u - environment.cx) / environment.fx, (v - environment.cy) / environment.fy
        depth = environment.depth if self.depth is None else self.depth
        position = np.stack([across, along, np.ones(len(u))], axis=1) * depth[row, column, None]
        return self._of_texels(position, row, column, np.zeros(len(u), dtype=np.bool_))

    def meet(self, origins: Floats, directions: Floats) -> BackdropPoints:
        """What rays of view space, float64 [n, 3] each, meet."""
        met = self.geometry.meet(origins, directions)
        points = self._of_texels(met.position, *self._texels(met.u, met.v), met.outside)
        lost = np.flatnonzero(met.outside)
        if self.shell is None or len(lost) == 0:
            return points
        beyond = self.shell.meet(origins[lost], directions[lost])
        position, normals, albedo = points.position.copy(), points.normals.copy(), points.albedo.copy()
        position[lost], normals[lost], albedo[lost] = beyond.position, beyond.normals, beyond.albedo
        outside = points.outside.copy()
        outside[lost] = beyond.outside
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
