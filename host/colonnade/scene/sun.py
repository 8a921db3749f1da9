"""The sun of a scene, where the photo of its room shows sun and shade."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from colonnade.common.accumulation import LUMINANCE
from colonnade.environment.lights import RoomLight, RoomLights
from colonnade.environment.panorama_lights import DistantLight
from colonnade.environment.sunlight import Sunlight
from colonnade.scene.object_pose import object_pose

if TYPE_CHECKING:
    from colonnade.common.types import Floats
    from colonnade.environment.model import Environment
    from colonnade.environment.panorama import Panorama
    from colonnade.mesh.materials.mesh import Extent
    from colonnade.scene.model import Scene

#: Least height of the direction of a light that is the sun.
_HIGH = 0.2
#: A sun that no panorama shows: its direction, radius in radians, and distance in edges of the object's cube.
_UP, _RADIUS, _FAR = np.array([0.0, 1.0, 0.0]), float(np.radians(0.5)), 50.0
#: Albedo of the ground, as of any room (`derived_albedo`), where a photo alone tells the light.
_ALBEDO = 0.45


def with_sun(
    found: list[DistantLight], rest: Panorama, scene: Scene, extent: Extent, room: Environment
) -> list[DistantLight]:
    """The lights of a panorama with the sun of a room's photo, as bright as its share on the object.

    It is the brightest light from above; the panorama of a place in the shade has none, and the sun is overhead.
    """
    sun = Sunlight.of(room)
    if sun is None:
        return found
    high = [light for light in found if light.direction[1] > _HIGH]
    first = max(high, key=lambda light: float(light.colour @ LUMINANCE), default=DistantLight(_UP, _UP, _RADIUS))
    share = _share(sun, scene, extent, room, first.direction)
    colour = sun.colour(rest.on_ground()) * share / first.direction[1]
    where = "where the panorama has it" if high else "overhead, as the panorama has none"
    room.tell("sun", f"the photo shows sun and shade, the sun is {where}, and {share:.0%} of the object is in it")
    return [replace(first, colour=colour, is_far=True), *(light for light in found if light is not first)]


def sun_alone(scene: Scene, extent: Extent, room: Environment) -> RoomLights | None:
    """The sun overhead, and the light of the shade around, of a photo alone; None where it shows none."""
    sun = Sunlight.of(room)
    if sun is None:
        return None
    pose, ambient = object_pose(scene, extent, room), sun.shade / _ALBEDO
    distance = _FAR * extent.edge * pose.scale
    colour = sun.colour(ambient) * _share(sun, scene, extent, room, _UP)
    light = RoomLight(
        (pose.to_world(extent.centre) + distance * _UP).round(3),
        colour.round(4),
        None,
        round(distance * float(np.tan(_RADIUS)), 3),
    )
    return RoomLights(ambient.round(4), (light,))


def _share(sun: Sunlight, scene: Scene, extent: Extent, room: Environment, towards: Floats) -> float:
    """Share of the object that the sun reaches, of its extreme points."""
    points = object_pose(scene, extent, room).to_world(extent.outline)
    return sun.share(room, points, towards)
