"""Checks normals and depth: repairs a few bad pixels, refuses maps with many."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from colonnade.common import fixed_order
from colonnade.common.errors import UserError

#: Largest difference of a normal's length from 1 that rounding explains.
_LENGTH_TOLERANCE = 0.1
#: Largest fractions of non-unit normals, and of normals that face away from the camera.
_MAX_BAD_NORMALS = 0.05
_MAX_FACING_AWAY = 0.1
#: Largest fraction of pixels without depth.
MAX_HOLES = 0.5
#: Least and largest depth, metres: one and all steps of a depth picture.
_DEPTHS = (1e-6, 1e8)


def repair_normals(
    normals: NDArray[np.float64], directions: NDArray[np.float64], file: Path
) -> tuple[NDArray[np.float64], list[str]]:
    """Normalise normals and replace invalid ones by their nearest valid neighbours.

    Args:
        normals: float64 [height, width, 3], view space.
        directions: float64 [height, width, 3], the pixels' view rays.
        file: For error messages.

    Returns:
        Unit normals, and notes about the repairs.

    Raises:
        UserError: Too many normals are invalid or face away from the camera.
    """
    lengths = np.linalg.norm(normals, axis=2)
    bad = ~(np.abs(lengths - 1.0) <= _LENGTH_TOLERANCE)
    if bad.mean() > _MAX_BAD_NORMALS:
        raise UserError(
            f"{file}: {np.count_nonzero(bad):,} of {bad.size:,} normals are not unit vectors (lengths from"
            f" {np.nanmin(lengths):.2f} to {np.nanmax(lengths):.2f}): store n * 0.5 + 0.5 in three channels"
        )
    notes = []
    if bad.any():
        normals = filled(normals, bad)
        lengths = np.linalg.norm(normals, axis=2)
        notes.append(f"{np.count_nonzero(bad):,} normals were not unit vectors and were replaced by their neighbours'")
    normals = normals / lengths[..., np.newaxis]
    away = fixed_order.dot(normals, directions) > 0.1 * np.linalg.norm(directions, axis=2)
    if away.mean() > _MAX_FACING_AWAY:
        raise UserError(
            f"{file}: {np.count_nonzero(away):,} of {away.size:,} normals face away from the camera: they must be in"
            " its axes, x right, y down, z forward (a map with y up and z towards the viewer: invert green and blue)"
        )
    return normals, notes


def repair_depth(depth: NDArray[np.float64], file: Path) -> tuple[NDArray[np.float64], list[str]]:
    """Fill holes, see `holes_of`, from their nearest neighbours.

    Args:
        depth: float64 [height, width], metres.
        file: For error messages.

    Returns:
        Depth without holes, and notes about the repairs.

    Raises:
        UserError: Too many pixels are holes.
    """
    holes = holes_of(depth)
    count = int(np.count_nonzero(holes))
    if count > MAX_HOLES * holes.size:
        raise UserError(
            f"{file}: {count:,} of {holes.size:,} pixels have no depth (zero, negative or not finite): give a denser"
            " map, or none, to estimate depth from the normals"
        )
    if not count:
        return depth, []
    return filled(depth, holes), [
        f"{count:,} of {holes.size:,} pixels had no depth and were filled from their neighbours"
    ]


def holes_of(depth: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Pixels without depth: NaN, zero or negative, or not from 1e-6 to 1e8 metres, bool [height, width]."""
    low, high = _DEPTHS
    return np.asarray(~((depth >= low) & (depth <= high)))


def filled(values: NDArray[np.float64], holes: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Copy ``values`` [height, width, ...] with each hole replaced by the nearest other pixel."""
    from colonnade import _core

    pixels = values.reshape(holes.size, *values.shape[2:])
    filled: NDArray[np.float64] = pixels[_core.nearest_known(holes)].reshape(values.shape)
    return filled
