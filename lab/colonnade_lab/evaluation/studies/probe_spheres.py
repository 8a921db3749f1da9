"""Probe rays into a room, from mirror, matt and glass spheres that stand in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors
from colonnade.reference.bounce import bounce
from numpy.typing import NDArray

if TYPE_CHECKING:
    from colonnade.environment.model import Environment


#: Radius of a sphere, metres.
RADIUS = 0.15
#: Number of spheres in a room.
SPHERES = 6
#: Width and height of a sphere's picture, pixels.
PICTURE = 128
#: The map shows a point if the depths differ by at most this share.
SUPPORT = 0.02
#: Index of refraction of the glass.
IOR = 1.5


@dataclass(frozen=True)
class Rays:
    """Rays in view space, metres.

    Attributes:
        origins, directions: float64 [n, 3]; directions are unit vectors.
        pixels: Pixel index in the picture of the ray's sphere, in row order, -1 without a picture, int64 [n].
    """

    origins: Floats
    directions: Floats
    pixels: NDArray[np.int64]


def standing_spheres(environment: Environment, count: int = SPHERES, radius: float = RADIUS) -> Floats:
    """Centres of spheres that stand on level surfaces, are in full view and touch nothing, float64 [k, 3].

    Candidates lie on a grid of 8 pixels. The first centre is the nearest to the camera's axis; each further one is the
    farthest from all before.
    """
    points = environment.points()
    up = environment.camera_to_world[1, :3]
    rows, columns = np.mgrid[4 : environment.height : 8, 4 : environment.width : 8].reshape(2, -1)
    level = environment.normals[rows, columns] @ up > 0.95
    centres = points[rows, columns][level] + up * radius * 1.01
    surroundings = points[::2, ::2].reshape(-1, 3)
    free = [bool((np.linalg.norm(surroundings - centre, axis=1) > radius).all()) for centre in centres]
    centres = centres[np.array(free, dtype=bool)]
    usable = [
        _is_visible(environment, centre, radius) and _is_supported(environment, centre, radius) for centre in centres
    ]
    centres = centres[np.array(usable, dtype=bool)]
    if len(centres) == 0:
        return np.empty((0, 3))
    chosen = [int(np.argmin(np.hypot(centres[:, 0], centres[:, 1]) / centres[:, 2]))]
    while len(chosen) < min(count, len(centres)):
        gaps = np.linalg.norm(centres[:, None] - centres[chosen], axis=2).min(axis=1)
        chosen.append(int(np.argmax(gaps)))
    return np.asarray(centres[chosen], dtype=np.float64)


def _project(environment: Environment, point: Floats) -> tuple[float, float]:
    """Position (u, v) of a point of view space, float64 [3], in the maps, pixels."""
    return (
        point[0] / point[2] * environment.fx + environment.cx,
        point[1] / point[2] * environment.fy + environment.cy,
    )


def _is_visible(environment: Environment, centre: Floats, radius: float) -> bool:
    """Whether the whole sphere is in the view and nothing occludes it."""
    u, v = _project(environment, centre)
    extent = 1.1 * radius / (centre[2] - radius) * max(environment.fx, environment.fy)
    if not (extent <= u < environment.width - extent and extent <= v < environment.height - extent):
        return False
    depth = environment.depth[int(v - extent) : int(v + extent) + 1, int(u - extent) : int(u + extent) + 1]
    return bool((depth > centre[2] - radius).all())


def _is_supported(environment: Environment, centre: Floats, radius: float) -> bool:
    """Whether the map shows the supporting surface one radius to the left, right, front and back of the sphere."""
    axes = environment.camera_to_world[:, :3].T
    foot = centre - axes[:, 1] * radius
    for side in (axes[:, 0], -axes[:, 0], axes[:, 2], -axes[:, 2]):
        point = foot + radius * side
        u, v = _project(environment, point)
        if not (0 <= u < environment.width and 0 <= v < environment.height):
            return False
        if abs(environment.depth[int(v), int(u)] - point[2]) > SUPPORT * point[2]:
            return False
    return True


def mirror_rays(centre: Floats, radius: float = RADIUS) -> Rays:
    """Reflections of the camera's rays at a mirror sphere, one for each pixel of its picture that shows it."""
    directions, pixels = _picture_rays(centre, radius)
    points = _first_hits(directions, centre, radius)
    normals = (points - centre) / radius
    none = np.zeros(len(points), dtype=np.bool_)
    reflected = bounce(directions, normals, normals, ~none, none, np.full(len(points), IOR))
    return Rays(points + 1e-4 * normals, reflected.directions, pixels)


def glass_rays(centre: Floats, radius: float = RADIUS) -> Rays:
    """The camera's rays after both refractions at a glass sphere; pixels as in `mirror_rays`."""
    directions, pixels = _picture_rays(centre, radius)
    points = _first_hits(directions, centre, radius)
    normals, everywhere = (points - centre) / radius, np.ones(len(points), dtype=np.bool_)
    inside = bounce(directions, normals, normals, everywhere, everywhere, np.full(len(points), IOR)).directions
    exits = points - 2 * radius * np.einsum("ni,ni->n", inside, normals)[:, None] * inside
    inward = (centre - exits) / radius
    refracted = bounce(inside, inward, inward, ~everywhere, everywhere, np.full(len(points), IOR)).directions
    return Rays(exits - 1e-4 * inward, refracted, pixels)


def cosine_rays(centre: Floats, count: int, random: np.random.Generator, radius: float = RADIUS) -> Rays:
    """Rays from uniform points on the sphere with cosine-distributed directions."""
    normals = unit_vectors(random.normal(size=(count, 3)))
    directions = unit_vectors(normals + unit_vectors(random.normal(size=(count, 3))))
    return Rays(centre + (radius + 1e-4) * normals, directions, np.full(count, -1, dtype=np.int64))


def _picture_rays(centre: Floats, radius: float) -> tuple[Floats, NDArray[np.int64]]:
    """Unit directions from the camera through the pixels of the sphere's picture that show it, and these pixels."""
    distance = float(np.linalg.norm(centre))
    forward = centre / distance
    right = unit_vectors(np.cross([0.0, 1.0, 0.0], forward)[None])[0]
    edge = radius / np.sqrt(distance**2 - radius**2)
    y, x = (np.mgrid[:PICTURE, :PICTURE] + 0.5).reshape(2, -1) / PICTURE * 2 - 1
    directions = unit_vectors(forward + edge * (x[:, None] * right + y[:, None] * np.cross(forward, right)))
    hits = directions @ forward > distance / np.hypot(distance, radius) + 1e-6
    hits &= np.linalg.norm(np.cross(directions, centre), axis=1) < radius * 0.999
    return directions[hits], np.flatnonzero(hits)


def _first_hits(directions: Floats, centre: Floats, radius: float) -> Floats:
    """First hits of the camera's rays on the sphere, float64 [n, 3]."""
    along = directions @ centre
    t = along - np.sqrt((along**2 - centre @ centre + radius**2).clip(min=0))
    return np.asarray(t[:, None] * directions, dtype=np.float64)
