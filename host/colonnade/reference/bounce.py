"""Where a path goes on from a mirror or from glass: docs/shading.md, "Materials and paths", in floats."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors


@dataclass(frozen=True)
class Bounces:
    """What becomes of rays.

    Attributes:
        directions: float64 [n, 3], unit, of the rays that go on.
        refracted: bool [n], they go on through the surface.
        reflections: float64 [n, 3], unit: of Schlick's part, which meets the background only.
        shares: float64 [n], how much Schlick's part takes; 0 where there is none.
    """

    directions: Floats
    refracted: NDArray[np.bool_]
    reflections: Floats
    shares: Floats


def bounce(
    directions: Floats, normals: Floats, facing: Floats, front: NDArray[np.bool_], glass: NDArray[np.bool_], ior: Floats
) -> Bounces:
    """Reflect or refract rays.

    The shading normal holds unless it turns away from the ray or would send the ray to the wrong side of the surface:
    then the geometric one takes its place.

    Args:
        directions: float64 [n, 3], unit.
        normals: Shading normals against the ray, float64 [n, 3], unit.
        facing: Geometric normals against the ray, float64 [n, 3], unit.
        front: bool [n], the ray meets the triangle's front.
        glass: bool [n]; the others are mirrors.
        ior: Index of refraction, float64 [n].
    """
    eta = np.where(front, 1 / ior, ior)
    following, refracted = _about(normals, directions, glass, eta)
    side = _dot(following, facing)
    astray = (_dot(normals, directions) >= 0) | np.where(refracted, side >= 0, side <= 0)
    about = np.where(astray[:, None], facing, normals)
    following, refracted = _about(about, directions, glass, eta)
    cosine = -_dot(about, directions)
    head_on = ((ior - 1) / (ior + 1)) ** 2
    schlick = head_on + (1 - head_on) * (1 - cosine.clip(0, 1)) ** 5
    return Bounces(following, refracted, _reflected(about, directions), np.where(refracted & front, schlick, 0.0))


def _about(
    normals: Floats, directions: Floats, glass: NDArray[np.bool_], eta: Floats
) -> tuple[Floats, NDArray[np.bool_]]:
    """Directions after one normal, and whether they go through: mirrors and total reflection do not."""
    cosine = -_dot(normals, directions)
    rest = 1 - eta**2 * (1 - cosine**2)
    refracted = glass & (rest >= 0) & (cosine > 0)
    deeper = eta * cosine - np.sqrt(rest.clip(min=0))
    through = unit_vectors(eta[:, None] * directions + deeper[:, None] * normals)
    return np.where(refracted[:, None], through, _reflected(normals, directions)), refracted


def _reflected(normals: Floats, directions: Floats) -> Floats:
    return unit_vectors(directions - 2 * _dot(normals, directions)[:, None] * normals)


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("ni,ni->n", a, b), dtype=np.float64)
