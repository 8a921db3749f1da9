"""Where an object stands in a room: on the surface of a given pixel, or on a level one in view that has room for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from colonnade.common.errors import UserError
from colonnade.common.types import Floats, Indices

if TYPE_CHECKING:
    from colonnade.environment.model import Environment

#: Least upward part of a surface's normal on which an object may stand, and of one that is chosen for it.
_STANDABLE, _LEVEL = 0.7, 0.9
#: The place nearest to this one is chosen: shares of the width and the height of the maps.
_PREFERRED = (0.5, 0.7)
#: Columns of the grid of pixels that are considered.
_COLUMNS = 96
#: Height differences up to this one are noise of the maps, metres, and as a share of the object's radius.
_NOISE, _NOISE_SHARE = 0.015, 0.1
#: Share of the room's points over a place, or before it, that may be in the way, and height of the free space, metres.
_BLOCKED, _HEADROOM = 0.02, 1.2


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
            f"{key} is ({u:g}, {v:g}), on {what} of room {environment.name}: choose a pixel of a floor or a table, or"
            f" leave it out, and a level surface is chosen"
        )
    depth = environment.depth[y, x]
    seen = np.array([(u - environment.cx) / environment.fx, (v - environment.cy) / environment.fy, 1.0]) * depth
    return np.asarray(environment.camera_to_world[:, :3] @ seen + environment.camera_to_world[:, 3], dtype=np.float64)


def free_place(
    environment: Environment, footprint: Footprint, taken: Sequence[tuple[Floats, float]] = ()
) -> tuple[float, float] | None:
    """The pixel nearest to the preferred one on whose surface a cylinder stands, whole, free and in full view.

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
    size = np.array([environment.width, environment.height])
    distance = np.linalg.norm((pixels / size - _PREFERRED) * (size / size[1]), axis=1)
    noise = max(_NOISE, _NOISE_SHARE * footprint.radius)
    for place in np.argsort(distance, kind="stable"):
        foot = points[place]
        if not is_level[place] or any(
            np.hypot(*(foot - other)[[0, 2]]) < footprint.radius + radius for other, radius in taken
        ):
            continue
        across = np.hypot(points[:, 0] - foot[0], points[:, 2] - foot[2]) <= footprint.radius
        rise = points[across, 1] - foot[1]
        if np.mean((rise > noise) & (rise < max(footprint.height, _HEADROOM))) > _BLOCKED:
            continue
        if _is_supported(environment, footprint.radius, foot, noise) and _is_in_view(
            environment, footprint, foot, noise
        ):
            return float(pixels[place, 0]), float(pixels[place, 1])
    return None


def _pixels(environment: Environment, seen: Floats) -> tuple[Indices, Indices] | None:
    """The pixels u and v of points [n, 3] in the camera's space; None if one is out of view."""
    if seen[:, 2].min() <= 0:
        return None
    u = np.floor(seen[:, 0] / seen[:, 2] * environment.fx + environment.cx).astype(np.int64)
    v = np.floor(seen[:, 1] / seen[:, 2] * environment.fy + environment.cy).astype(np.int64)
    if min(u.min(), v.min()) < 0 or u.max() >= environment.width or v.max() >= environment.height:
        return None
    return u, v


def _is_supported(environment: Environment, radius: float, foot: Floats, noise: float) -> bool:
    """Whether the whole disc under a cylinder is seen, on a level surface."""
    rotation, origin = environment.camera_to_world[:, :3], environment.camera_to_world[:, 3]
    angle = np.arange(16) * np.pi / 8
    ring = np.stack([np.cos(angle), np.zeros(16), np.sin(angle)], axis=1)
    disc = foot + radius * np.concatenate([0.5 * ring, ring])
    seen = (disc - origin) @ rotation
    pixels = _pixels(environment, seen)
    if pixels is None:
        return False
    u, v = pixels
    direction = np.stack(
        [(u + 0.5 - environment.cx) / environment.fx, (v + 0.5 - environment.cy) / environment.fy, np.ones(len(u))],
        axis=1,
    )
    found = (direction * environment.depth[v, u, None]) @ rotation.T + origin
    return bool((np.abs(found[:, 1] - foot[1]) <= noise).all())


def _is_in_view(environment: Environment, footprint: Footprint, foot: Floats, noise: float) -> bool:
    """Whether an upright section through a cylinder, across the view, lies in the frame with nothing before it."""
    rotation, origin = environment.camera_to_world[:, :3], environment.camera_to_world[:, 3]
    across, up = np.meshgrid(np.linspace(-1, 1, 7) * footprint.radius, np.linspace(0.1, 1, 7) * footprint.height)
    upright = foot - origin + up.reshape(-1, 1) * (0.0, 1.0, 0.0)
    seen = (upright + across.reshape(-1, 1) * rotation[:, 0]) @ rotation
    pixels = _pixels(environment, seen)
    if pixels is None:
        return False
    u, v = pixels
    return bool(np.mean(environment.depth[v, u] < seen[:, 2] - noise) <= _BLOCKED)
