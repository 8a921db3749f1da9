"""The light cube of a scene, for the device and for the reference."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from colonnade.common import notes
from colonnade.common.types import Floats
from colonnade.environment.light_cube import LARGEST, LightCube
from colonnade.environment.lights import RoomLight
from colonnade.environment.panorama import Panorama
from colonnade.environment.seen_light import FINE
from colonnade.maps.room_light import room_light
from colonnade.scene.lit_room import LitRoom
from colonnade.scene.object_pose import Pose
from colonnade.scene.room_lights import lights_of
from colonnade.scene_image.file import LoadSection, SceneImage
from colonnade.scene_image.header import LoadedMemory

if TYPE_CHECKING:
    from colonnade.maps.image import AttributeImage

#: The device's memory of the light cube.
MEMORY = "light.cube"
#: Largest value of the register `gather.parallax`.
LAST_PARALLAX = 3
#: Share of the light that the cube cannot hold, from which a note reports it.
_REPORTED_LOSS = 0.02


def scene_cube(lit: LitRoom, image: AttributeImage | None, relit: bool, is_noted: bool = False) -> LightCube | None:
    """The light that rays meet that leave the object, by directions of mesh space; None for a scene that gathers none.

    In a room it is the room's light at the middle of the object, elsewhere a panorama's, or the ambient light.
    The lights with a radius are marked in it, but not fitted ones, whose places are guesses. Radiance has the scene's
    `exposure`.

    Args:
        lit: The scene in its room.
        image: The encoded maps of the room.
        relit: The frame shows the room under the scene's lights, not its photo.
        is_noted: Note what no picture shows, and what the cube cannot hold.
    """
    scene, placed, room, unseen, second = lit.scene, lit.placed, lit.environment, lit.unseen, lit.second
    if scene.paths.gather == 0:
        return None
    pose, point, extent, distance = placed.pose, placed.middle, placed.extent, np.inf
    lights = lights_of(placed)
    if room is not None and image is not None:
        light = room_light(room, image, lights.brighter(scene.headroom), point, not relit, unseen, second)
        if is_noted and not isinstance(unseen, Panorama):
            others = "walls under the scene's lights" if unseen is None else "fitted walls"
            more = "background.panorama" + (", background.second_view" if second is None else "")
            room.tell("seen", f"{light.seen:.0%} of the directions of light seen, {others} in the others ({more})")
        cube, distance = light.cube, light.distance / pose.scale
    elif isinstance(unseen, Panorama):
        cube = unseen.cube(FINE)
    else:
        cube = LightCube(np.broadcast_to(np.array(scene.ambient.colour), (6, 1, 1, 3)))
    cube = replace(cube.turned(pose.rotation), middle=extent.centre, distance=_shown(distance, extent.edge))
    cube = replace(cube, texels=cube.texels * scene.exposure)
    whole, lost = cube.texels.sum(), (cube.texels - LARGEST).clip(min=0.0).sum()
    if lost > _REPORTED_LOSS * whole and is_noted:
        limit = LARGEST / scene.exposure
        source = "background.panorama_exposure" if isinstance(unseen, Panorama) else "the colours of [light], [ambient]"
        notes.tell(
            f"{lost / whole:.0%} of the light is brighter than {limit:g}, the most that a texel holds, and is lost:"
            f" lower {source}"
        )
    known = () if scene.fits_lights else lights.lights
    return cube.with_lights([disc for light in known if (disc := _disc(light, point, pose)) is not None])


def _shown(distance: float, edge: float) -> float:
    """The nearest distance that the device's parallax can have, in mesh units as both arguments."""
    choices = [edge * 2.0**number for number in range(LAST_PARALLAX)]
    return next((choice for choice in choices if distance < choice * np.sqrt(2.0)), np.inf)


def _disc(light: RoomLight, point: Floats, pose: Pose) -> tuple[Floats, float] | None:
    """Direction in mesh space and angular radius of a light, as seen from a point in world space.

    None for a light without a radius, and for one around the point.
    """
    away = light.position - point
    distance = float(np.sqrt(away @ away))
    if not 0 < light.radius < distance:
        return None
    return np.asarray((away / distance) @ pose.rotation), float(np.arctan(light.radius / distance))


def with_cube(image: SceneImage, cube: LightCube | None) -> SceneImage:
    """A scene image with a light cube in place of its own."""
    others = tuple(section for section in image.attributes if section.memory != MEMORY)
    words = () if cube is None else (LoadSection(MEMORY, cube.words()),)
    light = tuple(LoadedMemory(section.memory, *section.words.shape) for section in words)
    parallax = 0
    if cube is not None and np.isfinite(cube.distance):
        parallax = 1 + round(math.log2(cube.distance / image.header.extent.edge))
    header = replace(image.header, light=light, parallax=parallax)
    return replace(image, header=header, attributes=(*others, *words))
