"""The object's pose: transforms between mesh space, world space and a room's view space."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.scene.model import Placement, Scene, Transform, Vector, interpolate

if TYPE_CHECKING:
    from colonnade.environment.model import Environment
    from colonnade.mesh.mesh import Extent


#: Default row where an object stands in a room, as a fraction of the height.
_DEFAULT_ROW = 0.7


@dataclass(frozen=True)
class Pose:
    """World = rotation · scale · mesh + translate.

    Attributes:
        rotation: float64 [3, 3], for column vectors.
        scale: World units per mesh unit.
        translate: float64 [3].
    """

    rotation: Floats
    scale: float
    translate: Floats

    def to_world(self, points: Floats) -> Floats:
        """Transform points [..., 3] from mesh space to world space."""
        return np.asarray(points @ self.rotation.T * self.scale + self.translate, dtype=np.float64)

    def to_mesh(self, point: Floats) -> Floats:
        """Transform points [..., 3] from world space to mesh space."""
        return np.asarray((point - self.translate) / self.scale @ self.rotation, dtype=np.float64)

    def from_view(self, camera_to_world: Floats) -> Floats:
        """Transform from a camera's view space to mesh space, float64 [3, 4]."""
        linear = self.rotation.T @ camera_to_world[:, :3] / self.scale
        return np.column_stack([linear, self.to_mesh(camera_to_world[:, 3])])


def object_pose(scene: Scene, extent: Extent, environment: Environment | None) -> Pose:
    """The pose of the scene's mesh at its motion's progress: by its transform, or standing in a room.

    Raises:
        UserError: A pixel is outside the room's maps, or the motion does not match the kind of pose.
    """
    placement, motion, progress = scene.placement, scene.motion, scene.motion_progress
    if placement is None and environment is not None and scene.transform == Transform():
        placement = Placement()
    rotation = rotation_matrix(scene.transform)
    if environment is None or placement is None:
        if motion.stand_at is not None:
            raise UserError("motion.stand_at is for an object that stands in a room: give motion.translate")
        start, scale = scene.transform.translate, scene.transform.scale
        moved = start if motion.translate is None else interpolate(start, motion.translate, progress)
        turned = (
            rotation_about((0.0, 1.0, 0.0) if environment is not None else scene.camera.up, motion.turn * progress)
            @ rotation
        )
        return Pose(turned, scale, np.array(moved) + scale * (rotation - turned) @ extent.centre)
    if motion.translate is not None:
        raise UserError("motion.translate is for an object that does not stand in a room: give motion.stand_at")
    turned = rotation_matrix(Transform(rotate=(0.0, placement.turn + motion.turn * progress, 0.0))) @ rotation
    outline = extent.outline @ turned.T
    foot = extent.centre @ turned.T
    foot[1] = outline[:, 1].min()
    scale = placement.size / extent.edge
    point = standing_point(placement, environment)
    if motion.stand_at is not None:
        point = (1.0 - progress) * point + progress * _surface_point(motion.stand_at, environment, "motion.stand_at")
    return Pose(turned, scale, point - foot * scale)


def standing_point(placement: Placement, environment: Environment) -> Floats:
    """The room's surface point under the object, world space, float64 [3]."""
    return _surface_point(
        placement.stand_at or (environment.width / 2, environment.height * _DEFAULT_ROW), environment, "object.stand_at"
    )


def _surface_point(pixel: tuple[float, float], environment: Environment, key: str) -> Floats:
    u, v = pixel
    if u >= environment.width or v >= environment.height:
        raise UserError(
            f"{key} is ({u:g}, {v:g}), outside the maps of room {environment.name}:"
            f" they are {environment.width}x{environment.height} pixels"
        )
    depth = environment.depth[int(v), int(u)]
    seen = np.array([(u - environment.cx) / environment.fx, (v - environment.cy) / environment.fy, 1.0]) * depth
    return np.asarray(environment.camera_to_world[:, :3] @ seen + environment.camera_to_world[:, 3], dtype=np.float64)


def rotation_about(axis: Vector, degrees: float) -> Floats:
    """Rotation about an axis through the origin by Rodrigues' formula, float64 [3, 3] for column vectors."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    angle, cross_product = math.radians(degrees), np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(
        np.eye(3) + math.sin(angle) * cross_product + (1 - math.cos(angle)) * cross_product @ cross_product
    )


def rotation_matrix(transform: Transform) -> Floats:
    """Rotation about x, then y, then z: float64 [3, 3] for column vectors."""
    x, y, z = np.radians(transform.rotate)
    about_x = [[1, 0, 0], [0, math.cos(x), -math.sin(x)], [0, math.sin(x), math.cos(x)]]
    about_y = [[math.cos(y), 0, math.sin(y)], [0, 1, 0], [-math.sin(y), 0, math.cos(y)]]
    about_z = [[math.cos(z), -math.sin(z), 0], [math.sin(z), math.cos(z), 0], [0, 0, 1]]
    return np.asarray(np.array(about_z) @ np.array(about_y) @ np.array(about_x), dtype=np.float64)
