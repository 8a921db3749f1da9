"""The albedo of a room that has only a photo: photo / irradiance, at most 1.

The irradiance is from lights fitted to the photo, with an albedo of one brightness. Its hues are the photo's,
divided by the hue of the light, which is taken from the photo's mean colour around a pixel (grey world). So the albedo
shows the photo again under these lights. Brightness that they do not explain, such as shadows, stays in it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from colonnade.common import fixed_order
from colonnade.common.image_io import decode_srgb
from colonnade.common.types import Floats
from colonnade.environment.fitted_lights import fitted_lights
from colonnade.environment.lights import RoomLights, irradiance, world_surface
from colonnade.environment.model import Environment

#: Mean albedo of the channels of each pixel while lights are fitted.
_BRIGHTNESS = 0.45
#: Share of the photo's mean hue that is the light's, as an exponent; what is left is the things'.
_OF_LIGHT = 0.6
#: Reach of the mean, in picture widths, and places along an edge at which it is taken.
_REACH, _STEPS = 0.4, 9
#: Channels of the photo tell its hue from and up to these values.
_PHOTO_RANGE = (2, 250)
#: Irradiance below this does not tell the albedo.
_DARK = 1e-4


def derived_albedo(room: Environment, lights: RoomLights | None = None) -> Floats:
    """The albedo of a room with a photo; `room`'s own is not used.

    Args:
        room: The room.
        lights: Lights that were found in another view of it; None: `hue_lights`.

    Returns:
        Linear, 0 to 1, float64 [height, width, 3].
    """
    assert room.photo is not None
    light = irradiance(*world_surface(room), lights or hue_lights(room))
    colours = decode_srgb(room.photo) / light.clip(min=_DARK)
    if (light <= _DARK).any():
        colours = np.where(light > _DARK, colours, _hues(room))
    return np.asarray(colours.clip(max=1.0))


def hue_lights(room: Environment) -> RoomLights:
    """The lights that are fitted to a room's photo with an albedo of the photo's hues."""
    return fitted_lights(replace(room, albedo=_hues(room))).lights


def _hues(room: Environment) -> Floats:
    assert room.photo is not None
    photo = decode_srgb(room.photo)
    colours = photo / fixed_order.power(_light_hue(room.photo), _OF_LIGHT)
    hues = (colours * (3.0 * _BRIGHTNESS / colours.sum(axis=2, keepdims=True).clip(min=1e-6))).clip(max=1.0)
    hues[photo.sum(axis=2) == 0] = _BRIGHTNESS
    return np.asarray(hues)


def _light_hue(photo: NDArray[np.uint8]) -> Floats:
    """The mean colour around each pixel, of pixels that are neither black nor saturated; the mean of a colour is 1."""
    light, height, width = decode_srgb(photo), *photo.shape[:2]
    is_known = (photo.max(axis=2) <= _PHOTO_RANGE[1]) & (photo.min(axis=2) >= _PHOTO_RANGE[0])
    # A little of grey, for a photo that tells nothing
    values = np.where(is_known[..., None], light, 0.0) + 1e-6
    for axis, count in enumerate((height, width)):
        places = np.arange(_STEPS)[:, None] * ((count - 1) / (_STEPS - 1))
        weights = fixed_order.exp(-(((places - np.arange(count)) / (_REACH * width)) ** 2) / 2)
        values = np.moveaxis(
            fixed_order.product(weights, np.moveaxis(values, axis, 0).reshape(count, -1)).reshape(
                _STEPS, *np.delete(values.shape, axis)
            ),
            0,
            axis,
        )
    for axis, count in enumerate((height, width)):
        at = np.arange(count) * ((_STEPS - 1) / (count - 1))
        low = at.astype(np.intp).clip(max=_STEPS - 2)
        part = np.expand_dims(at - low, (1 - axis, 2))
        values = (1 - part) * values.take(low, axis) + part * values.take(low + 1, axis)
    return np.asarray(3.0 * values / values.sum(axis=2, keepdims=True))
