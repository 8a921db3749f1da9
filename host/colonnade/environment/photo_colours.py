"""Colours with which a room, relit without shadows, shows its photo.

The device shades whatever a reflected ray hits: colour = albedo * irradiance. With albedo = photo / irradiance a mirror
shows what the camera saw, and an object still takes light away from it. Albedos are at most 1, so lights are scaled up
by a headroom, and the object's own diffuse albedo down by the same.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from colonnade.common.image_io import decode_srgb
from colonnade.environment.lights import RoomLights, irradiance, world_surface
from colonnade.environment.model import Environment

#: Share of the pixels that the headroom may leave too dark.
MAX_CLAMPED = 0.005
#: Largest headroom: an albedo keeps 10 of its 12 bits. Largest intensity of the hardware's lights.
MAX_HEADROOM = 4.0
MAX_INTENSITY = 15.0
#: Irradiance below this cannot show a photo; the colour there is the albedo.
_DARK = 1e-4


@dataclass(frozen=True)
class PhotoColours:
    """A room whose albedo reproduces its photo.

    Attributes:
        environment: With the photo's colours in place of the albedo.
        headroom: Factor of all lights, at least 1.
        clamped: Share of the pixels that stay darker than the photo.
    """

    environment: Environment
    headroom: float
    clamped: float


def photo_colours(environment: Environment, lights: RoomLights, headroom: float | None = None) -> PhotoColours:
    """The colours of a room with a photo, under the lights of a scene, unshadowed.

    Args:
        environment: The room.
        lights: Of the scene.
        headroom: Of another view of the room; None: of this one.
    """
    assert environment.photo is not None
    light = irradiance(*world_surface(environment), lights)
    colours = np.where(light > _DARK, decode_srgb(environment.photo) / light.clip(min=_DARK), environment.albedo)
    brightest = colours.max(axis=2)
    if headroom is None:
        headroom = float(np.clip(np.quantile(brightest, 1 - MAX_CLAMPED), 1.0, _max_headroom(lights)))
    clamped = float(((brightest > headroom * 1.0001) | (light <= _DARK).any(axis=2)).mean())
    return PhotoColours(replace(environment, albedo=(colours / headroom).clip(max=1.0)), headroom, clamped)


def _max_headroom(lights: RoomLights) -> float:
    brightest = max(float(np.max(colour)) for colour in (lights.ambient, *(light.colour for light in lights.lights)))
    return max(1.0, min(MAX_HEADROOM, MAX_INTENSITY / max(brightest, 1e-9)))
