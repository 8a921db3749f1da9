"""World-space cameras: at a given position, framing the object, a room's camera, or one that moves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors
from colonnade.scene.model import Camera, Scene
from colonnade.scene.object_pose import Placed, Pose
from colonnade.scene.samples import Point

if TYPE_CHECKING:
    from colonnade.environment.model import Environment, EnvironmentCamera
    from colonnade.mesh.materials.mesh import Extent


#: Largest fraction of the picture's width that a framed object covers.
MAX_WIDTH = 0.9
#: Vertical field of view without a room, degrees.
FIELD_OF_VIEW = 40.0


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


def start_camera(placed: Placed, width: int, height: int) -> WorldCamera:
    """The camera at the start of a scene's motion, for an object with the pose of the start.

    Raises:
        UserError: The camera's position equals its target, or the frame does not have the proportions of the room.
    """
    scene, room = placed.scene, placed.room
    camera = scene.camera
    if room is None:
        return scene_camera(camera, placed.start, placed.extent, width, height)
    if scene.frame_camera is not None or camera.position is None:
        return environment_camera(room, width, height, scene.frame_camera)
    target = placed.start.to_world(placed.extent.centre) if camera.target is None else np.array(camera.target)
    return _looking(camera, np.array(camera.position), target, _lens(camera, width, height, room))


def moved_camera(placed: Placed, start: WorldCamera, width: int, height: int) -> WorldCamera:
    """The camera at a scene's progress.

    Args:
        placed: The scene, whose motion may move the camera. Without a target the start's lies at the depth of the
            middle of the object.
        start: The camera of the start.
        width: Width of the frame, pixels.
        height: Height of the frame, pixels.

    Raises:
        UserError: The camera's position equals its target.
    """
    scene, environment = placed.scene, placed.room
    keys, progress = scene.motion.camera, scene.motion_progress
    if not keys or (progress == 0.0 and keys[0].at > 0.0):
        return start
    camera, forward = scene.camera, -start.axes[2]
    centre = placed.start.to_world(placed.extent.centre)
    target = start.position + max(float((centre - start.position) @ forward), 1e-3) * forward
    if camera.target is not None:
        target = np.array(camera.target)
    if environment is not None and camera.position is None:
        x, y, z = (float(value) for value in start.axes[1])  # the room's camera may be tilted
        camera = replace(camera, up=(x, y, z))
    before, place = 0.0, start.position
    for key in keys:
        then = target if key.target is None else np.array(key.target)
        if progress <= key.at:
            part = 1.0 if key.at == before else (progress - before) / (key.at - before)
            place = (1.0 - part) * place + part * np.array(key.position)
            target = (1.0 - part) * target + part * then
            break
        before, place, target = key.at, np.array(key.position), then
    return _looking(camera, place, target, _lens(camera, width, height, environment))


def scene_camera(camera: Camera, pose: Pose, extent: Extent, width: int, height: int) -> WorldCamera:
    """The camera of a scene without a room, for a frame of ``width`` by ``height`` pixels.

    Raises:
        UserError: The camera's position equals its target.
    """
    centre, edge = pose.to_world(extent.centre), extent.edge * pose.scale
    lens = _lens(camera, width, height, None)
    if camera.position is not None:
        target = centre if camera.target is None else np.array(camera.target)
        return _looking(camera, np.array(camera.position), target, lens)
    right, up, toward = camera_axes(np.array(camera.direction), camera.up)
    outline = pose.to_world(extent.outline) - centre
    slope = _slope(camera)
    max_height, max_width = camera.framing * 2 * slope, MAX_WIDTH * 2 * slope * width / height
    x, y, distance = _frame(outline @ right, outline @ up, outline @ toward, max_width, max_height, edge)
    return lens.at(centre + x * right + y * up + distance * toward, right, up, toward)


@dataclass(frozen=True)
class _Lens:
    """Where the middles of pixels lie at depth 1: of the first one, right and down; and the steps between them."""

    x: float
    y: float
    step_x: float
    step_y: float

    def at(self, position: Floats, right: Floats, up: Floats, toward: Floats) -> WorldCamera:
        corner = -toward + self.x * right - self.y * up
        return WorldCamera(position, corner, self.step_x * right, -self.step_y * up, np.stack([right, up, toward]))


def _slope(camera: Camera) -> float:
    return math.tan(math.radians(FIELD_OF_VIEW if camera.fov is None else camera.fov) / 2)


def _lens(camera: Camera, width: int, height: int, environment: Environment | None) -> _Lens:
    if environment is not None and camera.fov is None:
        _check_proportions(environment, width, height)
        scale_x, scale_y = environment.width / width, environment.height / height
        return _Lens(
            (0.5 * scale_x - environment.cx) / environment.fx,
            (0.5 * scale_y - environment.cy) / environment.fy,
            scale_x / environment.fx,
            scale_y / environment.fy,
        )
    pixel = 2 * _slope(camera) / height
    return _Lens((0.5 - width / 2) * pixel, (0.5 - height / 2) * pixel, pixel, pixel)


def _looking(camera: Camera, position: Floats, target: Floats, lens: _Lens) -> WorldCamera:
    if not (target - position).any():
        raise UserError("the camera's position is its target: move one of them")
    return lens.at(position, *camera_axes(position - target, camera.up))


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


def environment_camera(
    environment: Environment, width: int, height: int, camera: EnvironmentCamera | None = None
) -> WorldCamera:
    """The camera of a room's maps, or another one for pictures of their size, for a frame with their aspect ratio.

    Raises:
        UserError: The frame has another aspect ratio.
    """
    _check_proportions(environment, width, height)
    camera = camera or environment.camera
    right, down, forward, position = camera.to_world.T
    scale_x, scale_y = environment.width / width, environment.height / height
    step_x, step_y = scale_x / camera.fx * right, scale_y / camera.fy * down
    corner = forward + (0.5 * scale_x - camera.cx) / camera.fx * right + (0.5 * scale_y - camera.cy) / camera.fy * down
    return WorldCamera(position, corner, step_x, step_y, np.stack([right, -down, -forward]))


def check_camera(scene: Scene, environment: Environment | None, size: tuple[int, int]) -> None:
    """Raise a `UserError` if frames of a size cannot have the lens of a scene's room."""
    if environment is not None and scene.camera.fov is None:
        _check_proportions(environment, *size)


def _check_proportions(environment: Environment, width: int, height: int) -> None:
    if abs(width * environment.height - height * environment.width) >= max(environment.width, environment.height):
        raise UserError(
            f"a frame of {width}x{height} pixels does not have the proportions of room {environment.name},"
            f" {environment.width}x{environment.height}: give another size"
        )


def camera_axes(toward: Floats, up: Sequence[float]) -> tuple[Floats, Floats, Floats]:
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
