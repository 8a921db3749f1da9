"""Frame sizes, and their form on the command line, such as ``640x480``."""

from __future__ import annotations

import re
from typing import Annotated

from colonnade.common.errors import UserError

#: Width and height, pixels.
Size = Annotated[tuple[int, int], "width and height, whole numbers of pixels"]


def parse_size(text: str) -> tuple[int, int]:
    """Parse ``WIDTHxHEIGHT`` in pixels, e.g. ``640x480``.

    Raises:
        UserError: The text has another form, or a side is 0.
    """
    match = re.fullmatch(r"(\d{1,9})[xX](\d{1,9})", text.strip(), re.ASCII)
    if not match:
        raise UserError(f"size {text} is not of the form WIDTHxHEIGHT, e.g. 640x480")
    width, height = int(match[1]), int(match[2])
    if width == 0 or height == 0:
        raise UserError(f"size {text} has no pixels: both numbers are at least 1, e.g. 640x480")
    return width, height
