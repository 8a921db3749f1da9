"""Planes in inverse depth: their memory words, and their conversion to 3-D planes.

In the camera's image, the inverse depth w = depth_unit / z of a plane is linear:

    w = (A * (u - width / 2) + B * (v - height / 2)) / 1024 + C

at the continuous image coordinates (u, v), with pixel centres at + 0.5. A word holds, low bit first, A, B and C (20
signed bits each) and an exponent e (4 bits). Each coefficient is its field times 2^(e - 22).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.common import fixed_order
from colonnade.environment.model import Environment

FIELD_BITS = 20
EXPONENT_BITS = 4
#: Fraction bits of a coefficient whose exponent is 0.
FRACTION = 22
#: A and B are slopes per this number of pixels.
SLOPE_PIXELS = 1024

_HALF = 1 << (FIELD_BITS - 1)
_MASK = (1 << FIELD_BITS) - 1


def pack_planes(coefficients: NDArray[np.float64]) -> NDArray[np.uint64]:
    """Pack planes A, B, C, float64 [n, 3], with the smallest exponent that fits; the largest exponent saturates."""
    exponent = np.full(len(coefficients), (1 << EXPONENT_BITS) - 1)
    for e in range((1 << EXPONENT_BITS) - 2, -1, -1):
        fields = np.rint(np.ldexp(coefficients, FRACTION - e))
        exponent[((fields >= -_HALF) & (fields < _HALF)).all(axis=1)] = e
    fields = np.rint(np.ldexp(coefficients, (FRACTION - exponent)[:, np.newaxis]))
    whole = np.clip(fields, -_HALF, _HALF - 1).astype(np.int64) & _MASK
    low = whole.astype(np.uint64)
    a, b, c = low[:, 0], low[:, 1] << np.uint64(FIELD_BITS), low[:, 2] << np.uint64(2 * FIELD_BITS)
    words: NDArray[np.uint64] = a | b | c | exponent.astype(np.uint64) << np.uint64(3 * FIELD_BITS)
    return words


def unpack_planes(words: NDArray[np.uint64]) -> NDArray[np.float64]:
    """Unpack words to planes A, B, C, float64 [n, 3]."""
    shifts = np.arange(3, dtype=np.uint64) * np.uint64(FIELD_BITS)
    fields = ((words[:, np.newaxis] >> shifts) & np.uint64(_MASK)).astype(np.int64)
    fields -= (fields >> (FIELD_BITS - 1)) << FIELD_BITS
    exponent = (words >> np.uint64(3 * FIELD_BITS)).astype(np.int64)
    return np.ldexp(fields.astype(np.float64), (exponent - FRACTION)[:, np.newaxis])


@dataclass(frozen=True)
class PlaneProjection:
    """Converts between planes in the image's inverse depth and planes in view space.

    Attributes:
        width, height: Size of the image, pixels.
        fx, fy, cx, cy: Focal lengths and principal point of the camera, pixels.
        depth_unit: Depth of w = 1, metres: w = depth_unit / depth.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    depth_unit: float

    @staticmethod
    def of(environment: Environment, depth_unit: float) -> PlaneProjection:
        """The projection of an environment's maps."""
        return PlaneProjection(
            environment.width,
            environment.height,
            environment.fx,
            environment.fy,
            environment.cx,
            environment.cy,
            depth_unit,
        )

    def basis(self) -> NDArray[np.float64]:
        """Factors of A, B and C at the pixel centres: float64 [height, width, 3]."""
        basis = np.ones((self.height, self.width, 3))
        basis[..., 0] = (np.arange(self.width) + 0.5 - self.width / 2) / SLOPE_PIXELS
        basis[..., 1] = ((np.arange(self.height) + 0.5 - self.height / 2) / SLOPE_PIXELS)[:, np.newaxis]
        return basis

    def planes(self, normals: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Planes A, B, C, float64 [n, 3], through view-space points with these normals, float64 [n, 3] each."""
        offset = fixed_order.dot(normals, points)
        a, b, c = (normals * (self.depth_unit / offset)[:, np.newaxis]).T
        a, b = a / self.fx, b / self.fy
        c = c + a * (self.width / 2 - self.cx) + b * (self.height / 2 - self.cy)
        return np.stack([a * SLOPE_PIXELS, b * SLOPE_PIXELS, c], axis=1)

    def dual_vectors(self, planes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Vectors q of planes A, B, C with q . P = 1 for all points P: float64 [n, 3], view space, 1/metres."""
        a, b = planes[:, 0] / SLOPE_PIXELS, planes[:, 1] / SLOPE_PIXELS
        c = planes[:, 2] + a * (self.cx - self.width / 2) + b * (self.cy - self.height / 2)
        return np.stack([a * self.fx, b * self.fy, c], axis=1) / self.depth_unit

    def normals(self, planes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Unit normals of planes A, B, C, towards the camera: float64 [n, 3], view space."""
        q = -self.dual_vectors(planes)
        lengths = np.linalg.norm(q, axis=1, keepdims=True)
        normals: NDArray[np.float64] = q / np.where(lengths > 0, lengths, 1.0)
        return normals
