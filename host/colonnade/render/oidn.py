"""Open Image Denoise as the filter of gathered light, guided by what pixels show (docs/gather.md, "Denoising")."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats
from colonnade.render.denoise import Guide


def filtered(colour: Floats, around: Floats, guide: Guide, albedo: Floats) -> Floats:
    """Filter the colours of the object's pixels.

    Args:
        colour: Linear, float64 [height, width, 3].
        around: What it sees outside the mask, linear, float64 [height, width, 3].
        guide: What the pixels show.
        albedo: float64 [height, width, 3].

    Returns:
        float64 [height, width, 3]; pixels outside the mask are unchanged.
    """
    import pyoidn

    if not guide.mask.any():
        return colour

    def seen(values: Floats, outside: Floats | float = 0.0) -> NDArray[np.float32]:
        return np.ascontiguousarray(np.where(guide.mask[..., None], values, outside), dtype=np.float32)

    found = pyoidn.denoise(seen(colour, around), albedo=seen(albedo), normal=seen(guide.normals), hdr=True)
    return np.where(guide.mask[..., None], np.maximum(found, 0.0), colour)
