"""Where an object stands in a room: on the surface of a given pixel, or on a level one in view that has room for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from colonnade.common.errors import UserError
from colonnade.common.types import Floats

if TYPE_CHECKING:
    from colonnade.environment.model import Environment

#: Least upward part of a surface's normal on which an object may stand, and of one that is chosen for it.
_STANDABLE, _LEVEL = 0.7, 0.9
#: The best place for the foot in the picture: shares of its width and its height.
_PREFERRED = (0.5, 0.7)
#: Heights of the object in the picture that cost nothing, as shares of the picture's height; and the cost of each half
#: or double of them, in heights of the picture between the foot and the preferred place.
_LEAST_SHARE, _LARGEST_SHARE, _SIZE_COST = 0.25, 0.6, 0.4
#: Columns of the grid of pixels that are considered.
_COLUMNS = 96
#: Height differences up to this one are noise of the maps, metres, and as a share of the object's radius.
_NOISE, _NOISE_SHARE = 0.015, 0.1
#: Share of the room's points over a place that may be in the way, and height of the free space, metres.
_BLOCKED, _HEADROOM = 0.02, 1.2
#: Shares of the object that the room may hide; the second one only where no place keeps the first.
_HIDDEN = (0.02, 0.1)
#: Free pixels between the object and the picture's edge, as a share of the picture's height.
_MARGIN = 0.04


@dataclass(frozen=True)
class Footprint:
    """An upright cylinder around an object.

    Attributes:
        radius, height: Metres.
    """

    radius: float
    height: float


def surface_point(pixel: tuple[float, float], environment: Environment, key: str) -> Floats:
    """The surface point of a pixel of the room's maps on which an object may stand, world space, float64 [3].

    Raises:
        UserError: The pixel is outside the maps, or on a wall or ceiling.
    """
    u, v = pixel
    if u >= environment.width or v >= environment.height:
        raise UserError(
            f"{key} is ({u:g}, {v:g}), outside the maps of room {environment.name}:"
            f" they are {environment.width}x{environment.height} pixels"
        )
    x, y = int(u), int(v)
    around = environment.normals[max(0, y - 2) : y + 3, max(0, x - 2) : x + 3].reshape(-1, 3)
    upward = float(np.median(around @ environment.camera_to_world[1, :3]))
    if upward < _STANDABLE:
        what = "a ceiling" if upward < -_STANDABLE else "a wall or another steep surface"
        raise UserError(
            f"{key} is ({u:g}, {v:g}) in the {environment.width}x{environment.height} pixels of room"
            f" {environment.name}, on {what}: choose a pixel of a floor or a table, or leave it out, and a level"
            " surface is chosen"
        )
    depth = environment.depth[y, x]
    seen = np.array([(u - environment.cx) / environment.fx, (v - environment.cy) / environment.fy, 1.0]) * depth
    return np.asarray(environment.camera_to_world[:, :3] @ seen + environment.camera_to_world[:, 3], dtype=np.float64)


def free_place(
    environment: Environment, footprint: Footprint, taken: Sequence[tuple[Floats, float]] = ()
) -> tuple[float, float] | None:
    """The best pixel on whose surface a cylinder stands: whole on a level surface, free, in view, large enough.

    The places are tried by the distance of their pixels from the preferred one, and by the size of the object in the
    picture. The first one is taken where the room hides next to nothing of the object; without one, a tenth at most.

    Args:
        environment: The room.
        footprint: The cylinder.
        taken: Feet and radii of objects that stand already, world space.
    """
    step = max(1, environment.width // _COLUMNS)
    v, u = (index + 0.5 for index in np.mgrid[0 : environment.height : step, 0 : environment.width : step])
    rotation, origin = environment.camera_to_world[:, :3], environment.camera_to_world[:, 3]
    seen = environment.points()[::step, ::step].reshape(-1, 3)
    points = seen @ rotation.T + origin
    is_level = environment.normals[::step, ::step].reshape(-1, 3) @ rotation[1] >= _LEVEL
    pixels = np.stack([u.ravel(), v.ravel()], axis=1)
    noise = max(_NOISE, _NOISE_SHARE * footprint.radius)
    second = None
    for place in np.argsort(_costs(environment, footprint, pixels, seen[:, 2]), kind="stable"):
        foot = points[place]
        if not is_level[place] or any(
            np.hypot(*(foot - other)[[0, 2]]) < footprint.radius + radius for other, radius in taken
        ):
            continue
        across = np.hypot(points[:, 0] - foot[0], points[:, 2] - foot[2]) <= footprint.radius
        rise = points[across, 1] - foot[1]
        if np.mean((rise > noise) & (rise < max(footprint.height, _HEADROOM))) > _BLOCKED:
            continue
        hidden = _hidden_share(environment, footprint, foot, noise)
        if hidden > _HIDDEN[1] or not _is_supported(environment, footprint.radius, foot, noise):
            continue
        found = float(pixels[place, 0]), float(pixels[place, 1])
        if hidden <= _HIDDEN[0]:
            return found
        second = second or found
    return second


def _costs(environment: Environment, footprint: Footprint, pixels: Floats, depths: Floats) -> Floats:
    """The cost of each place: pixels [n, 2] at depths [n]."""
    size = np.array([environment.width, environment.height])
    distance = np.linalg.norm((pixels / size - _PREFERRED) * (size / size[1]), axis=1)
    share = max(footprint.height, 2 * footprint.radius) * environment.fy / depths / environment.height
    small, large = np.log2(_LEAST_SHARE / share), np.log2(share / _LARGEST_SHARE)
    return np.asarray(distance + _SIZE_COST * np.maximum(0.0, np.maximum(small, large)))


def _projected(environment: Environment, seen: Floats) -> Floats | None:
    """The pixels of points [n, 3] in the camera's space, float64 [n, 2]; None if one is out of view."""
    if seen[:, 2].min() <= 0:
        return None
    focal, centre = np.array([environment.fx, environment.fy]), np.array([environment.cx, environment.cy])
    pixels = seen[:, :2] / seen[:, 2:] * focal + centre
    size = np.array([environment.width, environment.height])
    return np.asarray(pixels) if (pixels >= 0).all() and (pixels < size).all() else None


def _is_supported(environment: Environment, radius: float, foot: Floats, noise: float) -> bool:
    """Whether the whole disc under a cylinder is seen, on a level surface."""
    rotation, origin = environment.camera_to_world[:, :3], environment.camera_to_world[:, 3]
    angle = np.arange(16) * np.pi / 8
    ring = np.stack([np.cos(angle), np.zeros(16), np.sin(angle)], axis=1)
    disc = foot + radius * np.concatenate([0.5 * ring, ring])
    pixels = _projected(environment, (disc - origin) @ rotation)
    if pixels is None:
        return False
    u, v = np.floor(pixels).astype(np.int64).T
    direction = np.stack(
        [(u + 0.5 - environment.cx) / environment.fx, (v + 0.5 - environment.cy) / environment.fy, np.ones(len(u))],
        axis=1,
    )
    found = (direction * environment.depth[v, u, None]) @ rotation.T + origin
    return bool((np.abs(found[:, 1] - foot[1]) <= noise).all())


def _hidden_share(environment: Environment, footprint: Footprint, foot: Floats, noise: float) -> float:
    """The share of a cylinder's pixels before which the room lies; 1 if it is not whole in the picture.

    The cylinder stands for its upright section across the view, from a tenth of its height on, since the surface
    before its foot is no obstacle. Every pixel counts, so that thin things do.
    """
    rotation, origin = environment.camera_to_world[:, :3], environment.camera_to_world[:, 3]
    across, up = np.meshgrid((-footprint.radius, footprint.radius), (0.1 * footprint.height, footprint.height))
    section = foot - origin + up.reshape(-1, 1) * (0.0, 1.0, 0.0) + across.reshape(-1, 1) * rotation[:, 0]
    seen = section @ rotation
    pixels = _projected(environment, seen)
    if pixels is None:
        return 1.0
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    margin = _MARGIN * environment.height
    if (low < margin).any() or (high > np.array([environment.width, environment.height]) - margin).any():
        return 1.0
    (u0, v0), (u1, v1) = np.floor(low).astype(int), np.floor(high).astype(int) + 1
    return float(np.mean(environment.depth[v0:v1, u0:u1] < seen[:, 2].min() - noise))
