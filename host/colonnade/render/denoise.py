"""A filter of the noise of gathered light, for a few samples a pixel (docs/gather.md, "Denoising").

The edge-avoiding à-trous wavelet of H. Dammertz et al. (2010), guided by the object's surface and by the variance of
the passes, as in SVGF (C. Schied et al. 2017). Only pixels of the object are filtered, each by others near its plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colonnade.common.accumulation import LUMINANCE
from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors

#: Weights of a cubic B-spline at distances of 0, 1 and 2 steps.
_SPLINE = (3 / 8, 1 / 4, 1 / 16)
#: Filters one after the other; each doubles the step.
_LEVELS = 4
#: How many standard deviations, and how much of the distance off the plane, two pixels may differ.
_COLOUR, _PLANE = 3.0, 0.1
#: Power of the cosine between two normals.
_NORMAL = 32
#: Side of the square over which a single sample's variance is estimated, pixels.
_WINDOW = 7
#: A single sample is a bright point if it is so many standard deviations above its neighbours; levels that spread it.
_POINT, _POINT_LEVELS = 1.5, 3


@dataclass(frozen=True)
class Guide:
    """The surface that pixels show.

    Attributes:
        position, normals: In one space, float64 [height, width, 3]; undefined outside `mask`.
        mask: The pixel shows the object, bool [height, width].
    """

    position: Floats
    normals: Floats
    mask: NDArray[np.bool_]

    @staticmethod
    def of(position: Floats, mask: NDArray[np.bool_]) -> Guide:
        """Normals from positions: across the nearer neighbour on each axis."""
        along = [_difference(position, mask, axis) for axis in (0, 1)]
        return Guide(position, unit_vectors(np.cross(along[0], along[1])), mask)


def _difference(position: Floats, mask: NDArray[np.bool_], axis: int) -> Floats:
    """The way to the nearer one of two neighbours on an axis."""
    steps = []
    for by in (1, -1):
        other, known = np.roll(position, -by, axis), np.roll(mask, -by, axis) & mask
        way = by * (other - position)
        steps.append((way, np.where(known, np.linalg.norm(np.where(known[..., None], way, 0.0), axis=2), np.inf)))
    (forward, ahead), (backward, behind) = steps
    found = np.where((ahead <= behind)[..., None], forward, backward)
    return np.where(np.isfinite(np.minimum(ahead, behind))[..., None], found, 0.0)


def denoised(colour: Floats, variance: Floats | None, guide: Guide) -> Floats:
    """Filter the colours of the object's pixels.

    Args:
        colour: Linear, float64 [height, width, 3].
        variance: Of the luminance of each pixel's mean, float64 [height, width]; None: estimated from the neighbours.
        guide: What the pixels show.

    Returns:
        float64 [height, width, 3]; pixels outside the mask are unchanged.
    """
    rows, columns = np.flatnonzero(guide.mask.any(axis=1)), np.flatnonzero(guide.mask.any(axis=0))
    if len(rows) == 0:
        return colour
    # The bounding box of the object, with a border that is outside the mask
    border = 2 << (_LEVELS - 1)
    box = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    pad = ((border, border), (border, border))

    def boxed(values: Floats) -> Floats:
        return np.pad(values[box], (*pad, *((0, 0),) * (values.ndim - 2)))

    mask = np.pad(guide.mask[box], pad)
    position, normals = boxed(np.where(guide.mask[..., None], guide.position, 0.0)), boxed(guide.normals)
    now = boxed(np.where(guide.mask[..., None], colour, 0.0))
    points = np.zeros_like(now)
    if variance is None:
        now, points = _without_points(now, mask)
        for level in range(_POINT_LEVELS):
            points, _ = _filtered(points, None, position, normals, mask, 1 << level)
        spread = _local_variance(now @ LUMINANCE, mask)
    else:
        spread = boxed(variance) * mask
    for level in range(_LEVELS):
        now, spread = _filtered(now, spread, position, normals, mask, 1 << level)
    now += points
    result = colour.copy()
    inner = np.s_[border:-border, border:-border]
    result[box] = np.where(guide.mask[box][..., None], now[inner], colour[box])
    return result


def _filtered(
    colour: Floats, variance: Floats | None, position: Floats, normals: Floats, mask: NDArray[np.bool_], step: int
) -> tuple[Floats, Floats]:
    """One level of the wavelet: colours and the variance of their luminance. Without one, luminance does not count."""
    light = colour @ LUMINANCE
    deviation = np.inf if variance is None else _COLOUR * np.sqrt(_blurred(variance, mask)) + 1e-4
    sums, weights, squares = np.zeros_like(colour), np.zeros_like(light), np.zeros_like(light)
    for down in range(-2, 3):
        for across in range(-2, 3):
            shift = (-down * step, -across * step)

            def there(values: NDArray[Any], shift: tuple[int, int] = shift) -> NDArray[Any]:
                return np.roll(values, shift, axis=(0, 1))

            way = there(position) - position
            off = np.abs(np.einsum("yxi,yxi->yx", way, normals))
            far = _PLANE * np.linalg.norm(way, axis=2) + 1e-9
            facing = np.einsum("yxi,yxi->yx", there(normals), normals).clip(min=0.0) ** _NORMAL
            weight = _SPLINE[abs(down)] * _SPLINE[abs(across)] * there(mask) * mask
            if down or across:
                weight = weight * facing * np.exp(-off / far - np.abs(there(light) - light) / deviation)
            sums += weight[..., None] * there(colour)
            weights += weight
            if variance is not None:
                squares += weight**2 * there(variance)
    safe = np.where(weights > 0, weights, 1.0)
    return sums / safe[..., None], squares / safe**2


def _blurred(values: Floats, mask: NDArray[np.bool_]) -> Floats:
    """A mean of 3 by 3 pixels of the object."""
    total, count = np.zeros_like(values), np.zeros_like(values)
    for down in (-1, 0, 1):
        for across in (-1, 0, 1):
            weight = (2 - abs(down)) * (2 - abs(across)) * np.roll(mask, (down, across), (0, 1))
            total += weight * np.roll(values, (down, across), (0, 1))
            count += weight
    return np.asarray(total / np.maximum(count, 1))


def _without_points(colour: Floats, mask: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Colours no brighter than their neighbours are, and what is brighter."""
    light = colour @ LUMINANCE
    count, first, second = _moments(light, mask)
    others = np.maximum(count - mask, 1)
    mean = (first - mask * light) / others
    deviation = np.sqrt(((second - mask * light**2) / others - mean**2).clip(min=0.0))
    usual = colour * np.minimum(1.0, (mean + _POINT * deviation) / np.maximum(light, 1e-9))[..., None]
    return usual, colour - usual


def _local_variance(light: Floats, mask: NDArray[np.bool_]) -> Floats:
    """The variance of the luminance among the neighbours that show the object."""
    count, first, second = _moments(light, mask)
    safe = np.maximum(count, 1)
    return np.asarray((second / safe - (first / safe) ** 2).clip(min=0.0) * mask)


def _moments(light: Floats, mask: NDArray[np.bool_]) -> tuple[Floats, Floats, Floats]:
    """Number, sum and sum of squares of the luminance of the pixels around each that show the object."""
    half = _WINDOW // 2
    count, first, second = (np.zeros_like(light) for _ in range(3))
    for down in range(-half, half + 1):
        for across in range(-half, half + 1):
            shows, value = np.roll(mask, (down, across), (0, 1)), np.roll(light, (down, across), (0, 1))
            count += shows
            first += shows * value
            second += shows * value**2
    return count, first, second
