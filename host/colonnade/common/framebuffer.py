"""The frame of any backend, in the device's number formats."""

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
        triangle: int64 [height, width]; packed triangle id, -1 where the ray missed the object.
        instance: int64 [height, width]; number of the object where `scene.instances` are on, else 0; -1 for a miss.
        distance: float64 [height, width]; t from the camera along the ray's dominant axis, vertex units.
        counters: Values by register name; the model has only counters that do not depend on timing.
        ratio: uint16 [height, width, 3]; light on the room with the object over light without it, 4096 is 1.0; None
            without a room.
        errors: Names of the sticky error bits that are set.
    """

    colour: npt.NDArray[np.uint16]
    is_object: npt.NDArray[np.bool_]
    triangle: npt.NDArray[np.int64]
    instance: npt.NDArray[np.int64]
    distance: npt.NDArray[np.float64]
    counters: dict[str, int]
    errors: list[str]
    ratio: npt.NDArray[np.uint16] | None = None
