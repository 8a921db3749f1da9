"""A frame of the RTL is that of the bit-exact model."""

from __future__ import annotations

import numpy as np

from colonnade.common.framebuffer import Frame


def assert_equal(rtl: Frame, model: Frame) -> None:
    """Neither has errors; pixels, hits and the counters that do not depend on timing are the same."""
    assert rtl.errors == model.errors == []
    np.testing.assert_array_equal(rtl.colour, model.colour)
    np.testing.assert_array_equal(rtl.triangle, model.triangle)
    np.testing.assert_array_equal(rtl.distance, model.distance)
    assert {name: rtl.counters[name] for name in model.counters} == model.counters
