"""Hits files: the triangle and the distance that each pixel's ray hit (`--hits FILE.npz`)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from colonnade.common.array_files import parse_npz
from colonnade.common.atomic_files import replacing
from colonnade.common.errors import UserError
from colonnade.common.input_files import read_input
from colonnade.common.limits import MAX_PICTURE_BYTES

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True)
class Hits:
    """The hits of one frame.

    Attributes:
        triangle: int64 [height, width], index of the triangle in the mesh file; -1 where the ray missed.
        t: float64 [height, width], distance along the primary ray, NaN where the ray missed.
    """

    triangle: NDArray[np.int64]
    t: NDArray[np.float64]


def write_hits(path: Path, hits: Hits) -> None:
    """Write the hits of a frame as a compressed npz file with the arrays `triangle` and `t`."""
    import numpy as np

    with replacing(path) as stream:
        np.savez_compressed(stream, triangle=hits.triangle.astype(np.int64), t=hits.t.astype(np.float64))


def read_hits(path: Path) -> Hits:
    """Read the hits of a frame.

    Raises:
        UserError: The file is missing or is not a hits file.
    """
    import numpy as np

    data = read_input(path, "the hits", MAX_PICTURE_BYTES, f"no hits file {path}: check the path")
    try:
        triangle, t = parse_npz(data, ("triangle", "t"))
    except ValueError as error:
        raise UserError(f"{path} is not a hits file: write one with colonnade render --hits ({error})") from None
    if triangle.ndim != 2 or t.shape != triangle.shape or triangle.dtype.kind not in "iu" or t.dtype.kind != "f":
        raise UserError(f"{path} is not a hits file: triangle and t must be two [height, width] arrays of one shape")
    return Hits(triangle.astype(np.int64), t.astype(np.float64))
