"""Cameras in the world: placed, framing the object, or a room's."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.scene.model import Camera, Vector
from colonnade.scene.object_pose import Pose

if TYPE_CHECKING:
    from colonnade.environment.model import Environment
    from colonnade.mesh.mesh import Extent


#: A framed object is at most this part of the picture's width.
WIDEST = 0.9


@dataclass(frozen=True)
class WorldCamera:
    """A pinhole camera in the world; the ray of pixel (x, y) runs along ``corner + x * step_x + y * step_y``.

    Attributes:
        position, corner, step_x, step_y: float64 [3].
        axes: float64 [3, 3], rows: right, up and towards the viewer, unit.
    """

    position: Floats
    corner: Floats
    step_x: Floats
    step_y: Floats
    axes: Floats


def scene_camera(camera: Camera, pose: Pose, extent: Extent, width: int, height: int) -> WorldCamera:
    """The camera that a scene places or frames."""
    centre, edge = pose.to_world(extent.centre), extent.edge * pose.scale
    slope = math.tan(math.radians(camera.fov) / 2)
    if camera.position is not None:
        position = np.array(camera.position)
        target = centre if camera.target is None else np.array(camera.target)
        if not (target - position).any():
            raise UserError("the camera's position is its target: move one of them")
        right, up, toward = camera_axes(position - target, camera.up)
    else:
        right, up, toward = camera_axes(np.array(camera.direction), camera.up)
        outline = pose.to_world(extent.outline) - centre
        across, along = camera.framing * 2 * slope, WIDEST * 2 * slope * width / height
        aside, above, distance = _frame(outline @ right, outline @ up, outline @ toward, along, across, edge)
        position = centre + aside * right + above * up + distance * toward
    pixel = 2 * slope / height
    corner = -toward + (0.5 - width / 2) * pixel * right + (height / 2 - 0.5) * pixel * up
    return WorldCamera(position, corner, pixel * right, -pixel * up, np.stack([right, up, toward]))


def environment_camera(environment: Environment, width: int, height: int) -> WorldCamera:
    """The camera that saw the room, for a frame of any size in the maps' proportions."""
    if abs(width * environment.height - height * environment.width) >= max(environment.width, environment.height):
        raise UserError(
            f"a frame of {width}x{height} pixels is not in the proportions of room {environment.name},"
            f" {environment.width}x{environment.height}: give a size that is"
        )
    axes, position = environment.camera_to_world[:, :3], environment.camera_to_world[:, 3]
    right, down, forward = axes.T
    across, along = environment.width / width, environment.height / height
    step_x, step_y = across / environment.fx * right, along / environment.fy * down
    corner = (
        forward
        + (0.5 * across - environment.cx) / environment.fx * right
        + (0.5 * along - environment.cy) / environment.fy * down
    )
    return WorldCamera(position, corner, step_x, step_y, np.stack([right, -down, -forward]))


def camera_axes(toward: Floats, up: Vector) -> tuple[Floats, Floats, Floats]:
    """Unit vectors right, up and towards the viewer; where ``up`` is along the view another axis takes its place."""
    back = toward / np.linalg.norm(toward)
    for candidate in (up, (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)):
        right = np.cross(candidate, back)
        length = float(np.linalg.norm(right))
        if length > 1e-9 * float(np.linalg.norm(candidate)):
            break
    right = right / length
    return right, np.cross(back, right), back


def _frame(x: Floats, y: Floats, z: Floats, width: float, height: float, edge: float) -> tuple[float, float, float]:
    """Where the camera stands, from the cube's centre: right, up and back.

    The outline's points are [k] right, up and towards the camera; ``width`` and ``height`` are what they may span at a
    distance of 1. The spans shrink with the distance, so halving an interval finds where they just fit; the outline is
    in the middle of the picture.
    """
    near = float(z.max()) + 1e-3 * edge
    far = near + 1e4 * edge
    for _ in range(64):
        depth = (near + far) / 2 - z
        spans = [np.ptp((across - _middle(across, depth)) / depth) for across in (x, y)]
        near, far = (near, (near + far) / 2) if spans[0] <= width and spans[1] <= height else ((near + far) / 2, far)
    return _middle(x, far - z), _middle(y, far - z), far


def _middle(across: Floats, depth: Floats) -> float:
    """The camera's shift for which (across − shift) / depth is as far to either side: the outline is in the middle."""
    low, high = float(across.min()), float(across.max())
    for _ in range(52):
        shift = (low + high) / 2
        seen = (across - shift) / depth
        low, high = (shift, high) if seen.max() + seen.min() > 0 else (low, shift)
    return (low + high) / 2
