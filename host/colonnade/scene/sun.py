"""The sun of a scene, where the photo of its room shows sun and shade."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from colonnade.common.accumulation import LUMINANCE
from colonnade.environment.lights import RoomLight, RoomLights
from colonnade.environment.panorama_lights import DistantLight
from colonnade.environment.sunlight import Sunlight

if TYPE_CHECKING:
    from colonnade.environment.panorama import Panorama
    from colonnade.scene.object_pose import Placed

#: Least height of the direction of a light that is the sun.
_HIGH = 0.2
#: A sun that no panorama shows: its direction, radius in radians, and distance in edges of the object's cube.
_UP, _RADIUS, _FAR = np.array([0.0, 1.0, 0.0]), float(np.radians(0.5)), 50.0
#: Albedo of the ground, as of any room (`derived_albedo`), where a photo alone tells the light.
_ALBEDO = 0.45


def with_sun(found: list[DistantLight], rest: Panorama, placed: Placed) -> list[DistantLight]:
    """The lights of a panorama with the sun of a room's photo, as bright as its share on the object.

    It is the brightest light from above; the panorama of a place in the shade has none, and the sun is overhead.
    """
    room = placed.room
    sun = None if room is None else Sunlight.of(room)
    if room is None or sun is None:
        return found
    high = [light for light in found if light.direction[1] > _HIGH]
    first = max(high, key=lambda light: float(light.colour @ LUMINANCE), default=DistantLight(_UP, _UP, _RADIUS))
    share = sun.share(room, placed.pose.to_world(placed.extent.outline), first.direction)
    colour = sun.colour(rest.on_ground()) * share / first.direction[1]
    where = "where the panorama has it" if high else "overhead, as the panorama has none"
    room.tell("sun", f"the photo shows sun and shade, the sun is {where}, and {share:.0%} of the object is in it")
    return [replace(first, colour=colour, is_far=True), *(light for light in found if light is not first)]


def sun_alone(placed: Placed) -> RoomLights | None:
    """The sun overhead, and the light of the shade around, of a photo alone; None where it shows none."""
    room, extent = placed.room, placed.extent
    sun = None if room is None else Sunlight.of(room)
    if room is None or sun is None:
        return None
    ambient, distance = sun.shade / _ALBEDO, _FAR * extent.edge * placed.pose.scale
    light = RoomLight(
        (placed.middle + distance * _UP).round(3),
        (sun.colour(ambient) * sun.share(room, placed.pose.to_world(extent.outline), _UP)).round(4),
        None,
        round(distance * float(np.tan(_RADIUS)), 3),
    )
    return RoomLights(ambient.round(4), (light,))
