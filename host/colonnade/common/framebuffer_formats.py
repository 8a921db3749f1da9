"""Framebuffers as the AXI4 shell writes them (docs/bus-shell.md), of the frame of any backend."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from colonnade.common.framebuffer import Frame
from colonnade.common.srgb import srgb_from_linear

#: Names by the code of ``framebuffer.format``, and bytes of a pixel.
FORMATS = ("xrgb8888", "rgb565", "linear16")
PIXEL_BYTES = (4, 2, 8)

_MAX = 4095


def framebuffer_bytes(frame: Frame, pixel_format: int) -> npt.NDArray[np.uint8]:
    """The lines of a frame: uint8 [height, width * bytes of a pixel]; ``pixel_format`` is a code of `FORMATS`."""
    height, width = frame.is_object.shape
    if pixel_format == FORMATS.index("linear16"):
        colour = frame.colour.astype(np.uint16)
        wide = (colour << 4) | (colour >> 8)
        alpha = np.where(frame.is_object, 0xFFFF, 0).astype(np.uint16)
        words = np.concatenate([wide, alpha[..., None]], axis=2).astype("<u2")
        return words.view(np.uint8).reshape(height, width * 8)
    codes = np.rint(srgb_from_linear(frame.colour / _MAX) * 255.0).astype(np.uint16)
    if pixel_format == FORMATS.index("rgb565"):
        packed = (codes[..., 0] >> 3 << 11) | (codes[..., 1] >> 2 << 5) | (codes[..., 2] >> 3)
        return np.ascontiguousarray(packed.astype("<u2")).view(np.uint8).reshape(height, width * 2)
    opaque = np.full((height, width, 1), 255, dtype=np.uint16)
    return np.concatenate([codes[..., ::-1], opaque], axis=2).astype(np.uint8).reshape(height, width * 4)
