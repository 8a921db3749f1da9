"""Compositing: the rendered object in the camera's photo of its room."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from colonnade.common.accumulation import Accumulation
from colonnade.common.image_io import decode_srgb

if TYPE_CHECKING:
    from colonnade.environment.model import Environment


def composited(sums: Accumulation, environment: Environment) -> npt.NDArray[np.float64]:
    """The object over the room's photo, with its shadow (differential rendering, Debevec 1998).

    Args:
        sums: The samples of the frame.
        environment: The room. Without a photo the result is the frame's own picture.

    Returns:
        Linear colours, float64 [height, width, 3].
    """
    if environment.photo is None or sums.ratio is None:
        return sums.image()
    height, width = sums.coverage.shape
    return sums.over(decode_srgb(resized_photo(environment, width, height)))


def resized_photo(environment: Environment, width: int, height: int) -> npt.NDArray[np.uint8]:
    """The room's photo in the size of a frame: sRGB, uint8 [height, width, 3]."""
    assert environment.photo is not None
    if environment.photo.shape[:2] == (height, width):
        return environment.photo
    from PIL import Image

    return np.asarray(Image.fromarray(environment.photo).resize((width, height), Image.Resampling.BOX))
