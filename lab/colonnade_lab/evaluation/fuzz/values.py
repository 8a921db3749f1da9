"""Random values with many corner cases."""

from __future__ import annotations

import numpy as np


def random_value(random: np.random.Generator, minimum: int, maximum: int) -> int:
    """A value from `minimum` to `maximum`: near zero, near an end, a power of two, or uniform."""
    kind = random.random()
    if kind < 0.3:
        return min(max(int(random.integers(-3, 4)), minimum), maximum)
    if kind < 0.5:
        return maximum - int(random.integers(min(3, maximum - minimum + 1)))
    if kind < 0.6:
        return minimum + int(random.integers(min(3, maximum - minimum + 1)))
    if kind < 0.8:
        power = 1 << int(random.integers(max(maximum.bit_length(), 1)))
        return max(-power if minimum < 0 and random.random() < 0.5 else power, minimum)
    return minimum + int.from_bytes(random.bytes(16), "little") % (maximum - minimum + 1)
