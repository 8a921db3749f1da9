"""Sources of light that a photo shows: large saturated regions, such as a window in view."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from colonnade.common import fixed_order
from colonnade.environment.lights import RoomLight, world_surface
from colonnade.environment.model import Environment

#: Least radiance of a source, in whites of the photo, which does not tell it: windows are several times as bright.
SEEN_RADIANCE = 4.0
#: All channels of a source's pixels are at least so bright.
_SATURATED = 250
#: Least share of a photo's pixels.
_MIN_SHARE = 0.002
#: Height of a unit normal from which on a surface is ground.
_GROUND = 0.7
#: Distance of a source from its surface, metres, so that it does not light this.
_BEFORE = 0.05


def seen_sources(environment: Environment) -> list[RoomLight]:
    """The sources of light that a room's photo shows, the largest first; none without a photo.

    Each is a light in the middle of its region, with the radius of a disc of its area, and the radiance
    `SEEN_RADIANCE`.
    """
    if environment.photo is None:
        return []
    regions, count = ndimage.label(environment.photo.min(axis=2) >= _SATURATED)
    surface, normals = world_surface(environment)
    eye, found = environment.camera_to_world[:, 3], []
    for label in range(1, count + 1):
        inside = regions == label
        points, facing, depth = surface[inside], normals[inside], environment.depth[inside]
        # The ground is lit by a source, and is none
        if len(points) < _MIN_SHARE * inside.size or facing[:, 1].mean() > _GROUND:
            continue
        away = eye - points
        cosine = fixed_order.dot(facing, away) / np.sqrt(fixed_order.dot(away, away))
        # A pixel's area across the ray is its square's at depth 1, times the slant of the ray
        slant = depth / np.sqrt(fixed_order.dot(away, away))
        area = (depth**2 * slant / cosine.clip(min=0.1)).sum() / (environment.fx * environment.fy)
        position = points.mean(axis=0) + _BEFORE * facing.mean(axis=0)
        squared = float(area) / np.pi
        found.append(RoomLight(position, np.full(3, SEEN_RADIANCE * squared), 1.0, float(np.sqrt(squared))))
    return sorted(found, key=lambda light: -light.radius)
