"""Framebuffers and photos in the memory of the AXI4 shell (docs/bus-shell.md)."""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt

from colonnade.common.accumulation import PHOTO_WHITE, UNSHADOWED, WHITE, WHOLE, shadowed_photo, weakened
from colonnade.common.framebuffer import Frame
from colonnade.common.srgb import linear_from_srgb, srgb_from_linear

#: Names by the code of ``framebuffer.format``, and bytes of a pixel.
FORMATS = ("xrgb8888", "rgb565", "linear16")
PIXEL_BYTES = (4, 2, 8)


@cache
def _codes(white: int) -> npt.NDArray[np.uint16]:
    """The 8-bit sRGB code of each linear value from 0 to `white`, uint16 [white + 1]."""
    return np.rint(srgb_from_linear(np.arange(white + 1) / white) * 255.0).astype(np.uint16)


@cache
def _linear() -> npt.NDArray[np.float64]:
    """The linear value of each 8-bit sRGB code, float64 [256]."""
    return linear_from_srgb(np.arange(256) / 255.0)


def framebuffer_bytes(
    frame: Frame, pixel_format: int, photo: npt.NDArray[np.uint8] | None = None
) -> npt.NDArray[np.uint8]:
    """The lines of a frame in memory, of any backend.

    Args:
        frame: The frame; with a photo, it has shadow ratios.
        pixel_format: A code of `FORMATS`.
        photo: The camera's photo, sRGB, uint8 [height, width, 3], or [height, width, 4] with the strength of the
            object's shadow; None without compositing.

    Returns:
        uint8 [height, width * bytes of a pixel].
    """
    height, width = frame.is_object.shape
    wide = (frame.colour.astype(np.int64) << 4) | (frame.colour.astype(np.int64) >> 8)
    codes = _codes(WHITE)[frame.colour]
    if photo is not None:
        assert frame.ratio is not None
        shows = ~frame.is_object[..., None]
        ratio = frame.ratio if photo.shape[2] == 3 else weakened(frame.ratio, photo[..., 3], UNSHADOWED)
        shadowed = np.minimum(shadowed_photo(_linear()[photo[..., :3]], ratio), PHOTO_WHITE).astype(np.int64)
        wide = np.where(shows, shadowed, wide)
        codes = np.where(shows, _codes(PHOTO_WHITE)[shadowed], codes)
    if pixel_format == FORMATS.index("linear16"):
        alpha = np.where(frame.is_object, 0xFFFF, 0).astype(np.uint16)
        words = np.concatenate([wide.astype(np.uint16), alpha[..., None]], axis=2).astype("<u2")
        return words.view(np.uint8).reshape(height, width * 8)
    if pixel_format == FORMATS.index("rgb565"):
        packed = (codes[..., 0] >> 3 << 11) | (codes[..., 1] >> 2 << 5) | (codes[..., 2] >> 3)
        return np.ascontiguousarray(packed.astype("<u2")).view(np.uint8).reshape(height, width * 2)
    opaque = np.full((height, width, 1), 255, dtype=np.uint16)
    return np.concatenate([codes[..., ::-1], opaque], axis=2).astype(np.uint8).reshape(height, width * 4)


def photo_lines(photo: npt.NDArray[np.uint8], tile: int) -> npt.NDArray[np.uint8]:
    """The lines of a photo in memory, XRGB8888.

    Args:
        photo: As in `framebuffer_bytes`; without strengths, shadows are whole.
        tile: Edge of a tile, pixels.

    Returns:
        uint8 [height, stride], lines of whole tile rows.
    """
    height, width, channels = photo.shape
    lines = np.full((height, -(-width // tile) * tile, 4), WHOLE, np.uint8)
    lines[:, :width, :3] = photo[..., 2::-1]
    if channels == 4:
        lines[:, :width, 3] = photo[..., 3]
    return lines.reshape(height, -1)
