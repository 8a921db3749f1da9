"""Values over time between keys, as glTF 2.0 defines them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Literal, get_args

from colonnade.common.types import Floats

Interpolation = Literal["STEP", "LINEAR", "CUBICSPLINE"]
Path = Literal["translation", "rotation", "scale", "weights"]


@dataclass(frozen=True)
class Animation:
    """An animation of a glTF file.

    Attributes:
        name: Its name, or its number from 0.
        file: The file; None: the mesh's.
    """

    name: str
    file: FilePath | None = None


@dataclass(frozen=True)
class Track:
    """One property of one node over time. Before the first and after the last key it has their value.

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

    @property
    def numbers(self) -> tuple[int, int, int, Floats, Floats]:
        """The track as ``cpp/mesh/clip.hpp`` has it."""
        path, kind = get_args(Path).index(self.path), get_args(Interpolation).index(self.interpolation)
        return self.node, path, kind, self.times, self.values.reshape(-1)
