"""The object's pose: transforms between mesh space, world space and a room's view space."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors
from colonnade.scene.model import Placement, Scene, Transform, Vector, interpolate
from colonnade.scene.standing import Footprint, free_place, surface_point

if TYPE_CHECKING:
    from colonnade.environment.model import Environment
    from colonnade.mesh.mesh import Extent


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

    The joined mesh of several objects is in world space already; the motion moves it as one.

    Raises:
        UserError: A pixel is outside the room's maps, or the motion does not match the kind of pose.
    """
    scene = settled(scene, extent, environment)
    placement, motion, progress = scene.placement, scene.motion, scene.motion_progress
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
    assert placement.stand_at is not None
    point = surface_point(placement.stand_at, environment, "object.stand_at")
    if motion.stand_at is not None:
        point = (1.0 - progress) * point + progress * surface_point(motion.stand_at, environment, "motion.stand_at")
    return standing_pose(placement, rotation, extent, point, motion.turn * progress)


def settled(scene: Scene, extent: Extent, environment: Environment | None) -> Scene:
    """The scene with the place that is chosen for an object that stands in a room without a given one.

    Raises:
        UserError: No level surface in view has room for the object.
    """
    placement = _placement(scene, environment)
    if environment is None or placement is None or placement.stand_at is not None:
        return scene
    return replace(scene, placement=chosen(placement, rotation_matrix(scene.transform), extent, environment, "object"))


def chosen(
    placement: Placement,
    rotation: Floats,
    extent: Extent,
    environment: Environment,
    key: str,
    taken: Sequence[tuple[Floats, float]] = (),
) -> Placement:
    """The placement with the pixel that `free_place` finds for a mesh; ``key`` is the table's name in errors."""
    footprint = footprint_of(placement, rotation, extent)
    place = free_place(environment, footprint, taken)
    if place is None:
        raise UserError(
            f"no level surface in view of room {environment.name} has room for an object {2 * footprint.radius:.2g} m"
            f" wide and {footprint.height:.2g} m high: give {key}.stand_at, or a smaller {key}.size"
        )
    return replace(placement, stand_at=place)


def footprint_of(placement: Placement, rotation: Floats, extent: Extent) -> Footprint:
    """The upright cylinder around a standing mesh, whatever its turn."""
    outline = (extent.outline - extent.centre) @ rotation.T * (placement.size / extent.edge)
    return Footprint(float(np.hypot(outline[:, 0], outline[:, 2]).max()), float(np.ptp(outline[:, 1])))


def standing_pose(placement: Placement, rotation: Floats, extent: Extent, point: Floats, turn: float = 0.0) -> Pose:
    """The pose of a mesh that stands on a point, turned by more degrees about the vertical."""
    turned = rotation_matrix(Transform(rotate=(0.0, placement.turn + turn, 0.0))) @ rotation
    outline = extent.outline @ turned.T
    foot = extent.centre @ turned.T
    foot[1] = outline[:, 1].min()
    scale = placement.size / extent.edge
    return Pose(turned, scale, point - foot * scale)


def _placement(scene: Scene, environment: Environment | None) -> Placement | None:
    """How a scene's one object stands in a room; None if its transform places it."""
    if scene.objects or environment is None:
        return None
    return Placement() if scene.placement is None and scene.transform == Transform() else scene.placement


def rotation_about(axis: Vector, degrees: float) -> Floats:
    """Rotation about an axis through the origin by Rodrigues' formula, float64 [3, 3] for column vectors."""
    x, y, z = unit_vectors(np.array(axis))
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
