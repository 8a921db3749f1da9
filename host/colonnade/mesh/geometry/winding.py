"""Winding of closed parts: counter-clockwise seen from outside, as glass needs to know its inside.

A *part* is a set of faces that are connected over edges of two faces. It is closed if each of its edges has two of its
faces. Open parts are left alone: their front is whatever their author says.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from colonnade.common.types import Floats
from colonnade.mesh.geometry.topology import Faces


@dataclass(frozen=True)
class Winding:
    """What a repair has to reverse.

    Attributes:
        reversed: Faces to reverse, bool [m].
        mixed: Closed parts whose faces disagreed.
        inverted: Closed parts whose faces agreed, but pointed inward.
        is_open: Faces of open parts, bool [m].
    """

    reversed: npt.NDArray[np.bool_]
    mixed: int
    inverted: int
    is_open: npt.NDArray[np.bool_]


def find_winding(vertices: Floats, faces: Faces) -> Winding:
    """Find the faces of closed parts to reverse, so that all point outward.

    A part whose faces agree and point inward may be the wall of a cavity: it is left alone if it lies in an odd number
    of other closed parts.

    Args:
        vertices: float64 [n, 3], merged by position.
        faces: int32 [m, 3], each with an area.
    """
    from colonnade import _core

    return Winding(*_core.find_winding(vertices, faces))
