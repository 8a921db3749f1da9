"""Sizes of frames: how they are written, and what a design can render."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from colonnade.errors import UserError

if TYPE_CHECKING:
    from colonnade.manifest import Manifest


def parse_size(text: str) -> tuple[int, int]:
    """Read ``WIDTHxHEIGHT`` in pixels, e.g. ``640x480``."""
    match = re.fullmatch(r"(\d{1,9})[xX](\d{1,9})", text.strip(), re.ASCII)
    if not match:
        raise UserError(f"size {text} is not of the form WIDTHxHEIGHT, e.g. 640x480")
    width, height = int(match[1]), int(match[2])
    if width == 0 or height == 0:
        raise UserError(f"size {text} holds no pixel: both numbers are at least 1, e.g. 640x480")
    return width, height


def check_size(size: tuple[int, int], manifest: Manifest) -> None:
    """Refuse a frame larger than the design holds (`frame.maxWidth`, `frame.maxHeight`)."""
    limits = manifest.config["frame"]
    for length, key in zip(size, ("maxWidth", "maxHeight"), strict=True):
        if length > limits[key]:
            raise UserError(
                f"size {size[0]}x{size[1]} is too large: frame.{key} is {limits[key]}; "
                f"use a smaller --size or --set frame.{key}={length}"
            )
