"""Whether an albedo map holds linear reflectance or the curve of sRGB.

Files do not say. A photograph of the same view does: under smooth light its linear colours follow the linear albedo,
so over a patch with a pattern the slope of log photo over log albedo is 1 when the albedo was read rightly. Read as
sRGB, linear values give a slope of about 1/2.2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from colonnade.common.image_io import decode_srgb
from colonnade.common.srgb import linear_from_srgb

#: Edge of a patch, pixels, and how many patches with a pattern make a judgement.
_PATCH = 16
_LEAST_PATCHES = 24


def linear_albedo(samples: NDArray[np.float64], encoding: str) -> NDArray[np.float64]:
    """Linear albedo of samples 0.0 to 1.0 that are ``linear`` or ``srgb``."""
    return samples if encoding == "linear" else linear_from_srgb(samples)


def judged_encoding(samples: NDArray[np.float64], photo: NDArray[np.uint8] | None) -> tuple[str, str]:
    """``linear`` or ``srgb`` for an albedo map's samples, float64 [height, width, 3], and a note of why."""
    advice = "albedo_encoding in meta.json decides it"
    if photo is None:
        return "srgb", f"the albedo map was taken as sRGB; {advice}"
    slopes = _slopes(samples[..., 1], decode_srgb(photo[..., 1]))
    if slopes.size < _LEAST_PATCHES:
        return "srgb", f"the albedo map was taken as sRGB, the photo shows too few patterns to tell; {advice}"
    slope = float(np.median(slopes))
    encoding = "linear" if slope < 1.5 else "srgb"
    return (
        encoding,
        f"the albedo map was taken as {encoding}: over it the photo has an exponent of {slope:.2f}; {advice}",
    )


def _slopes(albedo: NDArray[np.float64], light: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of log photo over log sample, for each patch where the two go together; 1 for linear samples, 2.2 for sRGB."""
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
    together = xy > 0.9 * np.sqrt(xx * yy)
    slopes: NDArray[np.float64] = xy[together] / xx[together]
    return slopes
