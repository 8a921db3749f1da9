"""A frame as the device delivers it, whichever backend rendered it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Frame:
    """Pixels, counters and errors of one frame.

    Attributes:
        colour: uint16 [height, width, 3], linear, 12 bits.
        is_object: bool [height, width].
        triangle: int64 [height, width]; packed id, -1 where there is no object.
        distance: float64 [height, width]; t from the camera along the ray's dominant axis, vertex units.
        counters: By the register map's names; the model has only those that do not depend on timing.
        ratio: uint16 [height, width, 3]; light left on the room with the object there, 4096 is all of it; None
            without a room.
        errors: Names of the sticky error bits that are set.
    """

    colour: npt.NDArray[np.uint16]
    is_object: npt.NDArray[np.bool_]
    triangle: npt.NDArray[np.int64]
    distance: npt.NDArray[np.float64]
    counters: dict[str, int]
    errors: list[str]
    ratio: npt.NDArray[np.uint16] | None = None
