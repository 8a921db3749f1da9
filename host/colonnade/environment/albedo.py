"""Detects whether an albedo map is linear or sRGB-encoded.

Image files do not state it, but a photo of the same view shows it. Under smooth light the photo's linear colours are
proportional to the linear albedo. Over a textured patch, log photo against log sample therefore has a slope of 1 for
linear samples, and of about 2.2 for sRGB samples.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from colonnade.common.image_io import decode_srgb
from colonnade.common.srgb import linear_from_srgb

#: Edge of a patch, pixels, and the smallest number of textured patches for a decision.
_PATCH = 16
_LEAST_PATCHES = 24


def linear_albedo(samples: NDArray[np.float64], encoding: str) -> NDArray[np.float64]:
    """Convert albedo samples, 0.0 to 1.0, in the encoding ``linear`` or ``srgb``, to linear albedo."""
    return samples if encoding == "linear" else linear_from_srgb(samples)


def detect_encoding(samples: NDArray[np.float64], photo: NDArray[np.uint8] | None) -> tuple[str, str]:
    """Detect the encoding of albedo samples, float64 [height, width, 3].

    Returns:
        ``linear`` or ``srgb``, and a note for the user.
    """
    advice = "set albedo_encoding in meta.json to override"
    if photo is None:
        return "srgb", f"the albedo map was taken as sRGB; {advice}"
    slopes = _slopes(samples[..., 1], decode_srgb(photo[..., 1]))
    if slopes.size < _LEAST_PATCHES:
        return "srgb", f"the albedo map was taken as sRGB, because the photo has too little texture to decide; {advice}"
    slope = float(np.median(slopes))
    encoding = "linear" if slope < 1.5 else "srgb"
    return (
        encoding,
        f"the albedo map was taken as {encoding}: the photo follows it with an exponent of {slope:.2f}; {advice}",
    )


def _slopes(albedo: NDArray[np.float64], light: NDArray[np.float64]) -> NDArray[np.float64]:
    """Slope of log photo over log sample for each patch where they correlate: 1 for linear samples, 2.2 for sRGB."""
    rows, columns = albedo.shape[0] // _PATCH, albedo.shape[1] // _PATCH
    if rows == 0 or columns == 0:
        return np.empty(0)

    def patches(values: NDArray[np.float64]) -> NDArray[np.float64]:
        cut = values[: rows * _PATCH, : columns * _PATCH].reshape(rows, _PATCH, columns, _PATCH)
        return cut.transpose(0, 2, 1, 3).reshape(rows * columns, _PATCH * _PATCH)

    a, p = patches(albedo), patches(light)
    usable = (a.std(axis=1) > 0.06) & (a.min(axis=1) > 0.1) & (p.min(axis=1) > 0.005) & (p.max(axis=1) < 0.99)
    x, y = np.log(a[usable]), np.log(p[usable])
    x -= x.mean(axis=1, keepdims=True)
    y -= y.mean(axis=1, keepdims=True)
    xy, xx, yy = (x * y).sum(axis=1), (x * x).sum(axis=1), (y * y).sum(axis=1)
    correlated = xy > 0.9 * np.sqrt(xx * yy)
    slopes: NDArray[np.float64] = xy[correlated] / xx[correlated]
    return slopes
