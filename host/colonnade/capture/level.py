"""Levels the world of a capture: y up, the floor at 0.

The floor is the largest low plane: one that many surface points lie on, whose normal points up, and that few points lie
below. Without it the vertical is the largest level plane's, such as a table's, and without one the walls'.
Cameras tell less: their pictures are nearly free of roll, but look down by any angle. Where the vertical is known, only
the height of the floor is found.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.capture.source import Frame
from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors
from colonnade.environment.depth_normals import normals_of_depth
from colonnade.environment.model import EnvironmentCamera
from colonnade.environment.repair import holes_of

#: Points of each frame, and hypotheses for a plane.
_POINTS, _HYPOTHESES = 3000, 600
#: Cosines of the largest angle between the floor's normal and an uncertain, and a known vertical, and within a plane.
_UNCERTAIN, _KNOWN, _PARALLEL = 0.5, 0.97, 0.985
#: Thickness of a plane as a share of the distance, and at least, metres.
_THICKNESS, _LEAST_THICKNESS = 0.01, 0.02
#: A low plane has this share of the points more than so many metres below it, at most; a plane at least this one on it.
_BELOW, _DEPTH_BELOW = 0.03, 0.15
_LEAST_SHARE = 0.02
#: Without a plane the floor is below this share of the points.
_LOWEST = 0.01
#: Of cameras whose recording shows a level plane: tangent of the largest roll, sines of how far they look up, and down.
_ROLL, _UPWARDS, _DOWNWARDS = 0.36, 0.26, 0.94
#: Length of the mean of the cameras' up vectors from which on they have a common one.
_COMMON_UP = 0.25
#: Weights of the cameras' roll against the normals of walls, and of their mean up against their roll.
_ROLL_WEIGHT, _UP_WEIGHT = 0.02, 0.05
#: Sines of the largest angle between a wall and the vertical, in each step of the search.
_UPRIGHT = (0.77, 0.5, 0.34, 0.17, 0.17, 0.17)


@dataclass(frozen=True)
class Levelling:
    """How a world becomes level.

    Attributes:
        rotation: float64 [3, 3].
        shift: Of y, metres.
        note: What was assumed, one line.
    """

    rotation: Floats
    shift: float
    note: str

    def applied(self, to_world: Floats) -> Floats:
        """A pose in the level world, float64 [3, 4]."""
        turned = self.rotation @ to_world
        turned[1, 3] += self.shift
        return turned


@dataclass(frozen=True)
class _Surface:
    """What frames show, in the capture's world.

    Attributes:
        points, normals: float64 [n, 3].
        distances: From the camera, metres, float64 [n].
        cameras: The axes of each camera are its columns, right, down and forward, float64 [frames, 3, 3].
    """

    points: Floats
    normals: Floats
    distances: Floats
    cameras: Floats


@dataclass(frozen=True)
class _Plane:
    """A plane with the unit normal ``normal`` at a height along it, and the share of all points that lie on it."""

    normal: Floats
    height: float
    share: float


def level(frames: Iterable[Frame], up: Floats | None, where: str) -> Levelling:
    """Find the vertical and the floor.

    Args:
        frames: Some frames of the capture; one at a time is in memory.
        up: The vertical of its world; None: unknown.
        where: The capture, for messages.

    Raises:
        UserError: The vertical is unknown, there is no floor, and the cameras have no common up.
    """
    surfaces = list(map(_surface, frames))
    seen = _Surface(*(np.concatenate([getattr(one, part) for one in surfaces]) for part in _Surface.__annotations__))
    source = ""
    if up is None:
        overhead = -seen.cameras[:, :, 1].mean(axis=0)
        floor = _largest_plane(seen, seen.normals @ overhead > _UNCERTAIN * np.linalg.norm(overhead), is_low=True)
        if floor is not None:
            what = f"the vertical and the floor come from the largest low plane, {_from_y(floor.normal)}"
            return Levelling(_rotation_to_y(floor.normal), -floor.height, f"{what}; {_on(floor)}")
        if not np.linalg.norm(overhead) > _COMMON_UP:
            raise UserError(
                f"{where} shows no floor, and no direction is up in the pictures of all its frames: give what points up"
                " with --up X,Y,Z"
            )
        up, source = _without_floor(seen, overhead)
        source = f"the vertical is that of {source}, {_from_y(up)}: --up X,Y,Z gives another; "
    up = unit_vectors(up)
    floor = _largest_plane(seen, seen.normals @ up > _KNOWN, is_low=True, normal=up)
    if floor is not None:
        note = f"the floor is the largest low level plane; {_on(floor)}"
        return Levelling(_rotation_to_y(up), -floor.height, source + note)
    height = float(np.quantile(seen.points @ up, _LOWEST)) if len(seen.points) else 0.0
    note = "no floor was found: the lowest point that was seen is at height 0"
    return Levelling(_rotation_to_y(up), -height, source + note)


def _from_y(up: Floats) -> str:
    return f"{np.degrees(np.arccos(np.clip(up[1], -1.0, 1.0))):.1f}° from the capture's y"


def _on(plane: _Plane) -> str:
    return f"{plane.share:.0%} of the surface lie on it"


def _without_floor(seen: _Surface, overhead: Floats) -> tuple[Floats, str]:
    """The vertical of the largest level plane that cameras without much roll see from above, or the walls'.

    A wall in front of a camera that looks down has a normal that points down in the picture. One that a camera looks
    up at is as a level plane far below it, and one at its side as that of a camera with much roll, so none is taken
    for a level plane.

    Args:
        seen: What the frames show.
        overhead: Mean of the cameras' up vectors, float64 [3].

    Returns:
        A unit vector, and what it is from.
    """
    plane = _largest_plane(seen, _are_level(seen.normals, seen.cameras), is_low=False)
    if plane is not None and _are_level(plane.normal[np.newaxis], seen.cameras).all():
        return plane.normal, f"the largest level plane, on which {plane.share:.0%} of the surface lie"
    rights = seen.cameras[:, :, 0]
    held = rights.T @ rights / len(rights) - _UP_WEIGHT * np.outer(overhead, overhead)
    up, share = _least(held, overhead), 0.0
    for sine in _UPRIGHT:
        walls = seen.normals[np.abs(seen.normals @ up) < sine]
        up = _least(walls.T @ walls / max(len(seen.normals), 1) + _ROLL_WEIGHT * held, overhead)
        share = len(walls) / max(len(seen.normals), 1)
    return up, f"cameras without roll, to which {share:.0%} of the surface are upright"


def _are_level(normals: Floats, cameras: Floats) -> NDArray[np.bool_]:
    """Whether cameras see surfaces as level ones from above: bool [n] for normals [n, 3] and axes [frames, 3, 3]."""
    right, down, forward = (normals @ cameras[:, :, axis].T for axis in range(3))
    pitch, upright = forward.mean(axis=1), np.square(down).mean(axis=1)
    is_pitched = (pitch > -_DOWNWARDS) & (pitch < _UPWARDS) & (down.mean(axis=1) < 0)
    return np.asarray(is_pitched & (np.square(right).mean(axis=1) < _ROLL**2 * upright))


def _least(form: Floats, towards: Floats) -> Floats:
    """The unit vector [3] on the side of another one with the least value of a quadratic form [3, 3]."""
    axis = np.linalg.eigh(form)[1][:, 0]
    return np.asarray(axis if axis @ towards >= 0 else -axis)


def _largest_plane(
    seen: _Surface, is_candidate: NDArray[np.bool_], is_low: bool, normal: Floats | None = None
) -> _Plane | None:
    """The plane of candidates with the most points; None if none has enough.

    Args:
        seen: What the frames show.
        is_candidate: Points whose normals are tried, bool [n].
        is_low: Few points may lie below it. Surfaces that are upright to it also count, so that the vertical
            is the walls'.
        normal: Its normal, if that is known.
    """
    points, normals = seen.points, seen.normals
    thickness = np.maximum(_THICKNESS * seen.distances, _LEAST_THICKNESS)
    candidates = np.flatnonzero(is_candidate)
    best: tuple[int, int] | None = None
    for index in candidates[:: max(1, len(candidates) // _HYPOTHESES)]:
        towards = normals[index] if normal is None else normal
        heights, cosines = points @ towards - points[index] @ towards, normals @ towards
        count = int(((np.abs(heights) < thickness) & (cosines > _PARALLEL)).sum())
        if count < _LEAST_SHARE * len(points) or (is_low and (heights < -_DEPTH_BELOW).mean() > _BELOW):
            continue
        if not is_low:
            count += int((np.abs(cosines) < _UPRIGHT[-1]).sum())
        if best is None or count > best[0]:
            best = count, index
    if best is None:
        return None
    towards = normals[best[1]] if normal is None else normal
    height = float(points[best[1]] @ towards)
    on = (np.abs(points @ towards - height) < thickness) & (normals @ towards > _PARALLEL)
    share, height = float(on.mean()), float(np.median(points[on] @ towards))
    for _ in range(0 if normal is not None else 3):
        on = (np.abs(points @ towards - height) < thickness) & (normals @ towards > _PARALLEL)
        centre = points[on].mean(axis=0)
        towards = _least((points[on] - centre).T @ (points[on] - centre), towards)
        height = float(centre @ towards)
    return _Plane(towards, height, share)


def _surface(frame: Frame) -> _Surface:
    """What a frame shows."""
    axes = frame.to_world[:, :3]
    rows, columns = frame.depth.shape
    step = max(1, round(float(np.sqrt(frame.depth.size / (256 * 192)))))
    depth = frame.depth[::step, ::step]
    holes = holes_of(depth)
    if holes.all():
        return _Surface(np.empty((0, 3)), np.empty((0, 3)), np.empty(0), axes[np.newaxis])
    across, down = columns / frame.photo.shape[1] / step, rows / frame.photo.shape[0] / step
    lens = frame.lens
    camera = EnvironmentCamera(lens.fx * across, lens.fy * down, lens.cx * across, lens.cy * down, np.eye(3, 4))
    filled = np.where(holes, float(np.median(depth[~holes])), depth)
    normals = normals_of_depth(filled, holes, camera).normals[~holes]
    points = (camera.directions(depth.shape[1], depth.shape[0]) * depth[..., np.newaxis])[~holes]
    chosen = np.s_[:: max(1, len(points) // _POINTS)]
    points = points[chosen]
    world = points @ axes.T + frame.to_world[:, 3]
    return _Surface(world, normals[chosen] @ axes.T, np.linalg.norm(points, axis=1), axes[np.newaxis])


def _rotation_to_y(up: Floats) -> Floats:
    """The least rotation of a unit vector to y."""
    x, y, z = up
    if y < -0.999999:
        return np.diag([1.0, -1.0, -1.0])
    factor = 1.0 / (1.0 + y)
    return np.array([[1 - x * x * factor, -x, -x * z * factor], [x, y, z], [-x * z * factor, -z, 1 - z * z * factor]])
