"""Rays that ask a rebuilt room: from spheres that stand in it, as a mirror, a matt and a glass sphere send them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors
from colonnade.reference.bounce import bounce

if TYPE_CHECKING:
    from colonnade.environment.model import Environment


#: Radius of a sphere, metres.
RADIUS = 0.15
#: Spheres in a room, and the edge of the picture that is taken of each, pixels.
SPHERES = 6
PICTURE = 128
#: The map shows the surface at a place if its depth is within this share of the place's.
SUPPORT = 0.02
#: Index of refraction of the glass.
IOR = 1.5


@dataclass(frozen=True)
class Rays:
    """Rays in view space, metres.

    Attributes:
        origins, directions: float64 [n, 3]; directions are unit.
        pixels: int64 [n], where in the picture of its sphere each belongs, row by row; -1 for rays of no picture.
    """

    origins: Floats
    directions: Floats
    pixels: NDArray[np.int64]


def standing_spheres(environment: Environment, count: int = SPHERES, radius: float = RADIUS) -> Floats:
    """Centres of spheres that stand on level surfaces as wide as themselves, whole in the view, touching nothing.

    Of all places on a grid of 8 pixels the first is the one nearest to the camera's axis, each further one the farthest
    from those before: float64 [k, 3].
    """
    points = environment.points()
    up = environment.camera_to_world[1, :3]
    rows, columns = np.mgrid[4 : environment.height : 8, 4 : environment.width : 8].reshape(2, -1)
    level = environment.normals[rows, columns] @ up > 0.95
    centres = points[rows, columns][level] + up * radius * 1.01
    around = points[::2, ::2].reshape(-1, 3)
    free = [bool((np.linalg.norm(around - centre, axis=1) > radius).all()) for centre in centres]
    centres = centres[np.array(free, dtype=bool)]
    seen = [_is_seen(environment, centre, radius) and _is_carried(environment, centre, radius) for centre in centres]
    centres = centres[np.array(seen, dtype=bool)]
    if len(centres) == 0:
        return np.empty((0, 3))
    chosen = [int(np.argmin(np.hypot(centres[:, 0], centres[:, 1]) / centres[:, 2]))]
    while len(chosen) < min(count, len(centres)):
        gaps = np.linalg.norm(centres[:, None] - centres[chosen], axis=2).min(axis=1)
        chosen.append(int(np.argmax(gaps)))
    return np.asarray(centres[chosen], dtype=np.float64)


def _is_seen(environment: Environment, centre: Floats, radius: float) -> bool:
    """Whether the whole sphere is in the view and nothing stands before it."""
    u, v = (
        centre[0] / centre[2] * environment.fx + environment.cx,
        centre[1] / centre[2] * environment.fy + environment.cy,
    )
    reach = 1.1 * radius / (centre[2] - radius) * max(environment.fx, environment.fy)
    if not (reach <= u < environment.width - reach and reach <= v < environment.height - reach):
        return False
    part = environment.depth[int(v - reach) : int(v + reach) + 1, int(u - reach) : int(u + reach) + 1]
    return bool((part > centre[2] - radius).all())


def _is_carried(environment: Environment, centre: Floats, radius: float) -> bool:
    """Whether the map shows the surface that it stands on a radius to the left, right, front and back."""
    axes = environment.camera_to_world[:, :3].T
    foot = centre - axes[:, 1] * radius
    for side in (axes[:, 0], -axes[:, 0], axes[:, 2], -axes[:, 2]):
        place = foot + radius * side
        u, v = (
            place[0] / place[2] * environment.fx + environment.cx,
            place[1] / place[2] * environment.fy + environment.cy,
        )
        if not (0 <= u < environment.width and 0 <= v < environment.height):
            return False
        if abs(environment.depth[int(v), int(u)] - place[2]) > SUPPORT * place[2]:
            return False
    return True


def mirror_rays(centre: Floats, radius: float = RADIUS) -> Rays:
    """A mirror sphere's reflections of the camera's rays: one for each pixel of its picture that shows it."""
    directions, pixels = _picture_rays(centre, radius)
    points = _first_meeting(directions, centre, radius)
    normals = (points - centre) / radius
    none = np.zeros(len(points), dtype=np.bool_)
    next_ = bounce(directions, normals, normals, ~none, none, np.full(len(points), IOR))
    return Rays(points + 1e-4 * normals, next_.directions, pixels)


def glass_rays(centre: Floats, radius: float = RADIUS) -> Rays:
    """A glass sphere's rays after both refractions, as of `mirror_rays`."""
    directions, pixels = _picture_rays(centre, radius)
    points = _first_meeting(directions, centre, radius)
    normals, whole = (points - centre) / radius, np.ones(len(points), dtype=np.bool_)
    inside = bounce(directions, normals, normals, whole, whole, np.full(len(points), IOR)).directions
    leaving = points - 2 * radius * np.einsum("ni,ni->n", inside, normals)[:, None] * inside
    back = (centre - leaving) / radius
    after = bounce(inside, back, back, ~whole, whole, np.full(len(points), IOR)).directions
    return Rays(leaving - 1e-4 * back, after, pixels)


def cosine_rays(centre: Floats, count: int, random: np.random.Generator, radius: float = RADIUS) -> Rays:
    """Rays from points all over the sphere, their directions distributed as the cosine to the normal."""
    normals = unit_vectors(random.normal(size=(count, 3)))
    directions = unit_vectors(normals + unit_vectors(random.normal(size=(count, 3))))
    return Rays(centre + (radius + 1e-4) * normals, directions, np.full(count, -1, dtype=np.int64))


def _picture_rays(centre: Floats, radius: float) -> tuple[Floats, NDArray[np.int64]]:
    """Unit directions from the camera to a square picture around the sphere, those that meet it, and their pixels."""
    distance = float(np.linalg.norm(centre))
    forward = centre / distance
    right = unit_vectors(np.cross([0.0, 1.0, 0.0], forward)[None])[0]
    edge = radius / np.sqrt(distance**2 - radius**2)
    y, x = (np.mgrid[:PICTURE, :PICTURE] + 0.5).reshape(2, -1) / PICTURE * 2 - 1
    directions = unit_vectors(forward + edge * (x[:, None] * right + y[:, None] * np.cross(forward, right)))
    meets = directions @ forward > distance / np.hypot(distance, radius) + 1e-6
    meets &= np.linalg.norm(np.cross(directions, centre), axis=1) < radius * 0.999
    return directions[meets], np.flatnonzero(meets)


def _first_meeting(directions: Floats, centre: Floats, radius: float) -> Floats:
    """Where rays from the camera meet the sphere first, float64 [n, 3]."""
    along = directions @ centre
    t = along - np.sqrt((along**2 - centre @ centre + radius**2).clip(min=0))
    return np.asarray(t[:, None] * directions, dtype=np.float64)
