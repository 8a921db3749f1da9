"""A room rebuilt from what its camera saw: which background point does a ray meet?

A `Rebuild` answers for rays in view space. `PlaneMarch` answers from a plane for each pixel, step by step, in 64 bits;
`DepthMarch` has the planes of the full maps: what the device's march would be with all the memory in the world.

With w = 1/z a ray stays straight in (u, v, w): from (u0, v0, w0) along (Du, Dv, Dw) with Du = fx·dx − dz·(u0 − cx),
Dv alike and Dw = −dz·w0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats
from colonnade.reference.environment.surface import Meetings

if TYPE_CHECKING:
    from colonnade.environment.model import Environment


#: What became of a ray: it met a surface that the camera sees, the extension of one behind another, left the view, or
#: was given up.
HIT, HIDDEN, LEFT, LOST = range(4)


@dataclass(frozen=True)
class Rebuilt:
    """Where rays meet a rebuilt room.

    Attributes:
        u, v: float64 [n], where the point lies in the picture, pixels, centres at halves; where the ray ended unless
            `HIT` or `HIDDEN`.
        z: float64 [n], metres along the view.
        seen_u, seen_v: float64 [n], the pixel that shows the surface: for `HIDDEN` the last visible one of its plane.
        kind: int64 [n], `HIT`, `HIDDEN`, `LEFT` or `LOST`.
        steps: int64 [n], of the march.
    """

    u: Floats
    v: Floats
    z: Floats
    seen_u: Floats
    seen_v: Floats
    kind: NDArray[np.int64]
    steps: NDArray[np.int64]


class Rebuild(Protocol):
    """A way to rebuild a room. Rays are float64 [n, 3] each, view space, metres."""

    def __call__(self, origins: Floats, directions: Floats) -> Rebuilt:
        """Where the rays meet the room."""


def from_march(march: Callable[[Floats, Floats], Mapping[str, Any]]) -> Rebuild:
    """A rebuild out of a function that returns `Rebuilt`'s arrays by name; `seen_u` and `seen_v` may be missing."""

    def rebuild(origins: Floats, directions: Floats) -> Rebuilt:
        arrays = march(np.ascontiguousarray(origins), np.ascontiguousarray(directions))
        u, v, z = (np.asarray(arrays[name], dtype=np.float64) for name in "uvz")
        seen_u, seen_v = (np.asarray(arrays.get(f"seen_{name}", arrays[name]), dtype=np.float64) for name in "uv")
        kind, steps = (np.asarray(arrays[name], dtype=np.int64) for name in ("kind", "steps"))
        return Rebuilt(u, v, z, seen_u, seen_v, kind, steps)

    return rebuild


@dataclass(frozen=True)
class RebuiltGeometry:
    """A rebuild as the geometry of a `Backdrop`; what it does not meet is outside."""

    environment: Environment
    rebuild: Rebuild

    def meet(self, origins: Floats, directions: Floats) -> Meetings:
        """Where rays, float64 [n, 3] each, meet it."""
        met = self.rebuild(origins, directions)
        return Meetings(
            positions(self.environment, met), met.seen_u, met.seen_v, (met.kind != HIT) & (met.kind != HIDDEN)
        )


def positions(environment: Environment, met: Rebuilt) -> Floats:
    """Where rays have ended, view space, float64 [n, 3]."""
    across, along = (met.u - environment.cx) / environment.fx, (met.v - environment.cy) / environment.fy
    return np.stack([across, along, np.ones_like(met.z)], axis=1) * met.z[:, None]


class PlaneMarch:
    """A march of at most a pixel or a fiftieth of w a step through a map of planes."""

    #: A surface is met when the ray passes behind it and it goes on there: the planes before and after differ by less
    #: than this share of w. Otherwise the ray has gone behind something, or into it if it is no deeper than `DEEP`.
    JUMP = 0.04
    DEEP = 0.01
    #: A start so little behind the surface is on it.
    START = 0.005

    def __init__(self, environment: Environment, w: Floats, slopes: Floats, max_steps: int = 2048) -> None:
        """A room by its planes.

        Args:
            room: Its camera and size.
            w: 1/metre, of each pixel's plane at the pixel's centre, float64 [height, width].
            slopes: How w changes a pixel to the right and a pixel down, float64 [2, height, width].
            most_steps: Then a ray is lost.
        """
        self._environment, self._most = environment, max_steps
        self._w, self._slopes = w, slopes

    def __call__(self, origins: Floats, directions: Floats) -> Rebuilt:
        """Where the rays meet the room."""
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
        pace = np.maximum(np.abs(slope[:, :2]).max(axis=1), 50 * np.abs(slope[:, 2]) / w0)
        step = slope / np.where(pace > 0, pace, 1.0)[:, None]
        kind, steps, place = np.full(count, LOST), np.zeros(count, dtype=np.int64), start.copy()
        seen = start[:, :2].copy()
        alive = np.arange(count)
        height = self._above(place, place)
        before = np.where(height > -self.START * place[:, 2], height.clip(min=1e-12), height)
        # Of rays behind something: the place where they last were in front, whose plane goes on unseen.
        last = np.full((count, 3), np.nan)
        for number in range(1, self._most + 1):
            here = start[alive] + number * step[alive]
            inside = (
                (here[:, 0] >= 0)
                & (here[:, 0] < environment.width)
                & (here[:, 1] >= 0)
                & (here[:, 1] < environment.height)
            )
            inside &= here[:, 2] > 0
            steps[alive] = number
            kind[alive[~inside]] = LEFT
            place[alive[~inside]] = here[~inside]
            alive, here, before = alive[inside], here[inside], before[inside]
            if len(alive) == 0:
                break
            there, now = here - step[alive], self._above(here, here)
            passed = (before > 0) & (now <= 0)
            # Where the plane of the step before would be here: far from this one's, something begins or ends.
            one_surface = np.abs(self._above(here, there) - now) < self.JUMP * here[:, 2]
            met = passed & (one_surface | (now > -self.DEEP * here[:, 2]))
            back = np.where(met & one_surface, now / np.where(met, now - before, 1.0), 0.0)
            last[alive[now > 0]] = np.nan
            last[alive[passed]] = there[passed]
            behind, hidden = np.flatnonzero((now <= 0) & ~met & ~np.isnan(last[alive, 0])), np.zeros(len(alive), bool)
            plane = last[alive[behind]]
            hidden[behind] = (self._above(there[behind], plane) > 0) & (self._above(here[behind], plane) <= 0)
            ends = met | hidden
            place[alive[ends]] = here[ends] - back[ends, None] * step[alive[ends]]
            kind[alive[met]], kind[alive[hidden]] = HIT, HIDDEN
            seen[alive[met]], seen[alive[hidden]] = place[alive[met], :2], last[alive[hidden], :2]
            alive, before = alive[~ends], now[~ends]
        place[alive] = start[alive] + self._most * step[alive]
        with np.errstate(divide="ignore"):
            return Rebuilt(place[:, 0], place[:, 1], 1 / place[:, 2], seen[:, 0], seen[:, 1], kind, steps)

    def _above(self, place: Floats, of: Floats) -> Floats:
        """How far in w places (u, v, w) lie in front of the plane that is seen at places ``of``, float64 [n]."""
        column = np.clip(of[:, 0].astype(np.intp), 0, self._environment.width - 1)
        row = np.clip(of[:, 1].astype(np.intp), 0, self._environment.height - 1)
        across, along = self._slopes[:, row, column]
        surface = self._w[row, column] + across * (place[:, 0] - column - 0.5) + along * (place[:, 1] - row - 0.5)
        return np.asarray(place[:, 2] - surface, dtype=np.float64)


class DepthMarch(PlaneMarch):
    """A march through the full maps: depth and normal of each pixel are a plane of its own."""

    #: No plane is steeper than this share of w a pixel: at outlines normals turn away from the camera.
    STEEP = 0.05

    def __init__(self, environment: Environment, max_steps: int = 2048) -> None:
        """A room by its depth and normals."""
        w = 1.0 / environment.depth
        towards = np.einsum("hwi,hwi->hw", environment.normals, environment.points())
        with np.errstate(divide="ignore", invalid="ignore"):
            slopes = (
                np.stack([environment.normals[..., 0] / environment.fx, environment.normals[..., 1] / environment.fy])
                / towards
            )
        super().__init__(environment, w, np.nan_to_num(slopes).clip(-self.STEEP * w, self.STEEP * w), max_steps)
