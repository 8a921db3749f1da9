"""The distance from a surface at which shadow rays and bounces start (docs/numbers.md, "Off the surface")."""

from __future__ import annotations

import math
from collections.abc import Mapping

#: The stored normal, 2047 long with components rounded to whole numbers, is at least this long along the exact one.
_NORMAL_LENGTH = 1 - 2.0**-10


def distance_error(numbers: Mapping[str, int], largest_triangle: int) -> float:
    """Bound of the error of a hit's t, grid steps.

    Args:
        numbers: The manifest's number formats.
        largest_triangle: Greatest extent of a triangle along an axis, vertex units.
    """
    weights = 4 / (2.0 ** numbers["weightBits"] - 6)
    quotient = 2.0 ** (1 - numbers["mantissaBits"]) + 2.0 ** (1 - numbers["distanceDigits"])
    return 1 + math.ldexp(largest_triangle, numbers["gridFraction"]) * (weights + quotient)


def surface_offset(numbers: Mapping[str, int], largest_triangle: int) -> int:
    """The least `shading.offset` with which no ray hits the plane that it leaves, grid steps; arguments as above."""
    unit = 2.0 ** numbers["gridFraction"]
    rounded_vertices = math.sqrt(3) / 2 * (unit + (1 if numbers["gridFraction"] < 0 else 0))
    hit = math.sqrt(3) * distance_error(numbers, largest_triangle) + math.sqrt(2)
    rounded_offset = math.sqrt(3) / 2
    return math.ceil((2 * rounded_vertices + 2 * hit + rounded_offset) / _NORMAL_LENGTH)
