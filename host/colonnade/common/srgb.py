"""The sRGB transfer function (IEC 61966-2-1) on values from 0.0 to 1.0."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def srgb_from_linear(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """Encode linear values (any shape, clipped to 0.0 to 1.0)."""
    import numpy as np

    from colonnade.common import fixed_order

    value = np.clip(linear, 0.0, 1.0)
    return np.where(value <= 0.0031308, 12.92 * value, 1.055 * fixed_order.power(value, 1 / 2.4) - 0.055)


def linear_from_srgb(encoded: NDArray[np.float64]) -> NDArray[np.float64]:
    """Decode sRGB values (any shape, 0.0 to 1.0) to linear ones."""
    import numpy as np

    from colonnade.common import fixed_order

    return np.where(encoded <= 0.04045, encoded / 12.92, fixed_order.power((encoded + 0.055) / 1.055, 2.4))
