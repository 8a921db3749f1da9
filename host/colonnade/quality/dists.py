"""DISTS: how unlike two pictures look in structure and texture (Ding, Ma, Wang, Simoncelli 2020), in numpy.

Features are those of VGG-16 with its maxima replaced by L2 pooling, and the picture itself; of each channel the means
and the covariances of both pictures are compared, weighted by what the authors trained on human judgement.
"""

from __future__ import annotations

import sys

import numpy as np
from numpy.typing import NDArray

from colonnade.common.errors import UserError
from colonnade.quality.dists_weights import CHANNELS, Convolution, Weights, weights

Floats = NDArray[np.float32]

#: The shorter side that pictures are reduced to, pixels, as the authors advise; smaller pictures stay as they are.
SHORT_SIDE = 256

#: Convolutions of each stage; before every stage but the first the picture is halved.
_STAGES = (2, 2, 3, 3, 3)

#: What VGG-16 was trained with: mean and deviation of red, green and blue.
_MEAN = np.array([0.485, 0.456, 0.406], dtype=np.float32)
_DEVIATION = np.array([0.229, 0.224, 0.225], dtype=np.float32)

#: Keeps ratios of means and of covariances finite.
_LITTLE = 1e-6

_failed: list[str] = []


def dists_or_none(reference: NDArray[np.uint8], test: NDArray[np.uint8]) -> float | None:
    """`dists`, or None with one line on standard error where its weights cannot be had; asks for them only once."""
    if _failed:
        return None
    try:
        return dists(reference, test)
    except UserError as error:
        _failed.append(str(error))
        print(f"colonnade: {error}; DISTS is left out", file=sys.stderr)
        return None


def dists(reference: NDArray[np.uint8], test: NDArray[np.uint8], resize: bool = True) -> float:
    """DISTS of two pictures, uint8 [height, width, 3] sRGB each, of the same size: 0 for identical ones.

    Args:
        reference: Picture to compare against.
        test: Picture to judge.
        resize: Reduce both to `SHORT_SIDE` first.

    Raises:
        UserError: The weights are not on this machine and cannot be fetched.
    """
    learnt = weights()
    pictures = [_prepared(picture, resize) for picture in (reference, test)]
    total = float(learnt.alpha.sum() + learnt.beta.sum())
    bounds = np.cumsum((0, *CHANNELS))
    likeness = 0.0
    for stage, (x, y) in enumerate(zip(*(_features(picture, learnt) for picture in pictures), strict=True)):
        channels = slice(bounds[stage], bounds[stage + 1])
        texture, structure = _compared(x, y)
        likeness += float(learnt.alpha[channels] @ texture + learnt.beta[channels] @ structure) / total
    return max(0.0, 1.0 - likeness)


def _prepared(picture: NDArray[np.uint8], resize: bool) -> Floats:
    """A picture as float32 [h, w, 3], 0 to 1, its shorter side at most `SHORT_SIDE`."""
    from PIL import Image

    height, width = picture.shape[:2]
    short = min(height, width)
    if resize and short > SHORT_SIDE:
        size = (int(SHORT_SIDE * width / short), int(SHORT_SIDE * height / short))
        picture = np.asarray(Image.fromarray(picture).resize(size, Image.Resampling.BILINEAR))
    return picture.astype(np.float32) / np.float32(255)


def _features(picture: Floats, learnt: Weights) -> list[Floats]:
    """The picture and the five stages' outputs, float32 [h, w, channels] each."""
    features, x, first = [picture], (picture - _MEAN) / _DEVIATION, 0
    for stage, count in enumerate(_STAGES):
        if stage:
            x = _halved(x)
        for layer in learnt.convolutions[first : first + count]:
            x = _convolved(x, layer)
        first += count
        features.append(x)
    return features


def _convolved(x: Floats, layer: Convolution) -> Floats:
    """3×3 convolution with a border of zeros, and the positive part: float32 [h, w, out]."""
    height, width, channels = x.shape
    # Rows one after the other, two pixels of border between them: every tap is one plain product of matrices.
    stride = width + 2
    flat = np.zeros((stride * (height + 2) + 2, channels), dtype=np.float32)
    flat[: stride * (height + 2)].reshape(height + 2, stride, channels)[1:-1, 1:-1] = x
    out = np.tile(layer.bias, (stride * height, 1))
    for row in range(3):
        for column in range(3):
            start = row * stride + column
            out += flat[start : start + stride * height] @ layer.kernel[row, column]
    out = out.reshape(height, stride, -1)[:, :width]
    return np.maximum(out, 0)


def _halved(x: Floats) -> Floats:
    """L2 pooling: the root of the squares' mean under a 3×3 Hanning window, every second pixel."""
    window = np.array([0.25, 0.5, 0.25], dtype=np.float32)
    height, width = (x.shape[0] + 1) // 2, (x.shape[1] + 1) // 2
    squares = np.pad(x * x, ((1, 1), (1, 1), (0, 0)))
    rows = sum(window[i] * squares[i : i + 2 * height - 1 : 2] for i in range(3))
    both = sum(window[i] * rows[:, i : i + 2 * width - 1 : 2] for i in range(3))
    return np.asarray(np.sqrt(both + np.float32(1e-12)), dtype=np.float32)


def _compared(x: Floats, y: Floats) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Likeness of means and of structure for each channel, float64 [channels] each, 1 where equal."""
    flat_x, flat_y = (np.asarray(z, dtype=np.float64).reshape(-1, z.shape[2]) for z in (x, y))
    mean_x, mean_y = flat_x.mean(axis=0), flat_y.mean(axis=0)
    centred_x, centred_y = flat_x - mean_x, flat_y - mean_y
    variances = (centred_x**2).mean(axis=0) + (centred_y**2).mean(axis=0)
    covariance = (centred_x * centred_y).mean(axis=0)
    texture = (2 * mean_x * mean_y + _LITTLE) / (mean_x**2 + mean_y**2 + _LITTLE)
    return texture, (2 * covariance + _LITTLE) / (variances + _LITTLE)
