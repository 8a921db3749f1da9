"""The grain of a photo: the noise of its camera, by brightness (docs/background.md, "The photo's camera")."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats

#: Axes of noise, at right angles: grey, red against blue, and green against both.
_AXES = np.array([[1.0, 1.0, 1.0], [1.0, 0.0, -1.0], [1.0, -2.0, 1.0]]) / np.sqrt([[3.0], [2.0], [6.0]])
#: Edge of a block, pixels, a multiple of 4; the least number of blocks, and the ranges of brightness.
_BLOCK, _BLOCKS, _RANGES = 16, 40, 5
#: Of white noise all wavelet coefficients have one deviation. How much larger, and by how many codes, other
#: coefficients' of the first and of the second level may be: surfaces have more of these.
_FIRST, _SECOND, _SLACK = 1.6, 1.8, 0.3
#: The percentile of the blocks of a range that counts, and what it is of the deviation of white noise.
_LOW, _LOW_SHARE = 25, 0.94
#: A range may be so much noisier than the least one: else it has a texture.
_RATIO = 2.0
#: Variance of rounding to codes; deviation of grey below which there is no grain.
_ROUNDING, _LEAST = 1 / 12, 0.5
#: Brightness of blocks that are not saturated, codes.
_RANGE = (6.0, 249.0)


@dataclass(frozen=True)
class Grain:
    """White noise of sRGB codes, 0 to 255.

    Attributes:
        brightness: Means of the channels, increasing, float64 [n].
        deviation: On the axes at these, float64 [n, 3].
    """

    brightness: Floats
    deviation: Floats

    @staticmethod
    def of(photo: NDArray[np.uint8]) -> Grain | None:
        """The grain of a photo, sRGB, uint8 [height, width, 3]; None if it has none, or too few blocks without texture.

        Blocks count whose wavelet coefficients are as large on each axis and in two octaves, as for noise.
        """
        height, width = (length // _BLOCK * _BLOCK for length in photo.shape[:2])
        first, second = _details(photo[:height, :width].astype(np.float64) @ _AXES.T)
        brightness = _blocks(photo[:height, :width].mean(axis=2), 1).mean(axis=1)
        deviation, grey = first[2], first[2][:, 0]
        usable = (brightness > _RANGE[0]) & (brightness < _RANGE[1])
        usable &= np.maximum(first[0], first[1])[:, 0] <= _FIRST * grey + _SLACK
        usable &= second.max(axis=0)[:, 0] <= _SECOND * grey + _SLACK
        if usable.sum() < _BLOCKS:
            return None
        order = np.flatnonzero(usable)[np.argsort(brightness[usable], kind="stable")]
        ranges = np.array_split(order, _RANGES)
        found = np.array([np.percentile(deviation[own], _LOW, axis=0) / _LOW_SHARE for own in ranges])
        found = np.minimum(found, _RATIO * found.min(axis=0))
        found = np.sqrt((found**2 - _ROUNDING).clip(min=0.0))
        if found[:, 0].mean() < _LEAST:
            return None
        return Grain(np.array([brightness[own].mean() for own in ranges]), found)

    @property
    def grey(self) -> float:
        """The mean deviation of a channel by the noise that all channels share, codes."""
        return float(self.deviation[:, 0].mean() / np.sqrt(3))

    def noise(self, codes: Floats, frame: int) -> Floats:
        """Noise for a picture: a pixel's is a function of its place and of the frame.

        Args:
            codes: The picture, sRGB, 0 to 255, float64 [height, width, 3].
            frame: Number of the frame, from 0.

        Returns:
            In codes, float64 [height, width, 3].
        """
        # The legacy generator, since numpy guarantees its numbers for all time
        drawn = np.random.RandomState(frame).standard_normal(codes.shape)
        light = codes.mean(axis=2)
        scale = np.stack([np.interp(light, self.brightness, own) for own in self.deviation.T], axis=2)
        return np.asarray((drawn * scale) @ _AXES)


def _details(values: Floats) -> tuple[Floats, Floats]:
    """Deviations of Haar's wavelet coefficients in each block.

    Args:
        values: float64 [height, width, n].

    Returns:
        Of the first level across, down and diagonally, float64 [3, blocks, n]; of the second level across and down.
    """
    mean, *first = _haar(values)
    _, *second = _haar(mean)
    return (
        np.stack([np.sqrt((_blocks(each, 2) ** 2).mean(axis=1)) for each in first]),
        np.stack([np.sqrt((_blocks(each, 4) ** 2).mean(axis=1)) for each in second[:2]]),
    )


def _haar(values: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """One level of the orthonormal wavelet: means, and details across, down and diagonally."""
    a, b, c, d = values[0::2, 0::2], values[0::2, 1::2], values[1::2, 0::2], values[1::2, 1::2]
    return (a + b + c + d) / 2, (a - b + c - d) / 2, (a + b - c - d) / 2, (a - b - c + d) / 2


def _blocks(values: Floats, step: int) -> Floats:
    """The values of each block, float64 [blocks, values, …]; a value stands for `step` pixels across and down."""
    edge = _BLOCK // step
    rows, columns = values.shape[0] // edge, values.shape[1] // edge
    parts = values.reshape(rows, edge, columns, edge, *values.shape[2:]).swapaxes(1, 2)
    return np.asarray(parts.reshape(rows * columns, edge * edge, *values.shape[2:]))
