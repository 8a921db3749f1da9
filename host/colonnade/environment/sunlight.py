"""Sun and shade that a photo shows on the ground: how bright the sun is, and where it shines.

The ground is sunlit in a part and in shade in the other, if its luminances are of two kinds, and what is bright is
warmer: shade has the light of the sky. Tiles and rugs are told from sun and shade by another surface, such as a wall,
that shows both, too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from colonnade.common import fixed_order
from colonnade.common.accumulation import LUMINANCE, WHOLE
from colonnade.common.image_io import decode_srgb
from colonnade.common.types import Floats
from colonnade.environment.lights import world_surface
from colonnade.environment.model import Environment

#: Cosine of a pixel's normal with a surface's; least share of a surface in the picture.
_FACING, _LEAST_SHARE = 0.95, 0.015
#: Of the ground, and of another surface: the least share of the variance of logarithms of luminance that is between the
#: two kinds, and the least ratio of their hues, red over blue.
_GROUND, _OTHER = (0.85, 1.3), (0.75, 1.15)
#: Least ratio of luminances.
_LEAST_RATIO = 1.5
#: Channels of the photo tell the light from and up to these values.
_PHOTO_RANGE = (2, 250)
#: Bins of a histogram of logarithms.
_BINS = 128
#: A point whose shadow is so much farther from the camera than what the photo shows there is hidden, as a factor.
_HIDDEN = 1.05
#: Strength of a shadow in the shade: it is the sky's alone. Edge of the median's window, pixels.
_IN_SHADE, _MEDIAN = 0.4, 5

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Sunlight:
    """The sun on a room's ground.

    Attributes:
        ratio: Of what the ground shows in the sun and in the shade, float64 [3], more than 1.
        shade: What it shows in the shade, linear, float64 [3].
        is_lit: Pixels of the room that are brighter than between the two, bool [height, width].
    """

    ratio: Floats
    shade: Floats
    is_lit: Mask

    @classmethod
    def of(cls, room: Environment) -> Sunlight | None:
        """The sun in a room's photo; None where it shows none, or does not tell it from colours of the ground."""
        if room.photo is None:
            return None
        _, normals = world_surface(room)
        light = decode_srgb(room.photo)
        usable = (room.photo.max(axis=2) <= _PHOTO_RANGE[1]) & (room.photo.min(axis=2) >= _PHOTO_RANGE[0])
        x, y, z = np.moveaxis(np.where(usable[..., None], normals, 0.0), -1, 0)
        ground = _kinds(light[y > _FACING], usable.size, *_GROUND)
        if ground is None or not any(
            _kinds(light[facing > _FACING], usable.size, *_OTHER) for facing in (z, x, -x, -z)
        ):
            return None
        sun, shade, level = ground
        return cls(sun / shade, shade, light @ LUMINANCE > level)

    def strength(self) -> NDArray[np.uint8]:
        """The strength of the object's shadow on the photo, as `shadow_strength`: in the shade it takes no sun away."""
        share = ndimage.median_filter(self.is_lit.astype(np.float64), size=_MEDIAN, mode="nearest")
        return np.asarray(np.rint(WHOLE * (_IN_SHADE + (1 - _IN_SHADE) * share)), dtype=np.uint8)

    def colour(self, shade: Floats) -> Floats:
        """The sun's light on level ground, float64 [3], beside the light of the shade there."""
        return np.asarray((self.ratio - 1) * shade)

    def share(self, room: Environment, points: Floats, towards: Floats) -> float:
        """Share of points that the sun reaches: those whose shadows fall on sunlit ground; 1 if the photo shows none.

        Args:
            room: The room.
            points: World space, float64 [n, 3]; they stand on the level of the lowest one.
            towards: Unit, to the sun, float64 [3].
        """
        away = points - towards * ((points[:, 1:2] - points[:, 1].min()) / towards[1])
        seen = fixed_order.product(away - room.camera_to_world[:, 3], room.camera_to_world[:, :3])
        seen = seen[seen[:, 2] > 0]
        centre, focal = np.array((room.cx, room.cy)), np.array((room.fx, room.fy))
        column, row = np.floor(centre + focal * seen[:, :2] / seen[:, 2:]).astype(np.int64).T
        inside = (column >= 0) & (column < room.width) & (row >= 0) & (row < room.height)
        row, column, depth = row[inside], column[inside], seen[inside, 2]
        is_lit = self.is_lit[row, column][depth <= _HIDDEN * room.depth[row, column]]
        return float(is_lit.mean()) if len(is_lit) else 1.0


def _kinds(light: Floats, pixels: int, least_between: float, least_hue: float) -> tuple[Floats, Floats, float] | None:
    """Medians of the bright and of the dark pixels of a surface, and the luminance between; None: it has no sun."""
    if len(light) < _LEAST_SHARE * pixels:
        return None
    values = fixed_order.log(light @ LUMINANCE)
    counts, edges = np.histogram(values, bins=_BINS)
    middles, share = (edges[1:] + edges[:-1]) / 2, counts / len(values)
    below, mean = np.cumsum(share), np.cumsum(share * middles)
    between = (mean[-1] * below - mean) ** 2 / np.maximum(below * (1 - below), 1e-9)
    best = int(between.argmax())
    variance = float(share @ (middles - mean[-1]) ** 2)
    if variance <= 0 or between[best] < least_between * variance:
        return None
    is_bright = values > edges[best + 1]
    sun, shade = (np.median(light[part], axis=0) for part in (is_bright, ~is_bright))
    red, green, blue = sun / shade
    if (
        min(red / green, green / blue) < 1
        or red / blue < least_hue
        or sun @ LUMINANCE < _LEAST_RATIO * (shade @ LUMINANCE)
    ):
        return None
    return sun, shade, float(np.exp(edges[best + 1]))
