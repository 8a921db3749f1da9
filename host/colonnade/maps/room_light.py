"""The light of a room around a point: its picture, and elsewhere a panorama, fitted walls, or bounding planes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colonnade.common import fixed_order
from colonnade.common.types import Floats
from colonnade.environment.light_cube import LightCube, face_directions
from colonnade.environment.lights import RoomLights, irradiance, room_box
from colonnade.environment.model import Environment
from colonnade.environment.panorama import Panorama
from colonnade.environment.seen_light import FINE, SeenLight
from colonnade.environment.surround import Surround
from colonnade.maps.decoded_planes import DecodedPlanes
from colonnade.maps.image import AttributeImage

#: A point is at least so far inside the box around a room, metres.
_INSIDE = 0.1


@dataclass(frozen=True)
class RoomLight:
    """Light around a point of a room.

    Attributes:
        cube: By directions of world space.
        seen: Share of all directions in which the room's picture shows something, 0 to 1.
        distance: To the box around the room, along the largest component of a direction, the median, metres.
    """

    cube: LightCube
    seen: float
    distance: float


def room_light(
    environment: Environment,
    image: AttributeImage,
    lights: RoomLights,
    point: Floats,
    from_photo: bool,
    unseen: Panorama | Surround | None = None,
    second: Environment | None = None,
) -> RoomLight:
    """The light of a room that meets a point.

    Args:
        environment: The room.
        image: Its encoded maps, for the bounding planes.
        lights: Of the room, without shadows: they light what nothing shows.
        point: World space, float64 [3].
        from_photo: The light is the room's photo's, if there is one, not of its albedo under the lights.
        unseen: The light of directions that the room's picture does not show; None: the bounding planes'.
        second: Another view of the room, which shows further directions.
    """
    directions, _ = face_directions(FINE)
    shadowless = None if from_photo and environment.photo is not None else lights
    seen = SeenLight.of(environment, point, shadowless)
    if second is not None:
        seen = seen.beside(SeenLight.of(second, point, shadowless))
    if unseen is None:
        others = _bounding_light(environment, image, lights, point, seen)
    elif isinstance(unseen, Surround):
        others = unseen.at(point, directions.reshape(-1, 3))
    else:
        others = unseen.cube(FINE).texels.reshape(-1, 3)
    radiance = np.where(seen.is_seen[:, None], seen.radiance, others)
    return RoomLight(LightCube(radiance.reshape(directions.shape)), seen.share, _distance(environment, point))


def _distance(environment: Environment, point: Floats) -> float:
    """The median of the distances from a point to the box around a room, along the largest component, metres."""
    from colonnade import _core

    low, high = room_box(environment)
    inside = np.clip(point, low + _INSIDE, high - _INSIDE)
    return float(_core.box_distance(low.tolist(), high.tolist(), inside.tolist()))


def _bounding_light(
    environment: Environment, image: AttributeImage, lights: RoomLights, point: Floats, seen: SeenLight
) -> Floats:
    """The light of the bounding planes, and the mean of all other light where there is none, float64 [texels, 3]."""
    directions, weights = face_directions(FINE)
    flat, solid = directions.reshape(-1, 3), np.broadcast_to(weights, directions.shape[:3]).ravel()
    rotation, eye = environment.camera_to_world[:, :3], environment.camera_to_world[:, 3]
    found = DecodedPlanes.of(environment, image).intersect(
        np.broadcast_to(fixed_order.product((point - eye)[None], rotation), flat.shape),
        fixed_order.product(flat, rotation),
    )
    position = fixed_order.product(found.position, rotation.T) + eye
    radiance = found.albedo * irradiance(position, fixed_order.product(found.normals, rotation.T), lights)
    known = seen.is_seen | ~found.outside
    if known.any():
        light = np.where(seen.is_seen[:, None], seen.radiance, radiance)
        radiance[~known] = (light[known] * solid[known, None]).sum(axis=0) / solid[known].sum()
    else:
        radiance[:] = lights.ambient
    return np.asarray(radiance)
