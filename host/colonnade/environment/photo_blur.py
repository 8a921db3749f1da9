"""How blurred a photo is: the spread of its sharpest edges (docs/background.md, "The photo's camera").

The ratio of an edge's gradients after two known blurs gives its own (S. Zhuo and T. Sim, *Defocus map estimation from a
single image*, 2011).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from colonnade.common.types import Floats

#: Standard deviations of the two blurs, pixels.
_FINE, _COARSE = 0.8, 1.6
#: Least gradient of an edge after the fine blur, codes a pixel, and the share of it that may be left at distances.
_STRONG, _ALONE = 12.0, ((3, 0.5), (4, 0.3))
#: The percentile of all edges that counts as sharp, and the least number of edges.
_SHARP, _EDGES = 20, 100
#: Pixels at the border that are left out.
_BORDER = 8


def measured_blur(photo: NDArray[np.uint8]) -> float:
    """The standard deviation of a photo's blur, pixels; 0 if it has too few edges to tell.

    It is measured at the sharpest fifth of its edges, so that soft shadows and what is out of focus do not count.

    Args:
        photo: sRGB, uint8 [height, width, 3].
    """
    if min(photo.shape[:2]) <= 2 * _BORDER:
        return 0.0
    light = photo.mean(axis=2)
    across, down, fine = _gradient(light, _FINE)
    coarse = _gradient(light, _COARSE)[2]
    is_level = np.abs(across) >= np.abs(down)

    def beside(steps: int) -> Floats:
        """The larger of the gradients at so many pixels along the gradient's main axis, in both directions."""
        pairs = [np.maximum(np.roll(fine, steps, axis), np.roll(fine, -steps, axis)) for axis in (1, 0)]
        return np.asarray(np.where(is_level, *pairs))

    is_edge = (fine >= beside(1)) & (fine >= _STRONG)
    for steps, share in _ALONE:
        is_edge &= beside(steps) < share * fine
    inner = np.s_[_BORDER:-_BORDER, _BORDER:-_BORDER]
    squares = (fine[inner][is_edge[inner]] / coarse[inner][is_edge[inner]]) ** 2
    if len(squares) < _EDGES:
        return 0.0
    spread = (_COARSE**2 - squares * _FINE**2) / np.maximum(squares - 1, 1e-3)
    return float(np.sqrt(np.percentile(spread.clip(min=0.0), _SHARP)))


def _gradient(light: Floats, blur: float) -> tuple[Floats, Floats, Floats]:
    """Steps across and down of a blurred picture, and their length."""
    down, across = np.gradient(ndimage.gaussian_filter(light, blur, mode="nearest"))
    return across, down, np.hypot(across, down)
