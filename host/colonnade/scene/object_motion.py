"""The motion of one of several objects, as what places its clip."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from colonnade.common import fixed_order
from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors
from colonnade.mesh.clips.joined import Place
from colonnade.mesh.clips.tracks import Track
from colonnade.scene.model import Vector
from colonnade.scene.object_pose import Pose

#: Degrees between two keys of a turn, which define its arcs.
_STEP = 15.0
_AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def still_place(pose: Pose) -> Place:
    """The place of an object that keeps its pose."""
    return Place.of([_matrix(pose.rotation * pose.scale, pose.translate)])


def moving_place(
    pose: Pose, centre: Floats, stages: Sequence[tuple[float, tuple[float, ...]]], vertical: Vector, seconds: float
) -> Place:
    """The place of an object that turns about its centre, and moves with it.

    Args:
        pose: Where it starts.
        centre: The centre of its mesh, in mesh space, float64 [3].
        stages: Its motion (`SceneObject.stages`).
        vertical: The axis of its turn.
        seconds: Duration of the motion.
    """
    at, states = _dense(stages)
    turns = np.array([_turned(state[:4], vertical) for state in states])
    middle = pose.to_world(centre)
    ways = middle + states[:, 4:]
    # The first node is the object's middle, with the axes of the world; the second one holds the mesh
    linear = pose.rotation * pose.scale
    matrices = [_matrix(np.eye(3), middle), _matrix(linear, -fixed_order.product(linear, centre))]
    times = at * seconds
    tracks = (
        Track(0, "translation", times, ways, "LINEAR"),
        Track(0, "rotation", times, turns, "LINEAR"),
    )
    return Place.of(matrices, tracks)


def _dense(stages: Sequence[tuple[float, tuple[float, ...]]]) -> tuple[Floats, Floats]:
    """Progress [k] and states [k, 7] of the stages, and of so many in between that turns are small."""
    found = [stages[0]]
    for (first, start), (last, end) in pairwise(stages):
        angle = max(abs(b - a) for a, b in zip(start[:4], end[:4], strict=True))
        steps = max(1, math.ceil(angle / _STEP))
        for step in range(1, steps + 1):
            part = step / steps
            state = tuple((1 - part) * a + part * b for a, b in zip(start, end, strict=True))
            found.append(((1 - part) * first + part * last, state))
    return np.array([at for at, _ in found]), np.array([state for _, state in found])


def _turned(degrees: Floats, vertical: Vector) -> Floats:
    """The quaternion x, y, z, w of a turn about the vertical, after rotations about x, then y, then z."""
    turn, *angles = degrees
    found = np.array([0.0, 0.0, 0.0, 1.0])
    for axis, angle in zip((*_AXES, vertical), (*angles, turn), strict=True):
        half = np.radians(angle) / 2
        found = _after(np.append(fixed_order.sin(half) * unit_vectors(np.array(axis)), fixed_order.cos(half)), found)
    return found


def _after(second: Floats, first: Floats) -> Floats:
    """The quaternion of two rotations, one after the other."""
    a, b, u, v = second[3], first[3], second[:3], first[:3]
    return np.append(a * v + b * u + np.cross(u, v), a * b - fixed_order.dot(u, v))


def _matrix(linear: Floats, shift: Floats) -> Floats:
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = linear, shift
    return result
