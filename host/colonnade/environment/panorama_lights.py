"""Lights of a panorama: its small bright regions, which become point lights; the rest stays light by direction."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from colonnade.common.accumulation import LUMINANCE
from colonnade.common.types import Floats
from colonnade.environment.panorama import Panorama

#: A region is brighter than the median luminance of all directions by this factor.
_BRIGHT = 6.0
#: Least share of all light, and largest radius, radians, of a region that becomes a light: larger ones have no sharp
#: shadows, so the light cube shows them.
_MIN_SHARE = 0.02
_MAX_RADIUS = np.radians(20.0)


@dataclass(frozen=True)
class DistantLight:
    """A disc of light in some direction.

    Attributes:
        direction: Unit, towards the light, world space, float64 [3].
        colour: What a surface of albedo 1 that faces it shows: its radiance times its solid angle / π, float64 [3].
        radius: Radius as seen from the panorama's point, radians.
    """

    direction: Floats
    colour: Floats
    radius: float


def split_lights(panorama: Panorama, count: int) -> tuple[list[DistantLight], Panorama]:
    """The brightest lights of a panorama, at most ``count``, and the panorama without them.

    Together they are as bright as before.
    """
    luminance = panorama.radiance @ LUMINANCE
    angles = np.broadcast_to(panorama.solid_angles(), luminance.shape)
    level = _BRIGHT * _weighted_median(luminance, angles)
    regions = _regions(luminance > level)
    # Of each pixel, the light above the level
    above = (1 - level / np.maximum(luminance, max(level, 1e-9)))[..., None] * panorama.radiance * angles[..., None]
    fluxes, directions = above @ LUMINANCE, panorama.directions()
    bright = np.flatnonzero(np.bincount(regions.ravel(), fluxes.ravel()) >= _MIN_SHARE * (luminance * angles).sum())
    lights: list[tuple[DistantLight, int]] = []
    for label in bright[bright > 0]:
        inside = regions == label
        flux, towards = fluxes[inside], directions[inside]
        direction = flux @ towards
        direction = direction / np.sqrt(direction @ direction)
        # A disc of radius r has the mean square distance r²/2 from its middle
        radius = float(np.sqrt(2 * (flux @ np.arccos((towards @ direction).clip(-1.0, 1.0)) ** 2) / flux.sum()))
        if radius <= _MAX_RADIUS:
            lights.append((DistantLight(direction, above[inside].sum(axis=0) / np.pi, radius), int(label)))
    lights.sort(key=lambda one: -float(one[0].colour @ LUMINANCE))
    taken = np.isin(regions, [label for _, label in lights[:count]])
    rest = np.where(taken[..., None], panorama.radiance - above / angles[..., None], panorama.radiance)
    return [light for light, _ in lights[:count]], replace(panorama, radiance=rest)


def _weighted_median(values: Floats, weights: Floats) -> float:
    order = np.argsort(values, axis=None)
    sums = np.cumsum(weights.ravel()[order])
    return float(values.ravel()[order[np.searchsorted(sums, sums[-1] / 2)]])


def _regions(bright: NDArray[np.bool_]) -> NDArray[np.int32]:
    """The connected regions of a panorama, numbered from 1; the right edge continues at the left one."""
    regions: NDArray[np.int32] = ndimage.label(bright, structure=np.ones((3, 3)))[0]
    for row in np.flatnonzero(bright[:, 0] & bright[:, -1]):
        left, right = regions[row, 0], regions[row, -1]
        if left != right:
            regions[regions == right] = left
    return regions
