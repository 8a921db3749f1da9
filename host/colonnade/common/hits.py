"""Hits files: the triangle and the distance that each pixel's ray hit (`--hits FILE.npz`)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from colonnade.common.array_files import has_array, parse_npz
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
        triangle: int64 [height, width], index of the triangle in the mesh file of its object; -1 where the ray missed.
        t: float64 [height, width], distance along the primary ray, NaN where the ray missed.
        object: int64 [height, width], index of the object in the scene, 0 of a single one; -1 where the ray missed.
            None: a single one.
    """

    triangle: NDArray[np.int64]
    t: NDArray[np.float64]
    object: NDArray[np.int64] | None = None

    def numbers(self) -> NDArray[np.int64]:
        """One number for each object and triangle, -1 for a miss, int64 [height, width]."""
        import numpy as np

        if self.object is None:
            return self.triangle
        return np.where(self.triangle < 0, -1, self.triangle + (self.object << 32))


def write_hits(path: Path, hits: Hits) -> None:
    """Write the hits of a frame as a compressed npz file with the arrays `object`, `triangle` and `t`."""
    import numpy as np

    number = np.minimum(hits.triangle, 0) if hits.object is None else hits.object

    with replacing(path) as stream:
        np.savez_compressed(
            stream,
            object=number.astype(np.int64),
            triangle=hits.triangle.astype(np.int64),
            t=hits.t.astype(np.float64),
        )


def read_hits(path: Path) -> Hits:
    """Read the hits of a frame.

    Raises:
        UserError: The file is missing or is not a hits file.
    """
    import numpy as np

    data = read_input(path, "the hits", MAX_PICTURE_BYTES, f"no hits file {path}: check the path")
    try:
        triangle, t = parse_npz(data, ("triangle", "t"))
        number = np.minimum(triangle, 0)
        if has_array(data, "object"):
            (number,) = parse_npz(data, ("object",))
    except ValueError as error:
        raise UserError(f"{path} is not a hits file: write one with colonnade render --hits ({error})") from None
    shapes, kinds = {number.shape, triangle.shape, t.shape}, (number.dtype.kind, triangle.dtype.kind)
    if triangle.ndim != 2 or len(shapes) > 1 or not set(kinds) <= set("iu") or t.dtype.kind != "f":
        raise UserError(
            f"{path} is not a hits file: object, triangle and t must be three [height, width] arrays of one shape"
        )
    return Hits(triangle.astype(np.int64), t.astype(np.float64), number.astype(np.int64))
