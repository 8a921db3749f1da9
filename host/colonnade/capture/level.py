"""Levels the world of a capture: y up, the floor at 0.

The floor is the largest low plane: one that many surface points lie on, whose normal points up, and that few points lie
below. Where the vertical is known, only its height is found.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from colonnade.capture.source import Frame
from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors
from colonnade.environment.depth_normals import normals_of_depth
from colonnade.environment.model import EnvironmentCamera
from colonnade.environment.repair import holes_of

#: Points of each frame, and hypotheses for the floor.
_POINTS, _HYPOTHESES = 3000, 600
#: Cosines of the largest angle between the floor's normal and an uncertain, and a known vertical, and within a plane.
_UNCERTAIN, _KNOWN, _PARALLEL = 0.5, 0.97, 0.985
#: Thickness of a plane as a share of the distance, and at least, metres.
_THICKNESS, _LEAST_THICKNESS = 0.01, 0.02
#: A low plane has this share of the points more than so many metres below it, at most; and at least this share on it.
_BELOW, _DEPTH_BELOW = 0.03, 0.15
_LEAST_SHARE = 0.02
#: Without a plane the floor is below this share of the points.
_LOWEST = 0.01


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


def level(frames: Iterable[Frame], up: Floats | None, where: str) -> Levelling:
    """Find the floor.

    Args:
        frames: Some frames of the capture; one at a time is in memory.
        up: The vertical of its world; None: unknown.
        where: The capture, for messages.

    Raises:
        UserError: The vertical is unknown, and there is no floor.
    """
    surfaces = list(map(_surface, frames))
    points, normals, distances = (np.concatenate([surface[part] for surface in surfaces]) for part in range(3))
    thickness = np.maximum(_THICKNESS * distances, _LEAST_THICKNESS)
    towards = unit_vectors(up if up is not None else np.mean([surface[3] for surface in surfaces], axis=0))
    level_points = np.flatnonzero(normals @ towards > (_UNCERTAIN if up is None else _KNOWN))
    best: tuple[int, Floats, float] | None = None
    for index in level_points[:: max(1, len(level_points) // _HYPOTHESES)]:
        normal = normals[index] if up is None else towards
        heights = points @ normal
        on = (np.abs(heights - heights[index]) < thickness) & (normals @ normal > _PARALLEL)
        count = int(on.sum())
        is_low = (heights < heights[index] - _DEPTH_BELOW).mean() <= _BELOW
        if is_low and count >= _LEAST_SHARE * len(points) and (best is None or count > best[0]):
            best = count, normal, float(np.median(heights[on]))
    if best is None:
        if up is None:
            raise UserError(f"{where} shows no floor, so its vertical is unknown: give what points up with --up X,Y,Z")
        height = float(np.quantile(points @ towards, _LOWEST))
        note = "no floor was found: the lowest point that was seen is at height 0"
        return Levelling(_rotation_to_y(towards), -height, note)
    count, normal, height = best
    if up is None:
        for _ in range(3):
            on = (np.abs(points @ normal - height) < thickness) & (normals @ normal > _PARALLEL)
            centre = points[on].mean(axis=0)
            _, axes = np.linalg.eigh((points[on] - centre).T @ (points[on] - centre))
            normal = axes[:, 0] * np.sign(axes[:, 0] @ normal)
            height = float(centre @ normal)
        angle = float(np.degrees(np.arccos(np.clip(normal[1], -1.0, 1.0))))
        what = f"the vertical and the floor are those of the largest low plane, {angle:.1f}° from the capture's y"
    else:
        what = "the floor is the largest low level plane"
    return Levelling(_rotation_to_y(normal), -height, f"{what}; {count / len(points):.0%} of the surface lie on it")


def _surface(frame: Frame) -> tuple[Floats, Floats, Floats, Floats]:
    """What a frame shows, in the capture's world.

    Returns:
        Points and normals, float64 [n, 3], their distances from the camera, float64 [n], and up in its picture, [3].
    """
    upwards = -frame.to_world[:, 1]
    rows, columns = frame.depth.shape
    step = max(1, round(float(np.sqrt(frame.depth.size / (256 * 192)))))
    depth = frame.depth[::step, ::step]
    holes = holes_of(depth)
    if holes.all():
        return np.empty((0, 3)), np.empty((0, 3)), np.empty(0), upwards
    across, down = columns / frame.photo.shape[1] / step, rows / frame.photo.shape[0] / step
    lens = frame.lens
    camera = EnvironmentCamera(lens.fx * across, lens.fy * down, lens.cx * across, lens.cy * down, np.eye(3, 4))
    filled = np.where(holes, float(np.median(depth[~holes])), depth)
    normals = normals_of_depth(filled, holes, camera).normals[~holes]
    points = (camera.directions(depth.shape[1], depth.shape[0]) * depth[..., np.newaxis])[~holes]
    chosen = np.s_[:: max(1, len(points) // _POINTS)]
    rotation = frame.to_world[:, :3].T
    points = points[chosen]
    world = points @ rotation + frame.to_world[:, 3]
    return world, normals[chosen] @ rotation, np.linalg.norm(points, axis=1), upwards


def _rotation_to_y(up: Floats) -> Floats:
    """The least rotation of a unit vector to y."""
    x, y, z = up
    if y < -0.999999:
        return np.diag([1.0, -1.0, -1.0])
    factor = 1.0 / (1.0 + y)
    return np.array([[1 - x * x * factor, -x, -x * z * factor], [x, y, z], [-x * z * factor, -z, 1 - z * z * factor]])
