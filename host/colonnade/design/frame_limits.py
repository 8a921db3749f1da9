"""Checks a frame size against the design's limits."""

from __future__ import annotations

from colonnade.common.arguments import checked
from colonnade.common.errors import UserError
from colonnade.common.frame_size import Size
from colonnade.design.manifest import Manifest


@checked
def check_size(size: Size, manifest: Manifest) -> None:
    """Refuse a frame larger than the design's maximum (`frame.maxWidth`, `frame.maxHeight`).

    Raises:
        UserError: The size is no pair of whole numbers, the frame is empty or too large, or the design has no frames.
    """
    if min(size) < 1:
        raise UserError(f"a frame of {size[0]}x{size[1]} has no pixels")
    if manifest.has_queries:
        raise UserError(
            "this hardware traces rays of applications and has no frames (queries): take another, such as edge"
        )
    limits = manifest.config["frame"]
    for length, key in zip(size, ("maxWidth", "maxHeight"), strict=True):
        if length > limits[key]:
            raise UserError(
                f"size {size[0]}x{size[1]} is too large: frame.{key} is {limits[key]}; "
                f"use a smaller --size or --set frame.{key}={length}"
            )
