"""A rendered frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from colonnade.common.accumulation import Accumulation
from colonnade.render.report import FrameReport


@dataclass(frozen=True)
class RenderResult:
    """A rendered frame. Of several samples a pixel, mask, hits, depths and ratios are those of the first pass.

    Attributes:
        image: Linear colours, 0 to 1, float64 [height, width, 3].
        object_mask: Pixels that show the object, bool [height, width].
        hit_triangles: Face index in the mesh's file, -1 for a miss, int64 [height, width].
        t: Depth in mesh units (lengths of the pixel's direction), NaN for a miss, float64 [height, width].
        report: The report of the frame.
        sums: Sums over the samples.
        ratio: Shadow ratios, uint16 [height, width, 3], see `Frame`; None without a room.
    """

    image: npt.NDArray[np.float64]
    object_mask: npt.NDArray[np.bool_]
    hit_triangles: npt.NDArray[np.int64]
    t: npt.NDArray[np.float64]
    report: FrameReport
    sums: Accumulation
    ratio: npt.NDArray[np.uint16] | None = None
