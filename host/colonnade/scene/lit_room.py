"""The light of a scene in a room: lights fitted where the scene names none, and colours that show the photo."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from colonnade.common import fixed_order, notes
from colonnade.common.errors import UserError
from colonnade.common.image_io import read_picture, rotation_notes
from colonnade.common.progress import QUIET, Progress
from colonnade.environment.load import load_environment
from colonnade.environment.photo_colours import PhotoColours, photo_colours
from colonnade.environment.shadow_strength import shadow_strength
from colonnade.environment.sunlight import Sunlight
from colonnade.maps.encoded import layout_of
from colonnade.mesh.materials.materials import MeshMaterial, is_lit
from colonnade.scene.model import Colour
from colonnade.scene.object_pose import Placed, standing_points, with_free_placement
from colonnade.scene.panorama_light import panorama_light
from colonnade.scene.room_lights import as_vector, lights_of, with_lights
from colonnade.scene.sun import sun_alone
from colonnade.scene.view import world_positions

if TYPE_CHECKING:
    from colonnade.common.types import Floats
    from colonnade.design.manifest import Manifest
    from colonnade.environment.lights import RoomLight
    from colonnade.environment.model import Environment
    from colonnade.environment.panorama import Panorama
    from colonnade.environment.surround import Surround
    from colonnade.scene.model import Scene

#: Share of the pixels darker than the photo from which a note reports it.
_REPORTED_CLAMPED = 0.02
#: Share of a panorama's light that reaches the surfaces near an object, where they gather light from each other.
_OPEN = 0.85
#: Radius of a fitted light, as a share of its distance from the object.
_AREA = 0.2
#: What names other lights.
_KEYS = "([[light]], [ambient])"


@dataclass(frozen=True)
class LitRoom:
    """A scene and its room, ready for a view.

    Attributes:
        placed: The scene with lights, a place for the object, and the headroom of the room's colours; the room with
            the colours that rays see.
        albedo: The room with its albedo, as its folder has it; None without a room.
        colours: How the photo's colours were made; None where the colours are the albedo.
        unseen: The light that no photo shows, without the scene's lights: a panorama, or walls that were fitted; None
            without them.
        strength: Of the object's shadow on the photo (`photo_strength`); None: it is whole.
        second: Another view of the room, which shows further directions; None without one.
    """

    placed: Placed
    albedo: Environment | None = None
    colours: PhotoColours | None = None
    unseen: Panorama | Surround | None = None
    strength: NDArray[np.uint8] | None = None
    second: Environment | None = None

    @property
    def scene(self) -> Scene:
        """The scene."""
        return self.placed.scene

    @property
    def environment(self) -> Environment | None:
        """The room with the colours that rays see; None without a room."""
        return self.placed.room

    def with_scene(self, scene: Scene) -> LitRoom:
        """With other settings of the scene, in the same light."""
        return replace(self, placed=self.placed.with_scene(scene))

    def seen_in(self, room: Environment, relit: bool) -> LitRoom:
        """In another view of the room: object, lights and headroom stay in the world, the camera is the view's."""
        scene = replace(fixed_in_world(self.placed).scene, frame_camera=None)
        placed = Placed(scene, self.placed.extent, room)
        colours = _photo_colours(placed, relit, scene.headroom)
        seen = placed if colours is None else placed.with_colours(colours.environment)
        strength = photo_strength(placed, relit)
        return replace(self, placed=seen, albedo=room, colours=colours, strength=strength)


def scene_room(scene: Scene) -> Environment | None:
    """Load the room of a scene; None without one."""
    return None if scene.background.room is None else load_environment(scene.background.room)


def device_room(scene: Scene, manifest: Manifest) -> Environment | None:
    """Load the room of a scene for a device.

    Raises:
        UserError: The device has no memory for a room, which is checked first; or the room cannot be read.
    """
    if scene.background.room is not None:
        layout_of(manifest)
    return scene_room(scene)


def view_photo(scene: Scene, room: Environment | None, size: tuple[int, int] | None) -> NDArray[np.uint8] | None:
    """The photo of a frame's view, sRGB: the room's, or for a camera that the scene places, of the scene.

    Raises:
        UserError: It cannot be read, or does not have the proportions of the frame.
    """
    if room is None or not scene.places_camera:
        return None if room is None else room.photo
    if scene.background.photo is None:
        return None
    photo = read_picture(scene.background.photo)
    notes.report(rotation_notes(scene.background.photo))
    height, width = photo.shape[:2]
    if size is not None and abs(width * size[1] - height * size[0]) >= max(width, height):
        raise UserError(
            f"{scene.background.photo} is {width}x{height} pixels, which does not have the proportions of a frame of"
            f" {size[0]}x{size[1]}: give another size"
        )
    return photo


def lit_room(
    placed: Placed,
    max_lights: int,
    relit: bool,
    progress: Progress = QUIET,
    materials: Sequence[MeshMaterial] = (),
) -> LitRoom:
    """Find the lights of a scene that names none, and choose the colours that rays see.

    They come from its panorama, or are fitted to the photo of its room.

    Args:
        placed: The scene in its room (`scene_room`).
        max_lights: Lights of the design.
        relit: The frame shows the room under the scene's lights, not its photo.
        progress: Shows the fit.
        materials: Of the mesh, with the scene's overrides, as they are rendered.

    Raises:
        UserError: The object cannot stand in the room, or `background.colours` asks for a photo that it lacks;
            or the panorama cannot be read.
    """
    placed = with_free_placement(placed)
    scene, room, _ = placed.scene, placed.room, placed.pose  # Its errors come before notes and long work
    if room is not None:
        room.tell_notes()
    around = panorama_light(placed, max_lights)
    second = _second_view(scene)
    unseen: Panorama | Surround | None = None
    if around is not None:
        scene, unseen = around.scene, around.panorama
    if room is None:
        return LitRoom(placed.with_scene(scene), unseen=unseen)
    if not scene.names_light and (around is None or not around.has_lights):
        scene, walls = _with_fitted_lights(placed.with_scene(scene), max_lights, progress)
        unseen = unseen or walls
    if scene.places_camera and (scene.background.photo is None or relit):
        can_have_photo = not relit and not scene.motion.camera
        notes.tell(
            f"the camera is not that of room {room.name}: what its maps do not show has background.colour"
            + (", unless background.photo is a photo of this view" if can_have_photo else "")
        )
    if scene.paths.gather and around is not None and room.photo is not None and not relit:
        scene = replace(scene, ambient=Colour(as_vector(_OPEN * np.array(scene.ambient.colour))))
    # Gathered light has the photo's own scale, so a headroom is for what marched rays alone show
    is_shown = scene.paths.gather == 0 or not any(map(is_lit, materials))
    placed = placed.with_scene(scene)
    colours = _photo_colours(placed, relit, None if is_shown else 1.0)
    strength = photo_strength(placed, relit)
    if colours is None:
        return LitRoom(placed, room, unseen=unseen, strength=strength, second=second)
    if colours.clamped > _REPORTED_CLAMPED and scene.names_light and scene.paths.gather == 0:
        notes.tell(
            f"{colours.clamped:.1%} of the pixels of room {room.name} are too dark under the scene's lights to show its"
            " photo in reflections: raise ambient.colour, or leave out [light] and [ambient], so that they are fitted"
        )
    placed = placed.with_scene(replace(scene, headroom=colours.headroom)).with_colours(colours.environment)
    return LitRoom(placed, room, colours, unseen, strength, second)


def _second_view(scene: Scene) -> Environment | None:
    """The second view of a scene's room; None without one, or where nothing gathers its light."""
    folder = scene.background.second_view
    if folder is None:
        return None
    second = load_environment(folder)
    if second.photo is None:
        raise UserError(f"background.second_view is {folder}, which has no photo.png or render.png")
    if scene.paths.gather == 0:
        notes.tell(f"the second view {folder} has no effect: the scene gathers no light, set paths.gather = 1")
        return None
    return second


def fixed_in_world(placed: Placed) -> Placed:
    """The scene with object and lights at their places in the world, for other views of its room.

    Args:
        placed: In the view from which they are placed, as in `LitRoom`; a scene that is fixed stays so.
    """
    scene, room = placed.scene, placed.room
    assert room is not None
    first, *more = world_positions(placed)
    if scene.standing_points is None and scene.placement is not None and scene.placement.stand_at is not None:
        scene = replace(scene, standing_points=standing_points(scene, room))
    lights = tuple(
        replace(light, position=as_vector(place)) for light, place in zip(scene.more_lights, more, strict=True)
    )
    light = replace(scene.light, position=as_vector(first))
    return placed.with_scene(replace(scene, light=light, more_lights=lights))


def photo_strength(placed: Placed, relit: bool) -> NDArray[np.uint8] | None:
    """The strength of the object's shadow on the photo of a room, uint8 [height, width].

    None, and whole, for a camera that is not the maps'; and unless the scene wants something else, for lights
    that it names, which the photo may not show, and in a room without an albedo map whose photo shows no sun and shade.

    Raises:
        UserError: `background.shadows` asks for a photo or an albedo map that the room lacks.
    """
    scene, room = placed.scene, placed.room
    assert room is not None
    wanted = scene.background.shadows
    if wanted == "photo" and (room.photo is None or not room.has_albedo):
        raise UserError(
            f"background.shadows is photo, but room {room.name} has no "
            + ("photo.png or render.png" if room.photo is None else "albedo.png: its albedo has the photo's shadows")
        )
    if relit or scene.places_camera or room.photo is None:
        return None
    if wanted == "whole" or (wanted is None and scene.names_light):
        return None
    if room.has_albedo:
        return shadow_strength(room, lights_of(placed))
    sun = Sunlight.of(room)
    return None if sun is None else sun.strength()


def _photo_colours(placed: Placed, relit: bool, headroom: float | None) -> PhotoColours | None:
    """The colours that show a room's photo; None where rays see its albedo."""
    room, wanted = placed.room, placed.scene.background.colours
    assert room is not None
    if wanted == "photo" and room.photo is None:
        raise UserError(f"background.colours is photo, but room {room.name} has no photo.png or render.png")
    if wanted == "albedo" or room.photo is None or (wanted is None and relit):
        return None
    return photo_colours(room, lights_of(placed), headroom)


def _with_fitted_lights(placed: Placed, max_lights: int, progress: Progress) -> tuple[Scene, Surround | None]:
    """The scene with fitted lights.

    If it gathers light, they are fitted beside the room's walls, and have an area: no photo tells their size,
    and an edge that is too soft shows less than a hard one in a wrong place.
    """
    from colonnade.environment.fitted_lights import fitted_lights
    from colonnade.environment.light_fit import DEFAULT_LIGHTS

    scene, room = placed.scene, placed.room
    assert room is not None
    if room.photo is None:
        room.tell("lights", f"no photo to fit lights to, one beside the object and ambient light 0.1 {_KEYS}")
        return scene, None
    if (sunny := sun_alone(placed)) is not None:
        room.tell("lights", f"the sun overhead, as the photo shows sun and shade {_KEYS}")
        return replace(with_lights(scene, sunny), fits_lights=scene.paths.gather > 0), None
    with progress.step("fitting lights to the photo"):
        fit = fitted_lights(room, min(DEFAULT_LIGHTS, max_lights), walls=scene.paths.gather > 0)
    count = len(fit.lights.lights)
    room.tell("lights", f"ambient light and {count} point light{'' if count == 1 else 's'} fitted to the photo {_KEYS}")
    lights = fit.lights
    if scene.paths.gather:
        lights = replace(lights, lights=tuple(_with_area(light, placed.middle) for light in lights.lights))
    return replace(with_lights(scene, lights), fits_lights=scene.paths.gather > 0), fit.surround


def _with_area(light: RoomLight, point: Floats) -> RoomLight:
    """A fitted light with an area, as a point sees it; one that the photo shows has its own."""
    if light.radius > 0:
        return light
    away = light.position - point
    return replace(light, radius=round(_AREA * float(np.sqrt(fixed_order.dot(away, away))), 3))
