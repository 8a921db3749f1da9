"""Light from the walls of a box around a room, in patches: the large sources of a fit, such as windows and ceilings."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from colonnade.common import fixed_order
from colonnade.common.types import Floats

#: Patches along each edge of a wall, and points along each edge of a patch that stand for it.
_PATCHES, _POINTS = 2, 4
PATCHES = 6 * _PATCHES**2
#: A point of a patch is no nearer than this, metres.
_NEAREST = 0.22


@dataclass(frozen=True)
class Surround:
    """A box whose walls shine.

    Attributes:
        low, high: Corners, world space, metres, float64 [3].
        radiance: Linear, float64 [PATCHES, 3]. The walls are in the order of the faces of a `LightCube`; rows of a
            wall's patches part its next axis, columns the one after it.
    """

    low: Floats
    high: Floats
    radiance: Floats

    def at(self, point: Floats, directions: Floats) -> Floats:
        """The light that reaches a point from directions, float64 [n, 3], if nothing is in the way, float64 [n, 3]."""
        inside = np.clip(point, self.low + 1e-3, self.high - 1e-3)
        with np.errstate(divide="ignore"):
            steps = np.where(directions > 0, self.high - inside, inside - self.low) / np.abs(directions)
        axis, rows = steps.argmin(axis=1), np.arange(len(directions))
        place = (inside + steps[rows, axis][:, None] * directions - self.low) / (self.high - self.low)
        cell = np.clip(np.floor(place * _PATCHES), 0, _PATCHES - 1).astype(np.intp)
        index = 2 * axis + (directions[rows, axis] < 0)
        for further in (1, 2):
            index = index * _PATCHES + cell[rows, (axis + further) % 3]
        return np.asarray(self.radiance[index])


def wall_exposures(points: Floats, normals: Floats, low: Floats, high: Floats) -> Floats:
    """Irradiance of unshadowed surfaces in a box by each of its patches with a radiance of 1, over π.

    All patches together have 1, as in a closed room.

    Args:
        points: World space, float64 [n, 3].
        normals: Unit, world space, float64 [n, 3].
        low: Least corner of the box, float64 [3].
        high: Greatest corner of the box, float64 [3].

    Returns:
        float64 [n, PATCHES].
    """
    columns = []
    steps = (np.arange(_PATCHES * _POINTS) + 0.5) / (_PATCHES * _POINTS)
    for axis, sign in itertools.product(range(3), (0, 1)):
        second, third = (axis + 1) % 3, (axis + 2) % 3
        area = (high[second] - low[second]) * (high[third] - low[third]) / len(steps) ** 2
        for row, column in itertools.product(range(_PATCHES), range(_PATCHES)):
            total = np.zeros(len(points))
            for u, v in itertools.product(steps[row * _POINTS :][:_POINTS], steps[column * _POINTS :][:_POINTS]):
                source = np.empty(3)
                source[axis] = low[axis] if sign else high[axis]
                source[second] = low[second] + u * (high[second] - low[second])
                source[third] = low[third] + v * (high[third] - low[third])
                towards = source - points
                squared = fixed_order.dot(towards, towards).clip(min=_NEAREST**2)
                leaving = (-towards[:, axis] if sign else towards[:, axis]).clip(min=0.0)
                total += fixed_order.dot(normals, towards).clip(min=0.0) * leaving / squared**2
            columns.append(total * area / np.pi)
    exposures = np.stack(columns, axis=1)
    return np.asarray(exposures / exposures.sum(axis=1, keepdims=True).clip(min=1e-9))


def non_negative_least_squares(gram: Floats, moment: Floats) -> Floats:
    """The minimum of x'Gx - 2 m'x with x >= 0, by descent along one coordinate after the other, float64 [k]."""
    solution = np.zeros(len(moment))
    for _ in range(_SWEEPS):
        for index in range(len(moment)):
            slope = moment[index] - fixed_order.dot(gram[index], solution)
            solution[index] = max(0.0, solution[index] + slope / gram[index, index])
    return solution


#: Descents along all coordinates; more change nothing in four digits.
_SWEEPS = 100
