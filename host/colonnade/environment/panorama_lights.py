"""Lights of a panorama: its bright parts, which become discs; the rest stays light by direction."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from colonnade.common.accumulation import LUMINANCE
from colonnade.common.types import Floats
from colonnade.environment.panorama import Panorama

#: A part is brighter than the median luminance of all directions by this factor, or than a white that a ray can bring.
_BRIGHT, _WHITE = 6.0, 1.0
#: Least share of all light of a part that becomes a light.
_MIN_SHARE = 0.01
#: Largest radius of a light, radians: a wider part becomes several.
_MAX_RADIUS = np.radians(20.0)
#: The radius of a part is at most so many times its brighter half's, otherwise this alone is the light.
_EVEN = 1.5
#: The panes of a window: their distance in sums of their radii, and the ratio of their radiances, at most.
_GAP, _ALIKE = 1.3, 3.0

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class DistantLight:
    """A disc of light in some direction.

    Attributes:
        direction: Unit, towards the light, world space, float64 [3].
        colour: What a surface of albedo 1 that faces it shows: its radiance times its solid angle / π, float64 [3].
        radius: Radius as seen from the panorama's point, radians.
        is_far: It is outside of any room.
    """

    direction: Floats
    colour: Floats
    radius: float
    is_far: bool = False


def split_lights(panorama: Panorama, count: int) -> tuple[list[DistantLight], Panorama]:
    """At most ``count`` lights of a panorama, the brightest first, and the panorama without them.

    Together they are as bright as before. If there are more, those stay in the panorama that are largest and dimmest:
    rays that meet them in some direction find them often, and do not saturate.
    """
    sky = _Sky.of(panorama)
    parts = _merged(sky, [part for region in sky.regions(sky.luminance > sky.level) for part in sky.parts(region)])
    least = _MIN_SHARE * (sky.luminance * sky.angles).sum()
    found = [(sky.light(part), part) for part in parts if sky.flux[part].sum() >= least]
    found.sort(key=lambda one: -float((sky.flux * sky.luminance)[one[1]].sum()))
    found = sorted(found[:count], key=lambda one: -float(one[0].colour @ LUMINANCE))
    taken = np.zeros_like(sky.luminance, dtype=np.bool_)
    for _, part in found:
        taken |= part
    rest = np.where(taken[..., None], panorama.radiance - sky.above / sky.angles[..., None], panorama.radiance)
    return [light for light, _ in found], replace(panorama, radiance=rest)


@dataclass(frozen=True)
class _Sky:
    """A panorama while its lights are found, each array [height, width], or [height, width, 3].

    Attributes:
        luminance: Of its pixels.
        angles: Their solid angles.
        directions: Unit.
        level: Luminance from which on something is bright.
        above: Light above this, radiance times solid angle.
        flux: Luminance of this.
    """

    luminance: Floats
    angles: Floats
    directions: Floats
    level: float
    above: Floats
    flux: Floats

    @classmethod
    def of(cls, panorama: Panorama) -> _Sky:
        luminance = panorama.radiance @ LUMINANCE
        angles = np.broadcast_to(panorama.solid_angles(), luminance.shape)
        level = min(_BRIGHT * _weighted_median(luminance, angles), _WHITE)
        share = 1 - level / np.maximum(luminance, max(level, 1e-9))
        above = (share * angles)[..., None] * panorama.radiance
        return cls(luminance, angles, panorama.directions(), level, above, above @ LUMINANCE)

    def light(self, part: Mask) -> DistantLight:
        """The disc that stands for a part."""
        flux, towards = self.flux[part], self.directions[part]
        direction = flux @ towards
        direction = direction / np.sqrt(direction @ direction)
        # A disc of radius r has the mean square distance r²/2 from its middle
        radius = float(np.sqrt(2 * (flux @ np.arccos((towards @ direction).clip(-1.0, 1.0)) ** 2) / flux.sum()))
        return DistantLight(direction, self.above[part].sum(axis=0) / np.pi, radius)

    def parts(self, region: Mask) -> Iterator[Mask]:
        """A connected region as parts that are even and small; what is dim beside them is left out."""
        bright = region & (self.luminance > self.luminance[region].max() / 2)
        half = np.sqrt(self.angles[bright].sum() / np.pi)
        radius = self.light(region).radius
        if radius > _EVEN * max(half, np.sqrt(self.angles[region].max())) and not np.array_equal(bright, region):
            level = 2 * self.luminance[region].min()
            for inner in self.regions(region & (self.luminance > min(level, self.luminance[region].max() / 2))):
                yield from self.parts(inner)
        elif radius > _MAX_RADIUS:
            for half_region in self._halves(region):
                yield from self.parts(half_region)
        else:
            yield region

    def _halves(self, region: Mask) -> Iterator[Mask]:
        """A region, divided across its longest extent."""
        towards = self.directions[region]
        offset = towards - self.light(region).direction
        _, axes = np.linalg.eigh((offset * self.flux[region][:, None]).T @ offset)
        for first in (True, False):
            half = np.zeros_like(region)
            half[region] = (offset @ axes[:, -1] > 0) == first
            yield half

    def regions(self, bright: Mask) -> Iterator[Mask]:
        """The connected regions of a mask; the right edge continues at the left one."""
        found, count = ndimage.label(bright, structure=np.ones((3, 3)))
        for row in np.flatnonzero(bright[:, 0] & bright[:, -1]):
            left, right = found[row, 0], found[row, -1]
            if left != right:
                found[found == right] = left
        for label in range(1, count + 1):
            if (found == label).any():
                yield found == label


def _merged(sky: _Sky, parts: list[Mask]) -> list[Mask]:
    """The parts, of which the panes of a window are one."""
    for index, one in enumerate(parts):
        for other in parts[:index]:
            a, b, both = sky.light(one), sky.light(other), one | other
            distance = np.arccos(np.clip(a.direction @ b.direction, -1.0, 1.0))
            dim, bright = sorted(sky.flux[part].sum() / sky.angles[part].sum() for part in (one, other))
            is_near = distance <= _GAP * (a.radius + b.radius) and bright <= _ALIKE * dim
            if is_near and sky.light(both).radius <= _MAX_RADIUS:
                return _merged(sky, [*(part for part in parts if part is not one and part is not other), both])
    return parts


def _weighted_median(values: Floats, weights: Floats) -> float:
    order = np.argsort(values, axis=None)
    sums = np.cumsum(weights.ravel()[order])
    return float(values.ravel()[order[np.searchsorted(sums, sums[-1] / 2)]])
