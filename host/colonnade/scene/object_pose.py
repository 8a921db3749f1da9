"""Where the object is: between mesh space, the world, and a room's view space."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.scene.model import Placement, Scene, Transform, Vector, between

if TYPE_CHECKING:
    from colonnade.environment.model import Environment
    from colonnade.mesh.mesh import Extent


#: Without a word in the scene the object stands in the middle of the picture, this far down.
_STANDS_DOWN = 0.7


@dataclass(frozen=True)
class Pose:
    """World = rotation · scale · mesh + translate.

    Attributes:
        rotation: float64 [3, 3], for column vectors.
        scale: World units a mesh unit.
        translate: float64 [3].
    """

    rotation: Floats
    scale: float
    translate: Floats

    def to_world(self, points: Floats) -> Floats:
        """Points [..., 3] of the mesh, in the world."""
        return np.asarray(points @ self.rotation.T * self.scale + self.translate, dtype=np.float64)

    def to_mesh(self, point: Floats) -> Floats:
        """Points [..., 3] of the world, in mesh space."""
        return np.asarray((point - self.translate) / self.scale @ self.rotation, dtype=np.float64)

    def from_view(self, camera_to_world: Floats) -> Floats:
        """From a camera's view space to mesh space, float64 [3, 4]."""
        turn = self.rotation.T @ camera_to_world[:, :3] / self.scale
        return np.column_stack([turn, self.to_mesh(camera_to_world[:, 3])])


def object_pose(scene: Scene, extent: Extent, environment: Environment | None) -> Pose:
    """Where the scene puts its mesh: by its transform, or on what the room's camera sees at a pixel; and where its
    motion has taken it from there.

    Raises:
        UserError: The place is outside the room's maps, or the motion is one of another kind of place.
    """
    placement, motion, share = scene.placement, scene.motion, scene.share
    if placement is None and environment is not None and scene.transform == Transform():
        placement = Placement()
    rotation = rotation_matrix(scene.transform)
    if environment is None or placement is None:
        if motion.stand_at is not None:
            raise UserError("motion.stand_at is for an object that stands in a room: give motion.translate")
        start, scale = scene.transform.translate, scene.transform.scale
        moved = start if motion.translate is None else between(start, motion.translate, share)
        turned = (
            turning((0.0, 1.0, 0.0) if environment is not None else scene.camera.up, motion.turn * share) @ rotation
        )
        return Pose(turned, scale, np.array(moved) + scale * (rotation - turned) @ extent.centre)
    if motion.translate is not None:
        raise UserError("motion.translate is for an object that does not stand in a room: give motion.stand_at")
    turned = rotation_matrix(Transform(rotate=(0.0, placement.turn + motion.turn * share, 0.0))) @ rotation
    outline = extent.outline @ turned.T
    foot = extent.centre @ turned.T
    foot[1] = outline[:, 1].min()
    scale = placement.size / extent.edge
    point = standing_point(placement, environment)
    if motion.stand_at is not None:
        point = (1.0 - share) * point + share * _seen_at(motion.stand_at, environment, "motion.stand_at")
    return Pose(turned, scale, point - foot * scale)


def standing_point(placement: Placement, environment: Environment) -> Floats:
    """What the room's camera sees where the object stands, world, float64 [3]."""
    return _seen_at(
        placement.stand_at or (environment.width / 2, environment.height * _STANDS_DOWN), environment, "object.stand_at"
    )


def _seen_at(pixel: tuple[float, float], environment: Environment, key: str) -> Floats:
    u, v = pixel
    if u >= environment.width or v >= environment.height:
        raise UserError(
            f"{key} is ({u:g}, {v:g}), outside the maps of room {environment.name}:"
            f" they are {environment.width}x{environment.height} pixels"
        )
    depth = environment.depth[int(v), int(u)]
    seen = np.array([(u - environment.cx) / environment.fx, (v - environment.cy) / environment.fy, 1.0]) * depth
    return np.asarray(environment.camera_to_world[:, :3] @ seen + environment.camera_to_world[:, 3], dtype=np.float64)


def turning(axis: Vector, degrees: float) -> Floats:
    """Rotation about an axis through the origin, float64 [3, 3] for column vectors; Rodrigues' formula."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    angle, across = math.radians(degrees), np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + math.sin(angle) * across + (1 - math.cos(angle)) * across @ across)


def rotation_matrix(transform: Transform) -> Floats:
    """Rotation about x, then y, then z: float64 [3, 3] for column vectors."""
    x, y, z = np.radians(transform.rotate)
    about_x = [[1, 0, 0], [0, math.cos(x), -math.sin(x)], [0, math.sin(x), math.cos(x)]]
    about_y = [[math.cos(y), 0, math.sin(y)], [0, 1, 0], [-math.sin(y), 0, math.cos(y)]]
    about_z = [[math.cos(z), -math.sin(z), 0], [math.sin(z), math.cos(z), 0], [0, 0, 1]]
    return np.asarray(np.array(about_z) @ np.array(about_y) @ np.array(about_x), dtype=np.float64)
