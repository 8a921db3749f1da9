"""How much of a light's shadow a photo can still show: none where the room's own shadows are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from colonnade.common.accumulation import LUMINANCE, WHOLE
from colonnade.common.image_io import decode_srgb
from colonnade.environment.lights import RoomLights, irradiance, world_surface
from colonnade.environment.model import Environment

#: Channels of the photo tell the light from and up to these values.
_PHOTO_RANGE = (2, 253)
#: Reflected light below this does not tell the share of the lights.
_DARK = 1e-6
#: Edge of the median's window, pixels.
_MEDIAN = 5


def shadow_strength(room: Environment, lights: RoomLights) -> NDArray[np.uint8]:
    """The strength of the shadows of a room's pixels, uint8 [height, width]; `WHOLE` is the shadow ratio's own.

    photo = albedo · (ambient + s · light), in least squares of the three channels, gives the share s of the light that
    reaches a pixel, 0 to 1. An object in the way takes s · light, so 1 - ratio has the factor
    s · (ambient + light) / (ambient + s · light), in luminance. Saturated pixels have all the light. A median removes
    the photo's noise.

    Args:
        room: With a photo, and an albedo of its own.
        lights: Without shadows. They are scaled so that the photo's median pixel is as bright under them.
    """
    assert room.photo is not None
    photo, direct = decode_srgb(room.photo), irradiance(*world_surface(room), lights) - lights.ambient
    ambient = room.albedo * lights.ambient
    lit = room.albedo * direct
    whole = ambient + lit
    usable = (room.photo.min(axis=2) >= _PHOTO_RANGE[0]) & (room.photo.max(axis=2) <= _PHOTO_RANGE[1])
    usable &= whole.min(axis=2) > _DARK
    if not usable.any():
        return np.full(usable.shape, WHOLE, dtype=np.uint8)
    scale = np.median((photo * whole).sum(axis=2)[usable] / (whole**2).sum(axis=2)[usable])
    reached = ((photo - scale * ambient) * lit).sum(axis=2) / (scale * (lit**2).sum(axis=2)).clip(min=_DARK)
    share = np.where(room.photo.max(axis=2) > _PHOTO_RANGE[1], 1.0, reached)
    share = ndimage.median_filter(share, size=_MEDIAN, mode="nearest").clip(0.0, 1.0)
    base, light = float(lights.ambient @ LUMINANCE), direct @ LUMINANCE
    strength = share * (base + light) / (base + share * light).clip(min=_DARK)
    return np.asarray(np.rint(WHOLE * np.where(light > _DARK, strength, 1.0)), dtype=np.uint8)
