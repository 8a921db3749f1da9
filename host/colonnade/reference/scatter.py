"""Directions of scattered rays, by the sample points that the device draws (docs/gather.md).

A sample point is a word of two bytes, the pass's XOR the pixel's. It stands for a point of the unit
sphere.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors

Bytes = NDArray[np.uint8]

#: Bits of a pixel's coordinates that count.
COORDINATE_BITS = 10
#: Primitive polynomials and first direction numbers of the third and the fourth dimension of Sobol's sequence
#: (Joe and Kuo 2008).
_SOBOL = ((2, 1, (1, 3)), (3, 1, (1, 3, 1)))


@functools.cache
def pixel_matrix() -> Bytes:
    """The bytes of each bit of a pixel's Morton code (x in the even bits, low ones first), uint8 [20, 2].

    The bytes of a pixel are the XOR over its bits that are set: its point of a Sobol sequence in Morton order.
    """
    columns = []
    for degree, coefficients, first in _SOBOL:
        m = list(first)
        for k in range(degree, 2 * COORDINATE_BITS):
            value = m[k - degree] ^ (m[k - degree] << degree)
            for i in range(1, degree):
                value ^= (coefficients >> (degree - 1 - i) & 1) * (m[k - i] << i)
            m.append(value)
        # m[k] / 2^(k + 1) is a fraction: its highest 8 bits
        columns.append([(value << 8) >> (k + 1) for k, value in enumerate(m)])
    return np.array(columns, dtype=np.uint8).T


def pixel_words(x: NDArray[np.int64], y: NDArray[np.int64]) -> Bytes:
    """The bytes of pixels, uint8 [n, 2], from their coordinates, int64 [n]."""
    words = np.zeros((len(x), 2), np.uint8)
    for bit in range(COORDINATE_BITS):
        for coordinate, row in ((x, 2 * bit), (y, 2 * bit + 1)):
            is_set = (coordinate >> bit & 1).astype(bool)
            words[is_set] ^= pixel_matrix()[row]
    return words


def sphere_points(words: Bytes) -> Floats:
    """The points of the unit sphere that words, uint8 [n, 2], stand for: multiples of 1/256, float64 [n, 3].

    The first byte gives z at the middles of 256 equal intervals, the second the angle about z. All points have equal
    weight.
    """
    z = (255 - 2 * words[:, 0].astype(np.int64)) / 256
    radius = np.rint(256 * np.sqrt(1 - z * z)) / 256
    angle = (words[:, 1] + 0.5) * (np.pi / 128)
    across = [np.rint(256 * radius * np.rint(256 * part) / 256) / 256 for part in (np.cos(angle), np.sin(angle))]
    return np.stack([*across, z], axis=1)


def gathered_directions(axes: Floats, facing: Floats, points: Floats, alpha: Floats) -> Floats:
    """Directions of rays that gather light, of any length, float64 [n, 3].

    At a diffuse surface their density is the cosine to the normal: the normal plus a point of the unit sphere. At rough
    metal half their angle to the axis has the distribution of microfacets (Trowbridge and Reitz, GGX).

    Args:
        axes: Unit, float64 [n, 3]: shading normals of diffuse surfaces; directions that smooth mirrors reflect.
        facing: Unit geometric normals that face the ray, float64 [n, 3]. A direction below is
            negated, or lies on the other side of the lobe's axis.
        points: `sphere_points`, float64 [n, 3].
        alpha: Of rough metal the square of its roughness, else 0, float64 [n].
    """
    lift = 1 - np.einsum("ni,ni->n", points, axes)
    of_metal = [(lift - alpha**2 * (2 - lift))[:, None] * axes, 2 * alpha[:, None] * np.cross(points, axes)]
    along, across = np.where((alpha > 0)[:, None], of_metal, [axes, points])
    is_below = np.einsum("ni,ni->n", along + across, facing) < 0
    directions = np.where(
        is_below[:, None], np.where((alpha > 0)[:, None], along - across, -along - across), along + across
    )
    return np.where(np.abs(directions).max(axis=1, keepdims=True) < 1e-9, axes, directions)


def microfacet_normals(normals: Floats, directions: Floats, points: Floats, alpha: Floats) -> Floats:
    """Unit normals of microfacets (Trowbridge and Reitz, GGX) of mirrors and glass, float64 [n, 3].

    Args:
        normals: Unit shading normals, float64 [n, 3].
        directions: Of the rays, float64 [n, 3]. A normal that faces away from its ray lies on the other side of the
            shading normal.
        points: `sphere_points`, float64 [n, 3].
        alpha: Squares of the roughness, float64 [n].
    """
    lift = 1 - np.einsum("ni,ni->n", points, normals)
    # Where the point is the normal, so is the microfacet
    along, across = lift.clip(min=1e-3)[:, None] * normals, alpha[:, None] * np.cross(points, normals)
    is_away = np.einsum("ni,ni->n", along + across, directions) > 0
    return unit_vectors(along + np.where(is_away[:, None], -across, across))


def lobe_shares(cosines: Floats, alpha: Floats) -> Floats:
    """How brightly rough metal shows a light, as a multiple of what a diffuse surface shows that faces it, float64 [n].

    Args:
        cosines: Of the angle between the light and the direction that a smooth mirror reflects, float64 [n].
        alpha: Squares of the roughness, float64 [n].
    """
    return np.where(cosines > 0, (alpha / (1 - cosines + alpha**2 * (1 + cosines))) ** 2, 0.0)
