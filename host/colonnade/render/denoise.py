"""A filter of the noise of gathered light, for a few samples a pixel (docs/gather.md, "Denoising").

The edge-avoiding à-trous wavelet of H. Dammertz et al. (2010), guided by the object's surface and by the variance of
the passes, as in SVGF (C. Schied et al. 2017). Only pixels of the object are filtered, each by others near its plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from colonnade.common.accumulation import LUMINANCE
from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors

#: Filters one after the other; each doubles the step.
_LEVELS = 4
#: How many standard deviations two pixels may differ.
_COLOUR = 3.0
#: How much of their distance two pixels may lie off a plane: of depth alone, and where shading normals are known.
_PLANE, _SHADED_PLANE = 0.1, 0.4
#: Side of the square over which a single sample's variance is estimated, pixels.
_WINDOW = 7
#: A pixel is a point if it is so many standard deviations off its neighbours; levels that spread it.
_POINT, _POINT_LEVELS = 1.5, 3


@dataclass(frozen=True)
class Guide:
    """The surface that pixels show.

    Attributes:
        position, planes, normals: In one space, float64 [height, width, 3]; 0 outside `mask`. ``planes`` are the
            normals of the surface, ``normals`` its shading normals.
        mask: The pixel shows the object, bool [height, width].
        plane: How much of their distance two pixels may lie off a plane.
    """

    position: Floats
    planes: Floats
    normals: Floats
    mask: NDArray[np.bool_]
    plane: float = _PLANE

    @staticmethod
    def of(position: Floats, mask: NDArray[np.bool_], normals: Floats | None = None) -> Guide:
        """With planes from positions: across the nearer neighbour on each axis. Without ``normals`` they are these."""
        position, box = np.where(mask[..., None], position, 0.0), _Box.of(mask)
        along = [_difference(box.cut(position), box.cut(mask), axis) for axis in (0, 1)]
        planes = box.put(unit_vectors(np.cross(along[0], along[1])), np.zeros_like(position))
        if normals is None:
            return Guide(position, planes, planes, mask)
        return Guide(position, planes, np.where(mask[..., None], normals, 0.0), mask, _SHADED_PLANE)


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


@dataclass(frozen=True)
class Noisy:
    """Colours with noise.

    Attributes:
        colour: Linear, float64 [height, width, 3].
        variance: Of their luminance, float64 [height, width].
    """

    colour: Floats
    variance: Floats

    @staticmethod
    def of(colour: Floats, variance: Floats | None, guide: Guide, are_few: bool = False) -> Noisy:
        """Means of samples; without a variance, single samples: points are spread, and neighbours have the variance.

        If there ``are_few``, points of the mean are spread as far as its samples differ.
        """
        if variance is not None and not are_few:
            return Noisy(colour, variance)
        usual = _without_points(colour, guide.mask, None if variance is None else np.sqrt(variance))
        points = colour - usual
        for level in range(_POINT_LEVELS):
            points, _ = _filtered(points, None, guide, 1 << level)
        if variance is not None:
            return Noisy(usual + points, variance)
        _, deviation = moments((usual @ LUMINANCE)[..., None], guide.mask)
        return Noisy(usual + points, deviation[..., 0] ** 2)


def denoised(noisy: Noisy, guide: Guide) -> Floats:
    """Filter the colours of the object's pixels.

    Args:
        noisy: The colours.
        guide: What the pixels show.

    Returns:
        float64 [height, width, 3]; pixels outside the mask are unchanged.
    """
    colour, spread = noisy.colour, noisy.variance
    for level in range(_LEVELS):
        colour, spread = _filtered(colour, spread, guide, 1 << level)
    return np.where(guide.mask[..., None], colour, noisy.colour)


@dataclass(frozen=True)
class _Box:
    """The rectangle of an object, with a border outside the mask."""

    rows: slice
    columns: slice

    _BORDER = 1

    @staticmethod
    def of(mask: NDArray[np.bool_]) -> _Box:
        rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
        if len(rows) == 0:
            return _Box(slice(0, 0), slice(0, 0))
        return _Box(slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1))

    def cut(self, values: NDArray[Any]) -> NDArray[Any]:
        return np.pad(values[self.rows, self.columns], ((self._BORDER,) * 2,) * 2 + ((0, 0),) * (values.ndim - 2))

    def put(self, values: Floats, into: Floats) -> Floats:
        found = into.copy()
        found[self.rows, self.columns] = values[self._BORDER : -self._BORDER, self._BORDER : -self._BORDER]
        return found


def _filtered(colour: Floats, variance: Floats | None, guide: Guide, step: int) -> tuple[Floats, Floats]:
    """One level of the wavelet: colours and the variance of their luminance. Without one, luminance does not count."""
    from colonnade import _core

    light, spread = colour @ LUMINANCE, np.zeros_like(guide.position[..., 0])
    deviation = np.full_like(light, np.inf)
    if variance is not None:
        spread, deviation = variance, _COLOUR * np.sqrt(_blurred(variance, guide.mask)) + 1e-4
    arrays = (colour, light, spread, deviation, guide.position, guide.planes, guide.normals)
    colour, light, spread, deviation, *surface = map(np.ascontiguousarray, arrays)
    found: tuple[Floats, Floats] = _core.wavelet(
        surface, guide.mask, guide.plane, colour, [light, spread, deviation], step
    )
    return found


def _blurred(values: Floats, mask: NDArray[np.bool_]) -> Floats:
    """A mean of 3 by 3 pixels of the object."""
    total, count = np.zeros_like(values), np.zeros_like(values)
    for down in (-1, 0, 1):
        for across in (-1, 0, 1):
            weight = (2 - abs(down)) * (2 - abs(across)) * np.roll(mask, (down, across), (0, 1))
            total += weight * np.roll(values, (down, across), (0, 1))
            count += weight
    return np.asarray(total / np.maximum(count, 1))


def _without_points(colour: Floats, mask: NDArray[np.bool_], max_change: Floats | None = None) -> Floats:
    """Colours no further from their neighbours than these are from each other; changed by ``max_change`` at most."""
    light = colour @ LUMINANCE
    count, first, second = _sums(light[..., None], mask)
    others = np.maximum(count - 1, 1)
    mean = (first[..., 0] - light) / others
    deviation = np.sqrt(((second[..., 0] - light**2) / others - mean**2).clip(min=0.0))
    usual = light.clip(mean - _POINT * deviation, mean + _POINT * deviation)
    if max_change is not None:
        usual = usual.clip(light - max_change, light + max_change)
    darker, lighter = colour * (usual / np.maximum(light, 1e-9))[..., None], colour + (usual - light)[..., None]
    return np.where(mask[..., None], np.where((usual > light)[..., None], lighter, darker), colour)


def moments(values: Floats, mask: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Mean and standard deviation of values among the neighbours that show the object, float64 [height, width, k]."""
    count, first, second = _sums(values, mask)
    mean = first / np.maximum(count, 1)[..., None]
    return mean, np.sqrt((second / np.maximum(count, 1)[..., None] - mean**2).clip(min=0.0))


def _sums(values: Floats, mask: NDArray[np.bool_]) -> tuple[Floats, Floats, Floats]:
    """Number, sums and sums of squares of values [height, width, k] around each pixel, where they show the object."""
    box, inside = _Box.of(mask), mask[..., None] * values

    def around(of: Floats) -> Floats:
        size = (_WINDOW, _WINDOW) + (1,) * (of.ndim - 2)
        return box.put(ndimage.uniform_filter(box.cut(of), size, mode="constant") * _WINDOW**2, np.zeros_like(of))

    return around(mask.astype(np.float64)), around(inside), around(inside**2)
