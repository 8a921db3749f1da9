"""Compositing: the rendered object in the camera's photo of its room."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from colonnade.common.framebuffer import Frame
from colonnade.common.image_io import decode_srgb

if TYPE_CHECKING:
    from colonnade.environment.model import Environment


def composited(image: npt.NDArray[np.float64], frame: Frame, environment: Environment) -> npt.NDArray[np.float64]:
    """The object over the room's photo, with its shadow (differential rendering, Debevec 1998).

    Args:
        image: The rendered frame, linear, float64 [height, width, 3].
        frame: Object mask and shadow ratios of the same frame.
        environment: The room. Without a photo the result is `image`.

    Returns:
        Linear colours, float64 [height, width, 3].
    """
    if environment.photo is None or frame.ratio is None:
        return image
    height, width = frame.is_object.shape
    photo = environment.photo
    if photo.shape[:2] != (height, width):
        from PIL import Image

        photo = np.asarray(Image.fromarray(photo).resize((width, height), Image.Resampling.BOX))
    behind = decode_srgb(photo) * (frame.ratio / 4096.0)
    return np.where(frame.is_object[..., None], image, behind)
