"""Compositing: the rendered object in the camera's photo of its room."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from colonnade.common.accumulation import Accumulation
from colonnade.common.image_io import decode_srgb, resized_photo
from colonnade.common.types import Floats
from colonnade.render.camera_look import CameraLook

Photo = npt.NDArray[np.uint8]


def composited(
    sums: Accumulation,
    photo: Photo | None,
    strength: npt.NDArray[np.uint8] | None = None,
    look: CameraLook | None = None,
    frame: int = 0,
    sky: Floats | None = None,
) -> npt.NDArray[np.float64]:
    """The object over the photo of its view, with its shadow (differential rendering, Debevec 1998).

    Args:
        sums: The samples of the frame.
        photo: sRGB, uint8 [rows, columns, 3]. Without one the result is the frame's own picture.
        strength: Of the shadow, uint8 [rows, columns] (`colonnade.environment.shadow_strength`); None: it is whole.
        look: What the object gets of the photo's camera.
        frame: Number of the frame, from 0.
        sky: Without a photo, what is behind the object (`sky_of`); None: what the frame has there.

    Returns:
        Linear colours, float64 [height, width, 3].
    """
    if photo is None or sums.ratio is None:
        return sums.image() if sky is None else sums.before(sky)
    height, width = sums.coverage.shape
    part = None if strength is None else resized_photo(strength, width, height)
    background = decode_srgb(resized_photo(photo, width, height))
    if look is None:
        return sums.over(background, part)
    sums = look.blurred(sums)
    return look.grained(sums.over(background, part), sums.coverage / sums.samples, frame)
