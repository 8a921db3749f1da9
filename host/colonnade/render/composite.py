"""Compositing: the rendered object in the camera's photo of its room."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from colonnade.common.image_io import decode_srgb

if TYPE_CHECKING:
    from colonnade.environment.model import Environment


def composited(
    image: npt.NDArray[np.float64],
    is_object: npt.NDArray[np.bool_],
    ratio: npt.NDArray[np.float64] | None,
    environment: Environment,
) -> npt.NDArray[np.float64]:
    """The object over the room's photo, with its shadow (differential rendering, Debevec 1998).

    Args:
        image: The rendered frame, linear, float64 [height, width, 3].
        is_object: Pixels that show the object, bool [height, width].
        ratio: Shadow ratios, 0 to 1, float64 [height, width, 3]; None: the result is `image`.
        environment: The room. Without a photo the result is `image`.

    Returns:
        Linear colours, float64 [height, width, 3].
    """
    if environment.photo is None or ratio is None:
        return image
    height, width = is_object.shape
    photo = environment.photo
    if photo.shape[:2] != (height, width):
        from PIL import Image

        photo = np.asarray(Image.fromarray(photo).resize((width, height), Image.Resampling.BOX))
    return np.where(is_object[..., None], image, decode_srgb(photo) * ratio)
