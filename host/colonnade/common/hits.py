"""Files of hits: which triangle each pixel's ray met, and how far away (`--hits FILE.npz`)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from colonnade.common.array_files import arrays_in
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
        triangle: int64 [height, width], index of the face in the mesh's file; -1 where the ray missed.
        t: float64 [height, width], distance along the primary ray; not a number where the ray missed.
    """

    triangle: NDArray[np.int64]
    t: NDArray[np.float64]


def write_hits(path: Path, hits: Hits) -> None:
    """Write the hits of a frame as a compressed npz file with the arrays `triangle` and `t`."""
    import numpy as np

    with replacing(path) as stream:
        np.savez_compressed(stream, triangle=hits.triangle.astype(np.int64), t=hits.t.astype(np.float64))


def read_hits(path: Path) -> Hits:
    """Read the hits of a frame, or say what is wrong with the file."""
    import numpy as np

    data = read_input(path, "the hits", MAX_PICTURE_BYTES, f"no hits file {path}: check the path")
    try:
        triangle, t = arrays_in(data, ("triangle", "t"))
    except ValueError as error:
        raise UserError(f"{path} is no hits file: write one with colonnade render --hits ({error})") from None
    if triangle.ndim != 2 or t.shape != triangle.shape or triangle.dtype.kind not in "iu" or t.dtype.kind != "f":
        raise UserError(f"{path} is no hits file: triangle and t are not two equal [height, width] arrays")
    return Hits(triangle.astype(np.int64), t.astype(np.float64))
