"""Values over time between keys, as glTF 2.0 defines them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from colonnade.common import fixed_order
from colonnade.common.types import Floats

Interpolation = Literal["STEP", "LINEAR", "CUBICSPLINE"]
Path = Literal["translation", "rotation", "scale", "weights"]

#: Cosine of half an angle from which on a chord stands for the arc.
_NEAR = 1.0 - 1e-9


@dataclass(frozen=True)
class Track:
    """One property of one node over time.

    Attributes:
        node: The node.
        path: The property.
        times: Seconds, ascending, float64 [k], k ≥ 1.
        values: At the keys, float64 [k, w]; of a cubic spline with the tangents before and after, [k, 3, w].
        interpolation: Between keys.
    """

    node: int
    path: Path
    times: Floats
    values: Floats
    interpolation: Interpolation

    def at(self, time: float, before: bool = False) -> Floats:
        """The value at a time, or just before it, float64 [w]. Before the first and after the last key it is theirs."""
        place = int(np.searchsorted(self.times, time, side="left" if before else "right")) - 1
        is_spline = self.interpolation == "CUBICSPLINE"
        keys = self.values[:, 1] if is_spline else self.values
        if place < 0 or place == len(self.times) - 1 or self.interpolation == "STEP":
            return self._unit(keys[max(place, 0)])
        span = float(self.times[place + 1] - self.times[place])
        part = (time - float(self.times[place])) / span
        if is_spline:
            after, into = span * self.values[place, 2], span * self.values[place + 1, 0]
            squared, cubed = part * part, part * part * part
            return self._unit(
                (2 * cubed - 3 * squared + 1) * keys[place]
                + (cubed - 2 * squared + part) * after
                + (3 * squared - 2 * cubed) * keys[place + 1]
                + (cubed - squared) * into
            )
        if self.path == "rotation":
            return _arc(self._unit(keys[place]), self._unit(keys[place + 1]), part)
        return np.asarray(keys[place] + part * (keys[place + 1] - keys[place]))

    def _unit(self, value: Floats) -> Floats:
        if self.path != "rotation":
            return value
        length = np.sqrt(fixed_order.dot(value, value))
        return np.asarray(value / length) if length > 0 else np.array([0.0, 0.0, 0.0, 1.0])


def _arc(first: Floats, last: Floats, part: float) -> Floats:
    """Between two rotations, on the shorter arc of the unit sphere."""
    cosine = float(fixed_order.dot(first, last))
    if cosine < 0:
        last, cosine = -last, -cosine
    if cosine > _NEAR:
        value = first + part * (last - first)
        return np.asarray(value / np.sqrt(fixed_order.dot(value, value)))
    angle = fixed_order.arccos(np.array([cosine]))
    weights = fixed_order.sin(angle * np.array([1.0 - part, part])) / fixed_order.sin(angle)
    return np.asarray(weights[0] * first + weights[1] * last)
