"""World-space cameras: at a given position, framing the object, or a room's camera."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors
from colonnade.scene.model import Camera, Vector
from colonnade.scene.object_pose import Pose
from colonnade.scene.samples import Point

if TYPE_CHECKING:
    from colonnade.environment.model import Environment
    from colonnade.mesh.mesh import Extent


#: Largest fraction of the picture's width that a framed object covers.
MAX_WIDTH = 0.9


@dataclass(frozen=True)
class WorldCamera:
    """A pinhole camera in world space; pixel (x, y) has the ray direction ``corner + x * step_x + y * step_y``.

    Attributes:
        position, corner, step_x, step_y: float64 [3].
        axes: float64 [3, 3], unit rows: right, up and towards the viewer.
    """

    position: Floats
    corner: Floats
    step_x: Floats
    step_y: Floats
    axes: Floats


def scene_camera(camera: Camera, pose: Pose, extent: Extent, width: int, height: int) -> WorldCamera:
    """The camera of a scene without a room, for a frame of ``width`` by ``height`` pixels.

    Raises:
        UserError: The camera's position equals its target.
    """
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
        max_height, max_width = camera.framing * 2 * slope, MAX_WIDTH * 2 * slope * width / height
        x, y, distance = _frame(outline @ right, outline @ up, outline @ toward, max_width, max_height, edge)
        position = centre + x * right + y * up + distance * toward
    pixel = 2 * slope / height
    corner = -toward + (0.5 - width / 2) * pixel * right + (height / 2 - 0.5) * pixel * up
    return WorldCamera(position, corner, pixel * right, -pixel * up, np.stack([right, up, toward]))


def through_lens(world: WorldCamera, camera: Camera, centre: Floats, on_lens: Point) -> WorldCamera:
    """The camera at a point of its thin lens, with the same picture of the plane in focus.

    Args:
        world: The pinhole camera, whose directions have the depth 1.
        camera: The scene's camera, for aperture and focus.
        centre: Centre of the object's cube, world space.
        on_lens: Point of a disc of radius 1.
    """
    target = centre if camera.target is None else np.array(camera.target)
    focus = float((world.position - target) @ world.axes[2]) if camera.focus is None else camera.focus
    offset = camera.aperture / 2 * (on_lens[0] * world.axes[0] + on_lens[1] * world.axes[1])
    return replace(world, position=world.position + offset, corner=world.corner - offset / focus)


def environment_camera(environment: Environment, width: int, height: int) -> WorldCamera:
    """The camera of a room's maps, for a frame with the maps' aspect ratio.

    Raises:
        UserError: The frame has another aspect ratio.
    """
    if abs(width * environment.height - height * environment.width) >= max(environment.width, environment.height):
        raise UserError(
            f"a frame of {width}x{height} pixels does not have the proportions of room {environment.name},"
            f" {environment.width}x{environment.height}: give another size"
        )
    axes, position = environment.camera_to_world[:, :3], environment.camera_to_world[:, 3]
    right, down, forward = axes.T
    scale_x, scale_y = environment.width / width, environment.height / height
    step_x, step_y = scale_x / environment.fx * right, scale_y / environment.fy * down
    corner = (
        forward
        + (0.5 * scale_x - environment.cx) / environment.fx * right
        + (0.5 * scale_y - environment.cy) / environment.fy * down
    )
    return WorldCamera(position, corner, step_x, step_y, np.stack([right, -down, -forward]))


def camera_axes(toward: Floats, up: Vector) -> tuple[Floats, Floats, Floats]:
    """Unit vectors right, up and towards the viewer; another axis replaces an ``up`` parallel to the view."""
    back = unit_vectors(toward)
    for candidate in (up, (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)):
        right = np.cross(unit_vectors(np.array(candidate)), back)
        if float(np.linalg.norm(right)) > 1e-9:
            break
    right = unit_vectors(right)
    return right, np.cross(back, right), back


def _frame(x: Floats, y: Floats, z: Floats, width: float, height: float, edge: float) -> tuple[float, float, float]:
    """Find the camera position at which the outline fits the picture, centred.

    The spans decrease with the distance, so bisection finds the smallest distance.

    Args:
        x: float64 [k], the outline's points, right of the cube's centre.
        y: float64 [k], above the centre.
        z: float64 [k], from the centre towards the camera.
        width: Largest span at distance 1.
        height: Largest span at distance 1.
        edge: Edge of the object's cube.

    Returns:
        The camera's position from the cube's centre: right, up and towards the viewer.
    """
    near = float(z.max()) + 1e-3 * edge
    far = near + 1e4 * edge
    for _ in range(64):
        depth = (near + far) / 2 - z
        spans = [np.ptp((values - _middle(values, depth)) / depth) for values in (x, y)]
        near, far = (near, (near + far) / 2) if spans[0] <= width and spans[1] <= height else ((near + far) / 2, far)
    return _middle(x, far - z), _middle(y, far - z), far


def _middle(values: Floats, depth: Floats) -> float:
    """The shift at which (values − shift) / depth has equal extent on both sides, by bisection."""
    low, high = float(values.min()), float(values.max())
    for _ in range(52):
        shift = (low + high) / 2
        projected = (values - shift) / depth
        low, high = (shift, high) if projected.max() + projected.min() > 0 else (low, shift)
    return (low + high) / 2
