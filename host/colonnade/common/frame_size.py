"""Parses frame sizes such as ``640x480``."""

from __future__ import annotations

import re
from numbers import Integral
from typing import Any

from colonnade.common.errors import UserError


def is_whole(value: Any) -> bool:
    """Whether a value is a whole number, of Python or numpy."""
    return isinstance(value, Integral) and not isinstance(value, bool)


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
