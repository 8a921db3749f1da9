"""The light of a scene with a panorama: its exposure, and the lights that are found in it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from colonnade.common import notes
from colonnade.common.accumulation import LUMINANCE
from colonnade.common.types import Floats
from colonnade.environment.light_cube import LightCube
from colonnade.environment.lights import RoomLight, RoomLights, light_box
from colonnade.environment.panorama import Panorama
from colonnade.environment.panorama_file import read_panorama
from colonnade.environment.panorama_lights import DistantLight, split_lights
from colonnade.environment.photo_colours import MAX_INTENSITY
from colonnade.environment.seen_light import FINE, SeenLight, texel_weights
from colonnade.scene.room_lights import with_lights
from colonnade.scene.sun import with_sun

if TYPE_CHECKING:
    from colonnade.environment.model import Environment
    from colonnade.scene.model import Scene
    from colonnade.scene.object_pose import Placed

#: Lights that are found for frames of several samples, at most: passes share them.
MOST_LIGHTS = 8
#: Distance of a light without a room, in edges of the object's cube.
_FAR = 50.0
#: Least share of all directions that tells the exposure.
_LEAST_SEEN = 0.02


@dataclass(frozen=True)
class PanoramaLight:
    """A scene with the lights of its panorama.

    Attributes:
        scene: With lights, unless the panorama is cut off and shows none, and the room has a photo to fit them to.
        panorama: The light of all directions, at the scene's exposure, without the lights that were found in it.
        has_lights: The panorama has decided the scene's lights.
    """

    scene: Scene
    panorama: Panorama
    has_lights: bool


def panorama_light(placed: Placed, max_lights: int) -> PanoramaLight | None:
    """Read the panorama of a scene, and find its lights if the scene names none; None for a scene without one.

    Args:
        placed: With a place for the object.
        max_lights: Lights of the design.

    Raises:
        UserError: The panorama cannot be read.
    """
    scene, room, background = placed.scene, placed.room, placed.scene.background
    if background.panorama is None:
        return None
    panorama = read_panorama(background.panorama, background.panorama_yaw)
    point, name = placed.middle, background.panorama.name
    seen = None if room is None or room.photo is None else SeenLight.of(room, point)
    exposure = background.panorama_exposure
    if exposure is None:
        exposure = 1.0 if seen is None else fitted_exposure(panorama, seen)
        if exposure != 1.0:
            notes.tell(
                f"panorama {name} has the exposure {exposure:g}, fitted to the photo where this shows the same"
                " directions: background.panorama_exposure sets another one"
            )
    panorama = panorama.scaled(exposure)
    if scene.names_light and scene.paths.gather == 0:
        notes.tell(
            f"panorama {name} has no effect: the scene names its lights and gathers none, leave them out or set"
            " paths.gather = 1"
        )
    if scene.names_light:
        return PanoramaLight(scene, panorama, True)
    found, rest = split_lights(panorama, max_lights if scene.frame.samples == 1 else MOST_LIGHTS)
    if not found and seen is not None and panorama.is_cut_off:
        return PanoramaLight(scene, rest, False)
    found = with_sun(found, rest, placed)
    lights = _placed(found, room, point, placed.extent.edge * placed.pose.scale, seen)
    ambient = _mean(rest, seen).clip(max=MAX_INTENSITY)
    scene = replace(with_lights(scene, RoomLights(ambient.round(4), tuple(lights))), pass_lights=max_lights)
    count = len(lights)
    notes.tell(
        f"the scene names no light: ambient light and {count} light{'' if count == 1 else 's'} are those of panorama"
        f" {name}; [[light]] and [ambient] name others"
        + (", and frame.samples = 16 shows the area of these" if lights and scene.frame.samples == 1 else "")
    )
    brightest = max((float(light.colour.max()) for light in found), default=0.0)
    if brightest > MAX_INTENSITY:
        notes.tell(
            f"a light of panorama {name} is {brightest / MAX_INTENSITY:.1f} times as bright as a light can be, and is"
            " dimmed: lower background.panorama_exposure"
        )
    return PanoramaLight(scene, rest, True)


def fitted_exposure(panorama: Panorama, seen: SeenLight) -> float:
    """The factor that makes a panorama as bright as a photo in the directions that both show; 1 if these are few.

    It is by least squares with a variance that grows with the brightness, so a panorama of another place does not
    darken it. Directions in which the photo saturates do not count.
    """
    weights = texel_weights()
    used = weights * (seen.is_seen & ~seen.is_bright)
    total = float(used @ (panorama.cube(FINE).texels.reshape(-1, 3) @ LUMINANCE))
    if used.sum() < _LEAST_SEEN * weights.sum() or total <= 0:
        return 1.0
    return float(f"{used @ (seen.radiance @ LUMINANCE) / total:.4g}")


def _mean(panorama: Panorama, seen: SeenLight | None) -> Floats:
    """The mean light of all directions, float64 [3]."""
    if seen is None:
        return panorama.mean()
    weights = texel_weights()
    light = np.where(seen.is_seen[:, None], seen.radiance, panorama.cube(FINE).texels.reshape(-1, 3))
    return np.asarray(weights @ light / weights.sum())


def _placed(
    found: list[DistantLight], room: Environment | None, point: Floats, edge: float, seen: SeenLight | None
) -> list[RoomLight]:
    """Point lights for the lights of a panorama.

    In a room they are on the surface that the photo shows, or else where they leave the box of the room; the sun, and
    lights without a room, are far away.
    """
    lights = []
    for light in found:
        distance, falloff = _FAR * edge, None
        if room is not None and not light.is_far:
            distance = _distance(room, point, light.direction, seen)
            falloff = round(distance, 3)
        colour = light.colour * min(1.0, MAX_INTENSITY / light.colour.max())
        position = point + distance * light.direction
        radius = round(distance * np.tan(light.radius), 3)
        lights.append(RoomLight(position.round(3), colour.round(4), falloff, radius))
    return lights


def _distance(room: Environment, point: Floats, direction: Floats, seen: SeenLight | None) -> float:
    """Distance of a light in a direction, metres."""
    if seen is not None:
        texel = LightCube(np.zeros((6, FINE, FINE, 3))).texel_of(direction[None])[0]
        if seen.is_seen[texel]:
            return float(seen.distance[texel])
    low, high = light_box(room)
    with np.errstate(divide="ignore"):
        walls = np.where(direction > 0, high - point, point - low) / np.abs(direction)
    return float(walls.clip(min=0.3).min())
