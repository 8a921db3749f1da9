"""A rendered frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from colonnade.common.accumulation import Accumulation
from colonnade.common.hits import Hits
from colonnade.common.image_io import encode_srgb
from colonnade.mesh.materials.mesh import MeshPart
from colonnade.render.report import FrameReport


@dataclass(frozen=True, repr=False)
class RenderResult:
    """A rendered frame. Of several samples a pixel, mask, hits, depths and ratios are the first pass's.

    Attributes:
        image: Linear colours, 0 to 1, float64 [height, width, 3].
        object_mask: Pixels that show the object, bool [height, width].
        hit_triangles: Face index in the mesh's file, or through the files of `parts`, -1 for a miss, int64 [height,
            width].
        t: Depth in mesh units (lengths of the pixel's direction), NaN for a miss, float64 [height, width].
        report: The report of the frame.
        sums: Sums over the samples.
        ratio: Shadow ratios, uint16 [height, width, 3], see `Frame`; None without a room.
        parts: The objects of a scene with several; see `hits`.
    """

    image: npt.NDArray[np.float64]
    object_mask: npt.NDArray[np.bool_]
    hit_triangles: npt.NDArray[np.int64]
    t: npt.NDArray[np.float64]
    report: FrameReport
    sums: Accumulation
    ratio: npt.NDArray[np.uint16] | None = None
    parts: tuple[MeshPart, ...] = ()

    def __repr__(self) -> str:
        height, width, _ = self.image.shape
        return f"<RenderResult of {width}x{height} pixels by {self.report.backend}>"

    @property
    def pixels(self) -> npt.NDArray[np.uint8]:
        """The picture as a PNG file has it: sRGB, uint8 [height, width, 3]."""
        return encode_srgb(self.image)

    @property
    def counters(self) -> Mapping[str, int]:
        """Counters of the device, sums over the samples: all from the RTL, those without time from the model."""
        return self.report.counters

    def hits(self) -> Hits:
        """The hits by object, and by face of its mesh's file."""
        if not self.parts:
            return Hits(self.hit_triangles, self.t)
        starts = np.array([part.first_face for part in self.parts])
        number = np.searchsorted(starts, self.hit_triangles, side="right") - 1
        is_hit = self.hit_triangles >= 0
        face = np.where(is_hit, self.hit_triangles - starts[number], -1)
        return Hits(face, self.t, np.where(is_hit, number, -1))
