"""Metrics of two pictures (PSNR, SSIM, FLIP) and of two frames' hits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

#: Upper limit of PSNR, decibels: the finite value for identical pictures.
MAX_PSNR = 100.0

#: Edge of SSIM's Gaussian window in pixels (sigma 1.5), as published.
SSIM_WINDOW = 11


@dataclass(frozen=True)
class PictureDifference:
    """The difference of two 8-bit sRGB pictures of one size.

    Attributes:
        identical: all pixels are equal.
        differing_pixels: pixels in which any channel differs.
        psnr: peak signal-to-noise ratio over all channels, decibels, at most `MAX_PSNR`.
        ssim: mean structural similarity, 1.0 for identical pictures; None for a picture of fewer than 3 pixels a side.
        flip: mean FLIP error, 0.0 for identical pictures, at 67 pixels per degree.
    """

    identical: bool
    differing_pixels: int
    psnr: float
    ssim: float | None
    flip: float


@dataclass(frozen=True)
class HitDifference:
    """The difference of two frames' hits.

    Attributes:
        hit_disagreement: fraction of all pixels that hit in one frame and miss in the other.
        triangle_disagreement: fraction of the pixels hit in both frames whose triangles differ; 0.0 if there are none.
    """

    hit_disagreement: float
    triangle_disagreement: float


def compare_pictures(reference: NDArray[np.uint8], test: NDArray[np.uint8]) -> PictureDifference:
    """Compare two pictures, uint8 [height, width, 3] sRGB each, of the same size."""
    import numpy as np

    differing = int(np.count_nonzero((reference != test).any(axis=2)))
    return PictureDifference(
        identical=differing == 0,
        differing_pixels=differing,
        psnr=psnr(reference, test),
        ssim=ssim(reference, test),
        flip=flip(reference, test),
    )


def psnr(reference: NDArray[np.uint8], test: NDArray[np.uint8]) -> float:
    """Peak signal-to-noise ratio of two 8-bit pictures, decibels, at most `MAX_PSNR`."""
    import numpy as np

    error = float(np.mean((reference.astype(np.float64) - test) ** 2))
    return MAX_PSNR if error == 0 else min(MAX_PSNR, float(10 * np.log10(255**2 / error)))


def ssim(reference: NDArray[np.uint8], test: NDArray[np.uint8]) -> float | None:
    """Mean structural similarity over the colour channels (Wang et al. 2004), by scikit-image.

    Pictures smaller than `SSIM_WINDOW` use a uniform window; None for fewer than 3 pixels a side.
    """
    from skimage.metrics import structural_similarity

    side = min(reference.shape[:2])
    if side < 3:
        return None
    if side >= SSIM_WINDOW:
        window = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False}
    else:
        window = {"win_size": side if side % 2 else side - 1}
    return float(structural_similarity(reference, test, channel_axis=2, data_range=255, **window))


def flip(reference: NDArray[np.uint8], test: NDArray[np.uint8]) -> float:
    """Mean FLIP error (Andersson et al. 2020) of two sRGB pictures, at the default 67 pixels per degree."""
    return float(flip_map(reference, test).mean(dtype="float64"))


def flip_map(reference: NDArray[np.uint8], test: NDArray[np.uint8]) -> NDArray[np.float32]:
    """FLIP error of each pixel, float32 [height, width], 0 to 1."""
    import flip_evaluator
    import numpy as np

    pictures = [picture.astype(np.float32) / np.float32(255.0) for picture in (reference, test)]
    errors, _, _ = flip_evaluator.evaluate(*pictures, "LDR", inputsRGB=True, applyMagma=False)
    return np.asarray(errors, dtype=np.float32).reshape(reference.shape[:2])


def compare_hits(reference: NDArray[np.int64], test: NDArray[np.int64]) -> HitDifference:
    """Compare two frames' hit triangles, int64 [height, width] each, -1 where the ray missed."""
    import numpy as np

    hits = reference >= 0, test >= 0
    hit_in_both = hits[0] & hits[1]
    common = int(np.count_nonzero(hit_in_both))
    other = int(np.count_nonzero(hit_in_both & (reference != test)))
    return HitDifference(
        hit_disagreement=float(np.mean(hits[0] != hits[1])),
        triangle_disagreement=other / common if common else 0.0,
    )
