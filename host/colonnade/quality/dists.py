"""DISTS, a perceptual distance of structure and texture (Ding, Ma, Wang, Simoncelli 2020), in numpy.

The features are the picture itself and the stages of VGG-16, with L2 pooling instead of maximum pooling. For each
channel, the metric compares the means and the covariance of both pictures, with the authors' trained weights.

This is our own code because the published packages run on PyTorch, a large dependency for one metric. The forward pass
takes a few matrix products; it reproduces the published value of the authors' demo pair.
"""

from __future__ import annotations

import sys

import numpy as np
from numpy.typing import NDArray

from colonnade.common.errors import UserError
from colonnade.quality.dists_weights import CHANNELS, Convolution, Weights, weights

Floats = NDArray[np.float32]

#: Pictures are reduced to this shorter side, pixels, as the authors advise; smaller pictures keep their size.
SHORT_SIDE = 256

#: Convolutions of each stage; the features are halved before every stage but the first.
_STAGES = (2, 2, 3, 3, 3)

#: Mean and standard deviation of red, green and blue in VGG-16's training data.
_MEAN = np.array([0.485, 0.456, 0.406], dtype=np.float32)
_DEVIATION = np.array([0.229, 0.224, 0.225], dtype=np.float32)

#: Added to both parts of a ratio, so that it is finite.
_EPSILON = 1e-6

_failed: list[str] = []


def dists_or_none(reference: NDArray[np.uint8], test: NDArray[np.uint8]) -> float | None:
    """`dists`, or None if its weights are not available; the first failure prints a note and ends further attempts."""
    if _failed:
        return None
    try:
        return dists(reference, test)
    except UserError as error:
        _failed.append(str(error))
        print(f"colonnade: {error}; DISTS is left out", file=sys.stderr)
        return None


def dists(reference: NDArray[np.uint8], test: NDArray[np.uint8], resize: bool = True) -> float:
    """DISTS of two pictures of one size, uint8 [height, width, 3] sRGB: 0.0 for identical ones.

    Args:
        reference: Reference picture.
        test: Picture under test.
        resize: Reduce both to `SHORT_SIDE` first.

    Raises:
        UserError: The weights are not cached and cannot be downloaded.
    """
    learnt = weights()
    pictures = [_prepared(picture, resize) for picture in (reference, test)]
    total = float(learnt.alpha.sum() + learnt.beta.sum())
    bounds = np.cumsum((0, *CHANNELS))
    similarity = 0.0
    for stage, (x, y) in enumerate(zip(*(_features(picture, learnt) for picture in pictures), strict=True)):
        channels = slice(bounds[stage], bounds[stage + 1])
        texture, structure = _compared(x, y)
        similarity += float(learnt.alpha[channels] @ texture + learnt.beta[channels] @ structure) / total
    return max(0.0, 1.0 - similarity)


def _prepared(picture: NDArray[np.uint8], resize: bool) -> Floats:
    """Convert a picture to float32 [h, w, 3], 0 to 1, its shorter side at most `SHORT_SIDE`."""
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
    """3×3 convolution with zero padding, and ReLU: float32 [h, w, out]."""
    height, width, channels = x.shape
    # Flatten the rows with two padding pixels between them, so that each tap is one matrix product
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
    """L2 pooling with stride 2: root of the squares weighted by a 3×3 Hann window."""
    window = np.array([0.25, 0.5, 0.25], dtype=np.float32)
    height, width = (x.shape[0] + 1) // 2, (x.shape[1] + 1) // 2
    squares = np.pad(x * x, ((1, 1), (1, 1), (0, 0)))
    rows = sum(window[i] * squares[i : i + 2 * height - 1 : 2] for i in range(3))
    pooled = sum(window[i] * rows[:, i : i + 2 * width - 1 : 2] for i in range(3))
    return np.asarray(np.sqrt(pooled + np.float32(1e-12)), dtype=np.float32)


def _compared(x: Floats, y: Floats) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Similarity of texture and of structure for each channel, float64 [channels] each; 1 if equal."""
    flat_x, flat_y = (np.asarray(z, dtype=np.float64).reshape(-1, z.shape[2]) for z in (x, y))
    mean_x, mean_y = flat_x.mean(axis=0), flat_y.mean(axis=0)
    centred_x, centred_y = flat_x - mean_x, flat_y - mean_y
    variances = (centred_x**2).mean(axis=0) + (centred_y**2).mean(axis=0)
    covariance = (centred_x * centred_y).mean(axis=0)
    texture = (2 * mean_x * mean_y + _EPSILON) / (mean_x**2 + mean_y**2 + _EPSILON)
    return texture, (2 * covariance + _EPSILON) / (variances + _EPSILON)
