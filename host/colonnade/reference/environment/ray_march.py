"""Screen-space ray marching: hits of rays on a room that is reconstructed from one camera view.

`PlaneMarch` marches in float64 through a plane per pixel. `DepthMarch` takes these planes from the full maps: it is the
device's march without a memory limit.

With w = 1/z a ray is a straight line in (u, v, w): from (u0, v0, w0) along (Du, Dv, Dw), with
Du = fx·dx − dz·(u0 − cx), Dv = fy·dy − dz·(v0 − cy) and Dw = −dz·w0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats
from colonnade.reference.environment.surface import SurfaceHits

if TYPE_CHECKING:
    from colonnade.environment.model import Environment


#: Outcome of a ray: it hit a surface that the camera sees, hit the hidden extension of a surface behind another one,
#: left the view, or ran out of steps.
HIT, HIDDEN, LEFT_VIEW, LOST = range(4)


@dataclass(frozen=True)
class MarchHits:
    """Hits of rays on a reconstructed room.

    Attributes:
        u, v: Hit point projected to the picture, pixels with centres at halves; the last point of a ray without a hit,
            float64 [n].
        z: Depth, metres along the view, float64 [n].
        seen_u, seen_v: Pixel that shows the surface; for `HIDDEN` the last visible pixel of its plane, float64 [n].
        kind: `HIT`, `HIDDEN`, `LEFT_VIEW` or `LOST`, int64 [n].
        steps: March steps, int64 [n].
    """

    u: Floats
    v: Floats
    z: Floats
    seen_u: Floats
    seen_v: Floats
    kind: NDArray[np.int64]
    steps: NDArray[np.int64]


class RayMarch(Protocol):
    """A ray march through a reconstructed room. Rays are in view space, metres, float64 [n, 3] each."""

    def __call__(self, origins: Floats, directions: Floats) -> MarchHits:
        """Hits of the rays on the room."""


@dataclass(frozen=True)
class MarchedGeometry:
    """A ray march as the geometry of a `Backdrop`. Rays without a hit are outside."""

    environment: Environment
    march: RayMarch

    def intersect(self, origins: Floats, directions: Floats) -> SurfaceHits:
        """First hits of rays, float64 [n, 3] each."""
        hits = self.march(origins, directions)
        outside = (hits.kind != HIT) & (hits.kind != HIDDEN)
        return SurfaceHits(positions(self.environment, hits), hits.seen_u, hits.seen_v, outside)


def positions(environment: Environment, hits: MarchHits) -> Floats:
    """End points of rays, view space, metres, float64 [n, 3]."""
    x, y = (hits.u - environment.cx) / environment.fx, (hits.v - environment.cy) / environment.fy
    return np.stack([x, y, np.ones_like(hits.z)], axis=1) * hits.z[:, None]


class PlaneMarch:
    """A ray march through a map of planes. A step is at most a pixel, and at most a fiftieth of w."""

    #: A ray that passes behind the visible surface hits it if the surface continues there: the planes of both steps
    #: differ by less than this share of w.
    JUMP = 0.04
    #: Across a jump it hits only a surface that it entered by less than this share of w; else it passes behind it.
    DEEP = 0.01
    #: An origin behind the surface by less than this share of w lies on the surface.
    START = 0.005

    def __init__(self, environment: Environment, w: Floats, slopes: Floats, max_steps: int = 2048) -> None:
        """A room as a plane per pixel.

        Args:
            environment: The room, for its camera and size.
            w: Inverse depth of each pixel's plane at the pixel's centre, 1/metre, float64 [height, width].
            slopes: Change of w per pixel to the right and per pixel down, float64 [2, height, width].
            max_steps: Steps after which a ray is `LOST`.
        """
        self._environment, self._max_steps = environment, max_steps
        self._w, self._slopes = w, slopes

    def __call__(self, origins: Floats, directions: Floats) -> MarchHits:
        """Hits of the rays on the room."""
        environment, count = self._environment, len(origins)
        w0 = 1 / origins[:, 2]
        start = np.stack(
            [
                origins[:, 0] * w0 * environment.fx + environment.cx,
                origins[:, 1] * w0 * environment.fy + environment.cy,
                w0,
            ],
            axis=1,
        )
        slope = np.stack(
            [
                environment.fx * directions[:, 0] - directions[:, 2] * (start[:, 0] - environment.cx),
                environment.fy * directions[:, 1] - directions[:, 2] * (start[:, 1] - environment.cy),
                -directions[:, 2] * w0,
            ],
            axis=1,
        )
        rate = np.maximum(np.abs(slope[:, :2]).max(axis=1), 50 * np.abs(slope[:, 2]) / w0)
        step = slope / np.where(rate > 0, rate, 1.0)[:, None]
        kind, steps, end = np.full(count, LOST), np.zeros(count, dtype=np.int64), start.copy()
        seen = start[:, :2].copy()
        active = np.arange(count)
        height = self._height(end, end)
        previous_height = np.where(height > -self.START * end[:, 2], height.clip(min=1e-12), height)
        # For rays behind a surface: the last point in front of it, whose plane may continue hidden.
        last_visible = np.full((count, 3), np.nan)
        for number in range(1, self._max_steps + 1):
            point = start[active] + number * step[active]
            inside = (
                (point[:, 0] >= 0)
                & (point[:, 0] < environment.width)
                & (point[:, 1] >= 0)
                & (point[:, 1] < environment.height)
            )
            inside &= point[:, 2] > 0
            steps[active] = number
            kind[active[~inside]] = LEFT_VIEW
            end[active[~inside]] = point[~inside]
            active, point, previous_height = active[inside], point[inside], previous_height[inside]
            if len(active) == 0:
                break
            previous, height = point - step[active], self._height(point, point)
            passed = (previous_height > 0) & (height <= 0)
            # A large difference between the planes of both steps is the edge of a surface.
            one_surface = np.abs(self._height(point, previous) - height) < self.JUMP * point[:, 2]
            hit = passed & (one_surface | (height > -self.DEEP * point[:, 2]))
            back = np.where(hit & one_surface, height / np.where(hit, height - previous_height, 1.0), 0.0)
            last_visible[active[height > 0]] = np.nan
            last_visible[active[passed]] = previous[passed]
            behind = np.flatnonzero((height <= 0) & ~hit & ~np.isnan(last_visible[active, 0]))
            plane, hidden = last_visible[active[behind]], np.zeros(len(active), bool)
            hidden[behind] = (self._height(previous[behind], plane) > 0) & (self._height(point[behind], plane) <= 0)
            ends = hit | hidden
            end[active[ends]] = point[ends] - back[ends, None] * step[active[ends]]
            kind[active[hit]], kind[active[hidden]] = HIT, HIDDEN
            seen[active[hit]], seen[active[hidden]] = end[active[hit], :2], last_visible[active[hidden], :2]
            active, previous_height = active[~ends], height[~ends]
        end[active] = start[active] + self._max_steps * step[active]
        with np.errstate(divide="ignore"):
            return MarchHits(end[:, 0], end[:, 1], 1 / end[:, 2], seen[:, 0], seen[:, 1], kind, steps)

    def _height(self, points: Floats, pixels: Floats) -> Floats:
        """Height in w of points (u, v, w) over the planes of the pixels that contain ``pixels``, float64 [n]."""
        column = np.clip(pixels[:, 0].astype(np.intp), 0, self._environment.width - 1)
        row = np.clip(pixels[:, 1].astype(np.intp), 0, self._environment.height - 1)
        u_slope, v_slope = self._slopes[:, row, column]
        surface = self._w[row, column] + u_slope * (points[:, 0] - column - 0.5) + v_slope * (points[:, 1] - row - 0.5)
        return np.asarray(points[:, 2] - surface, dtype=np.float64)


class DepthMarch(PlaneMarch):
    """A ray march through the full maps: depth and normal of each pixel define its plane."""

    #: Upper limit of a plane's slope, as a share of w per pixel. Normals at outlines turn away from the camera.
    STEEP = 0.05

    def __init__(self, environment: Environment, max_steps: int = 2048) -> None:
        """A room by its depth and normal maps."""
        w = 1.0 / environment.depth
        towards = np.einsum("hwi,hwi->hw", environment.normals, environment.points())
        with np.errstate(divide="ignore", invalid="ignore"):
            slopes = (
                np.stack([environment.normals[..., 0] / environment.fx, environment.normals[..., 1] / environment.fy])
                / towards
            )
        super().__init__(environment, w, np.nan_to_num(slopes).clip(-self.STEEP * w, self.STEEP * w), max_steps)
