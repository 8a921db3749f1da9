"""Reflection and refraction at mirrors and glass in float64: docs/shading.md, "Materials and paths"."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors


@dataclass(frozen=True)
class Bounces:
    """Rays that leave specular surfaces.

    Attributes:
        directions: Unit directions of the next rays, float64 [n, 3].
        refracted: The next ray passes through the surface, bool [n].
        fresnel_directions: Unit directions of the Fresnel reflections, float64 [n, 3].
        fresnel_weights: Schlick's reflectance where the ray is refracted at a front side, else 0, float64 [n].
    """

    directions: Floats
    refracted: NDArray[np.bool_]
    fresnel_directions: Floats
    fresnel_weights: Floats


def bounce(
    directions: Floats, normals: Floats, facing: Floats, front: NDArray[np.bool_], glass: NDArray[np.bool_], ior: Floats
) -> Bounces:
    """Reflect or refract rays.

    The geometric normal replaces a shading normal that faces away from the ray. It also replaces one that scatters the
    ray to the wrong side of the surface.

    Args:
        directions: Unit directions, float64 [n, 3].
        normals: Unit shading normals that face the ray, float64 [n, 3].
        facing: Unit geometric normals that face the ray, float64 [n, 3].
        front: The ray hits the triangle's front, bool [n].
        glass: The material is glass and not a mirror, bool [n].
        ior: Index of refraction, float64 [n].
    """
    eta = np.where(front, 1 / ior, ior)
    scattered, refracted = _scatter(normals, directions, glass, eta)
    side = _dot(scattered, facing)
    is_wrong = (_dot(normals, directions) >= 0) | np.where(refracted, side >= 0, side <= 0)
    normals = np.where(is_wrong[:, None], facing, normals)
    scattered, refracted = _scatter(normals, directions, glass, eta)
    cosine = -_dot(normals, directions)
    at_normal = ((ior - 1) / (ior + 1)) ** 2
    schlick = at_normal + (1 - at_normal) * (1 - cosine.clip(0, 1)) ** 5
    return Bounces(scattered, refracted, reflect(normals, directions), np.where(refracted & front, schlick, 0.0))


def _scatter(
    normals: Floats, directions: Floats, glass: NDArray[np.bool_], eta: Floats
) -> tuple[Floats, NDArray[np.bool_]]:
    """Directions after the surface, and whether they are refracted and not reflected."""
    cosine = -_dot(normals, directions)
    discriminant = 1 - eta**2 * (1 - cosine**2)
    refracted = glass & (discriminant >= 0) & (cosine > 0)
    normal_scale = eta * cosine - np.sqrt(discriminant.clip(min=0))
    transmitted = unit_vectors(eta[:, None] * directions + normal_scale[:, None] * normals)
    return np.where(refracted[:, None], transmitted, reflect(normals, directions)), refracted


def reflect(normals: Floats, directions: Floats) -> Floats:
    """Directions of mirrored rays, unit, float64 [n, 3]; unit normals and directions."""
    return unit_vectors(directions - 2 * _dot(normals, directions)[:, None] * normals)


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("ni,ni->n", a, b), dtype=np.float64)
