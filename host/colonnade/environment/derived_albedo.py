"""The albedo of a room that has only a photo: photo / irradiance, at most 1.

The irradiance is that of lights fitted to the photo, with an albedo of the photo's hues and one brightness. So the
albedo shows the photo again under these lights. Brightness that they do not explain, such as shadows, stays in it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from colonnade.common.image_io import decode_srgb
from colonnade.common.types import Floats
from colonnade.environment.fitted_lights import fitted_lights
from colonnade.environment.lights import RoomLights, irradiance, world_surface
from colonnade.environment.model import Environment

#: Mean albedo of the channels of each pixel while lights are fitted.
_BRIGHTNESS = 0.5
#: Irradiance below this does not tell the albedo.
_DARK = 1e-4


def derived_albedo(room: Environment, lights: RoomLights | None = None) -> Floats:
    """The albedo of a room with a photo; that of `room` is not used.

    Args:
        room: The room.
        lights: Those that were found in another view of it; None: `hue_lights`.

    Returns:
        Linear, 0 to 1, float64 [height, width, 3].
    """
    assert room.photo is not None
    light = irradiance(*world_surface(room), lights or hue_lights(room))
    colours = decode_srgb(room.photo) / light.clip(min=_DARK)
    return np.asarray(np.where(light > _DARK, colours, _hues(room)).clip(max=1.0))


def hue_lights(room: Environment) -> RoomLights:
    """The lights that are fitted to a room's photo with an albedo of the photo's hues."""
    return fitted_lights(replace(room, albedo=_hues(room))).lights


def _hues(room: Environment) -> Floats:
    assert room.photo is not None
    photo = decode_srgb(room.photo)
    hues = (photo * (3.0 * _BRIGHTNESS / photo.sum(axis=2, keepdims=True).clip(min=1e-6))).clip(max=1.0)
    hues[photo.sum(axis=2) == 0] = _BRIGHTNESS
    return np.asarray(hues)
