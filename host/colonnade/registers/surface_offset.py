"""The distance from a surface at which shadow rays and bounces start (docs/numbers.md, "Off the surface")."""

from __future__ import annotations

from collections.abc import Mapping


def surface_offset(numbers: Mapping[str, int], largest_triangle: int) -> int:
    """The least `shading.offset` with which no ray hits the plane that it leaves, grid steps.

    Args:
        numbers: The manifest's number formats.
        largest_triangle: Greatest extent of a triangle along an axis, vertex units.
    """
    from colonnade import _core

    names = ("gridFraction", "weightBits", "mantissaBits", "distanceDigits")
    offset: int = _core.surface_offset(*(numbers[name] for name in names), largest_triangle)
    return offset
