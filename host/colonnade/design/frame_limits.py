"""Checks a frame size against the design's limits."""

from __future__ import annotations

from colonnade.common.errors import UserError
from colonnade.common.frame_size import is_whole
from colonnade.design.manifest import Manifest


def check_size(size: tuple[int, int], manifest: Manifest) -> None:
    """Refuse a frame larger than the design's maximum (`frame.maxWidth`, `frame.maxHeight`).

    Raises:
        UserError: The size is no pair of whole numbers, or the frame is empty or too large.
    """
    if not (isinstance(size, list | tuple) and len(size) == 2 and all(map(is_whole, size))):
        raise UserError(f"size is {size!r}: it must be width and height, whole numbers of pixels")
    if min(size) < 1:
        raise UserError(f"a frame of {size[0]}x{size[1]} has no pixels")
    limits = manifest.config["frame"]
    for length, key in zip(size, ("maxWidth", "maxHeight"), strict=True):
        if length > limits[key]:
            raise UserError(
                f"size {size[0]}x{size[1]} is too large: frame.{key} is {limits[key]}; "
                f"use a smaller --size or --set frame.{key}={length}"
            )
