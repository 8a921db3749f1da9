"""A rendered frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from colonnade.render.report import FrameReport


@dataclass(frozen=True)
class RenderResult:
    """A rendered frame.

    Attributes:
        image: float64 [height, width, 3], linear, 0 to 1.
        object_mask: bool [height, width].
        hit_triangles: int64 [height, width]; face index in the mesh's file, -1 where the ray missed.
        t: float64 [height, width]; depth in mesh units (lengths of the pixel's direction), not a number for a miss.
        report: What it took.
        ratio: uint16 [height, width, 3], see `Frame`; None without a room.
    """

    image: npt.NDArray[np.float64]
    object_mask: npt.NDArray[np.bool_]
    hit_triangles: npt.NDArray[np.int64]
    t: npt.NDArray[np.float64]
    report: FrameReport
    ratio: npt.NDArray[np.uint16] | None = None
