"""Random numbers that look for trouble."""

from __future__ import annotations

import numpy as np


def random_value(random: np.random.Generator, minimum: int, greatest: int) -> int:
    """From `least` to `greatest`: anything, something small, a power of two, or next to an end."""
    way = random.random()
    if way < 0.3:
        return min(max(int(random.integers(-3, 4)), minimum), greatest)
    if way < 0.5:
        return greatest - int(random.integers(min(3, greatest - minimum + 1)))
    if way < 0.6:
        return minimum + int(random.integers(min(3, greatest - minimum + 1)))
    if way < 0.8:
        power = 1 << int(random.integers(max(greatest.bit_length(), 1)))
        return max(-power if minimum < 0 and random.random() < 0.5 else power, minimum)
    return minimum + int.from_bytes(random.bytes(16), "little") % (greatest - minimum + 1)
