"""The light of a room around a point: what its photo shows, and bounding planes where it shows nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.common import fixed_order
from colonnade.common.image_io import decode_srgb
from colonnade.common.types import Floats
from colonnade.environment.light_cube import LightCube, face_directions
from colonnade.environment.lights import RoomLights, irradiance, world_surface
from colonnade.environment.model import Environment
from colonnade.maps.decoded_planes import DecodedPlanes
from colonnade.maps.image import AttributeImage

#: Texels along the edge of a face while the light is collected.
_FINE = 32
#: Pixels of a texel that are farther than its nearest one by this factor are behind it.
_BEHIND = 1.1


@dataclass(frozen=True)
class RoomLight:
    """Light around a point of a room.

    Attributes:
        cube: By directions of world space.
        seen: Share of all directions in which the room's picture shows something, 0 to 1.
    """

    cube: LightCube
    seen: float


def room_light(
    environment: Environment, image: AttributeImage, lights: RoomLights, point: Floats, from_photo: bool
) -> RoomLight:
    """The light of a room that meets a point.

    Args:
        environment: The room.
        image: Its encoded maps, for the bounding planes.
        lights: Of the room, without shadows: they light what no photo shows.
        point: World space, float64 [3].
        from_photo: The light is that of the room's photo, not of its albedo under the lights.
    """
    directions, weights = face_directions(_FINE)
    flat, solid = directions.reshape(-1, 3), np.broadcast_to(weights, directions.shape[:3]).ravel()
    light, is_seen = _seen(environment, lights, point, from_photo)
    rotation, eye = environment.camera_to_world[:, :3], environment.camera_to_world[:, 3]
    planes = DecodedPlanes.of(environment, image)
    found = planes.intersect(
        np.broadcast_to(fixed_order.product((point - eye)[None], rotation), flat.shape),
        fixed_order.product(flat, rotation),
    )
    position = fixed_order.product(found.position, rotation.T) + eye
    behind = found.albedo * irradiance(position, fixed_order.product(found.normals, rotation.T), lights)
    known = is_seen | ~found.outside
    radiance = np.where(is_seen[:, None], light, behind)
    if known.any():
        radiance[~known] = (radiance[known] * solid[known, None]).sum(axis=0) / solid[known].sum()
    else:
        radiance[:] = lights.ambient
    return RoomLight(LightCube(radiance.reshape(directions.shape)), float(solid[is_seen].sum() / solid.sum()))


def _seen(
    environment: Environment, lights: RoomLights, point: Floats, from_photo: bool
) -> tuple[Floats, NDArray[np.bool_]]:
    """The light of what the picture shows, float64 [texels, 3], and where it shows something, bool [texels]."""
    surface, normals = world_surface(environment)
    if from_photo and environment.photo is not None:
        colours = decode_srgb(environment.photo)
    else:
        colours = (environment.albedo * irradiance(surface, normals, lights)).clip(max=1.0)
    towards = (surface - point).reshape(-1, 3)
    facing = fixed_order.dot(normals.reshape(-1, 3), towards) < 0
    towards, colours = towards[facing], colours.reshape(-1, 3)[facing]
    count = 6 * _FINE * _FINE
    texel = LightCube(np.zeros((6, _FINE, _FINE, 3))).texel_of(towards)
    distance = np.sqrt(fixed_order.dot(towards, towards))
    nearest = np.full(count, np.inf)
    np.minimum.at(nearest, texel, distance)
    is_near = distance <= _BEHIND * nearest[texel]
    pixels = np.bincount(texel[is_near], minlength=count)
    sums = np.stack([np.bincount(texel[is_near], colours[is_near, channel], count) for channel in range(3)], axis=1)
    return sums / np.maximum(pixels, 1)[:, None], pixels > 0
