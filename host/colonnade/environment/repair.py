"""Judges normals and depth: mends what is slightly or seldom wrong, refuses what mostly is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from colonnade.common.errors import UserError

#: A normal whose length differs from 1 by more than this is no rounding of a unit vector.
_LENGTH_TOLERANCE = 0.1
#: Shares of the pixels: beyond the first the normals are refused, beyond the second, those that face away.
_MAX_BAD_NORMALS = 0.05
_MAX_FACING_AWAY = 0.1
#: The share of pixels without depth that is still filled from their neighbours.
_MAX_HOLES = 0.5


def mended_normals(
    normals: NDArray[np.float64], directions: NDArray[np.float64], file: Path
) -> tuple[NDArray[np.float64], list[str]]:
    """Unit normals in view space, and notes of what was mended; ``directions`` are the pixels' view rays."""
    lengths = np.linalg.norm(normals, axis=2)
    bad = ~(np.abs(lengths - 1.0) <= _LENGTH_TOLERANCE)
    if bad.mean() > _MAX_BAD_NORMALS:
        raise UserError(
            f"{file}: {np.count_nonzero(bad):,} of {bad.size:,} normals are not unit (lengths from"
            f" {np.nanmin(lengths):.2f} to {np.nanmax(lengths):.2f}): store n * 0.5 + 0.5 in three channels"
        )
    notes = []
    if bad.any():
        normals = _filled(normals, bad)
        lengths = np.linalg.norm(normals, axis=2)
        notes.append(f"{np.count_nonzero(bad):,} normals were not unit and were taken from their neighbours")
    normals = normals / lengths[..., np.newaxis]
    away = np.einsum("yxc,yxc->yx", normals, directions) > 0.1 * np.linalg.norm(directions, axis=2)
    if away.mean() > _MAX_FACING_AWAY:
        raise UserError(
            f"{file}: {np.count_nonzero(away):,} of {away.size:,} normals face away from the camera: they must be in"
            " its space, x right, y up, z towards the viewer"
        )
    return normals, notes


def mended_depth(depth: NDArray[np.float64], file: Path) -> tuple[NDArray[np.float64], list[str]]:
    """Depth without holes, and a note of how many there were; NaN, infinity, zero and less are holes."""
    holes = ~(np.isfinite(depth) & (depth > 0))
    count = int(np.count_nonzero(holes))
    if count > _MAX_HOLES * holes.size:
        raise UserError(
            f"{file}: {count:,} of {holes.size:,} pixels have no depth (zero, negative or no number): give a denser"
            " map, or none and let the normals say"
        )
    if not count:
        return depth, []
    return _filled(depth, holes), [f"{count:,} of {holes.size:,} pixels had no depth and took their neighbours'"]


def _filled(values: NDArray[np.float64], holes: NDArray[np.bool_]) -> NDArray[np.float64]:
    """``values`` [height, width, ...] with each hole as its nearest pixel that is none."""
    nearest = ndimage.distance_transform_edt(holes, return_distances=False, return_indices=True)
    filled: NDArray[np.float64] = values[tuple(nearest)]
    return filled
