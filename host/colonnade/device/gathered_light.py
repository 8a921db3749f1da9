"""The light cube of a scene, for the device and for the reference."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from colonnade.common.progress import QUIET, Progress
from colonnade.environment.light_cube import FACE, LightCube
from colonnade.maps.room_light import room_light
from colonnade.scene.object_pose import object_pose
from colonnade.scene.room_lights import lights_of
from colonnade.scene_image.file import LoadSection, SceneImage
from colonnade.scene_image.header import LoadedMemory

if TYPE_CHECKING:
    from colonnade.environment.model import Environment
    from colonnade.maps.image import AttributeImage
    from colonnade.mesh.mesh import Extent
    from colonnade.scene.model import Scene


#: The device's memory of the light cube.
MEMORY = "light.cube"


def scene_cube(
    scene: Scene,
    extent: Extent,
    room: Environment | None,
    image: AttributeImage | None,
    relit: bool,
    progress: Progress = QUIET,
) -> LightCube | None:
    """The light that gathered rays meet, by directions of mesh space; None for a scene without them.

    In a room it is the room's light at the middle of the object, elsewhere the ambient light.

    Args:
        scene: With lights and a place for the object, as in `LitRoom`.
        extent: Bounds of the mesh.
        room: The room with the colours that rays see.
        image: Its encoded maps.
        relit: The frame shows the room under the scene's lights, not its photo.
        progress: Notes how much of the room's light the picture shows.
    """
    if scene.paths.gather == 0:
        return None
    if room is None or image is None:
        return LightCube(np.broadcast_to(np.array(scene.ambient.colour), (6, FACE, FACE, 3)))
    pose = object_pose(scene, extent, room)
    light = room_light(room, image, lights_of(scene, extent, room), pose.to_world(extent.centre), not relit)
    progress.note(
        f"gathered rays meet the light of room {room.name}: its picture shows {light.seen:.0%} of the directions, its"
        " bounding planes under the scene's lights stand for the others"
    )
    return light.cube.turned(pose.rotation)


def with_cube(image: SceneImage, cube: LightCube | None) -> SceneImage:
    """A scene image with a light cube in place of its own."""
    others = tuple(section for section in image.attributes if section.memory != MEMORY)
    words = () if cube is None else (LoadSection(MEMORY, cube.words()),)
    light = tuple(LoadedMemory(section.memory, *section.words.shape) for section in words)
    return replace(image, header=replace(image.header, light=light), attributes=(*others, *words))
