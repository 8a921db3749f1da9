"""The object's pose in its room: transforms between mesh space, world space and a room's view space."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from colonnade.common import fixed_order
from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors
from colonnade.scene.model import Placement, Scene, Transform, Vector, interpolate
from colonnade.scene.standing import Footprint, free_place, surface_point

if TYPE_CHECKING:
    from colonnade.environment.model import Environment
    from colonnade.mesh.materials.mesh import Extent


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

    @property
    def matrix(self) -> Floats:
        """From mesh space to world space, float64 [4, 4]."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.rotation * self.scale, self.translate
        return matrix

    def to_world(self, points: Floats) -> Floats:
        """Transform points [..., 3] from mesh space to world space."""
        return np.asarray(fixed_order.product(points, self.rotation.T) * self.scale + self.translate, dtype=np.float64)

    def to_mesh(self, point: Floats) -> Floats:
        """Transform points [..., 3] from world space to mesh space."""
        return np.asarray(fixed_order.product((point - self.translate) / self.scale, self.rotation), dtype=np.float64)

    def from_view(self, camera_to_world: Floats) -> Floats:
        """Transform from a camera's view space to mesh space, float64 [3, 4]."""
        linear = fixed_order.product(self.rotation.T, camera_to_world[:, :3]) / self.scale
        return np.column_stack([linear, self.to_mesh(camera_to_world[:, 3])])


@dataclass(frozen=True)
class Placed:
    """A scene in its room, and the pose of its object there.

    What is derived by `with_scene` and `with_colours` shares the poses, so that each is computed once.

    Attributes:
        scene: The scene, at its motion's progress and its sample.
        extent: Bounds of its mesh (`Mesh.extent`, or an image header's).
        room: The room of its background; None without one.
    """

    scene: Scene
    extent: Extent
    room: Environment | None = None
    _poses: dict[Hashable, Pose] = field(default_factory=dict, init=False, repr=False, compare=False)

    def with_scene(self, scene: Scene) -> Placed:
        """With other settings of the scene: another moment, pass, light or place of the object."""
        return self._sharing(Placed(scene, self.extent, self.room))

    def with_colours(self, room: Environment) -> Placed:
        """With other colours of the room, whose geometry stays."""
        return self._sharing(Placed(self.scene, self.extent, room))

    def _sharing(self, other: Placed) -> Placed:
        object.__setattr__(other, "_poses", self._poses)
        return other

    @property
    def pose(self) -> Pose:
        """The object's pose at the motion's progress (`object_pose`).

        Raises:
            UserError: See `object_pose`.
        """
        return self._pose_at(self.scene.motion_progress)

    @property
    def start(self) -> Pose:
        """The object's pose at the start of the motion."""
        return self._pose_at(0.0)

    @property
    def middle(self) -> Floats:
        """World position of the middle of the object, float64 [3]."""
        return self.pose.to_world(self.extent.centre)

    def _pose_at(self, progress: float) -> Pose:
        one = self.scene
        objects, up = bool(one.objects), one.camera.up
        of = (one.transform, one.placement, one.motion, one.standing_points, objects, up, progress)
        if of not in self._poses:
            self._poses[of] = object_pose(self.with_scene(one.at(progress)))
        return self._poses[of]


def object_pose(placed: Placed) -> Pose:
    """The pose of a scene's mesh at its motion's progress: by its transform, or standing in a room.

    The joined mesh of several objects is in world space already; the motion moves it as one.

    Raises:
        UserError: A pixel is outside the room's maps, or the motion does not match the kind of pose.
    """
    scene, extent, environment = with_free_placement(placed).scene, placed.extent, placed.room
    placement, motion, progress = scene.placement, scene.motion, scene.motion_progress
    rotation = rotation_matrix(scene.transform)
    if environment is None or placement is None:
        if motion.stand_at is not None:
            raise UserError("motion.stand_at is for an object that stands in a room: give motion.translate")
        start, scale = scene.transform.translate, scene.transform.scale
        moved = start if motion.translate is None else interpolate(start, motion.translate, progress)
        axis = (0.0, 1.0, 0.0) if environment is not None else scene.camera.up
        turned = fixed_order.product(rotation_about(axis, motion.degrees * progress), rotation)
        return Pose(turned, scale, np.array(moved) + fixed_order.product(scale * (rotation - turned), extent.centre))
    if motion.translate is not None:
        raise UserError("motion.translate is for an object that does not stand in a room: give motion.stand_at")
    start, end = scene.standing_points or standing_points(scene, environment)
    point = np.array(start if motion.stand_at is None else interpolate(start, end, progress))
    return standing_pose(placement, rotation, extent, point, motion.degrees * progress)


def standing_points(scene: Scene, environment: Environment) -> tuple[Vector, Vector]:
    """The world points on which an object with a place stands at the ends of the motion, as a room's view shows them.

    Raises:
        UserError: A pixel is outside the room's maps, or not on a surface that bears an object.
    """
    assert scene.placement is not None and scene.placement.stand_at is not None
    start, end = scene.placement.stand_at, scene.motion.stand_at
    first = surface_point(start, environment, "object.stand_at").tolist()
    last = first if end is None else surface_point(end, environment, "motion.stand_at").tolist()
    return interpolate(first, last, 0.0), interpolate(first, last, 1.0)


def with_free_placement(placed: Placed) -> Placed:
    """With the place that is chosen for an object that stands in a room without a given one.

    Raises:
        UserError: No level surface in view has room for the object.
    """
    scene, room = placed.scene, placed.room
    placement = _placement(scene, room)
    if room is None or placement is None or placement.stand_at is not None:
        return placed
    placement = free_placement(placement, rotation_matrix(scene.transform), placed.extent, room, "object")
    return placed.with_scene(replace(scene, placement=placement))


def free_placement(
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
    outline = fixed_order.product(extent.outline - extent.centre, rotation.T) * (placement.size / extent.edge)
    across = outline[:, [0, 2]]
    radius = float(np.sqrt(fixed_order.dot(across, across)).max())
    return Footprint(radius, float(np.ptp(outline[:, 1])))


def standing_pose(placement: Placement, rotation: Floats, extent: Extent, point: Floats, turn: float = 0.0) -> Pose:
    """The pose of a mesh that stands on a point, turned by more degrees about the vertical."""
    turned = fixed_order.product(rotation_matrix(Transform(rotate=(0.0, placement.turn + turn, 0.0))), rotation)
    outline = fixed_order.product(extent.outline, turned.T)
    foot = fixed_order.product(turned, extent.centre)
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
    angle, cross_product = np.radians(degrees), np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    twice = fixed_order.product(cross_product, cross_product)
    return np.asarray(np.eye(3) + fixed_order.sin(angle) * cross_product + (1 - fixed_order.cos(angle)) * twice)


def rotation_matrix(transform: Transform) -> Floats:
    """Rotation about x, then y, then z: float64 [3, 3] for column vectors."""
    angles = np.radians(transform.rotate)
    (cx, cy, cz), (sx, sy, sz) = fixed_order.cos(angles), fixed_order.sin(angles)
    about_x = np.array([[1.0, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1.0, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1.0]])
    return np.asarray(fixed_order.product(fixed_order.product(about_z, about_y), about_x), dtype=np.float64)
