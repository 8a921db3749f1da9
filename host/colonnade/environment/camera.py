"""Reads a room's camera from ``meta.json``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colonnade.common.errors import UserError
from colonnade.environment.model import EnvironmentCamera

#: Largest principal point or focal length, and smallest focal length, pixels.
_MAX_PIXELS = 1e6
_MIN_FOCAL = 1.0
#: Largest distance of the camera from the world's origin on an axis, metres.
_MAX_METRES = 1e6
#: Tolerance of a pose's axes: unit length and right angles.
_AXES_TOLERANCE = 1e-3


def read_camera(data: dict[str, Any], file: Path) -> EnvironmentCamera:
    """Read focal lengths, principal point and pose.

    ``cam_to_world`` is 4x4 or 3x4: from view space, x right, y down, z forward, to the world.

    Raises:
        UserError: A value is missing or invalid.
    """
    values = {key: _number(data, key, file) for key in ("fx", "fy", "cx", "cy")}
    for key in ("fx", "fy"):
        if values[key] <= 0:
            raise UserError(f"{file}: {key} is {values[key]:g}, a focal length must be more than 0 pixels")
        if values[key] < _MIN_FOCAL:
            raise UserError(f"{file}: {key} is {values[key]:g}, a focal length must be at least {_MIN_FOCAL:g}")
    pose = _pose(data, file)
    return EnvironmentCamera(values["fx"], values["fy"], values["cx"], values["cy"], pose[:3])


def check_size(data: dict[str, Any], size: tuple[int, int], file: Path, map_file: Path) -> None:
    """Refuse maps whose size differs from the camera's, because its focal lengths would be wrong."""
    for key, pixels in zip(("width", "height"), size, strict=True):
        if key in data and data[key] != pixels:
            raise UserError(
                f"{map_file} is {size[0]}x{size[1]} pixels, but {file} says {key} {data[key]}: give maps of the"
                " camera's size"
            )


def _number(data: dict[str, Any], key: str, file: Path) -> float:
    if key not in data:
        raise UserError(f"{file} lacks {key}: a room's camera needs fx, fy, cx, cy (pixels) and cam_to_world")
    value = data[key]
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= _MAX_PIXELS:
        raise UserError(f"{file}: {key} must be a finite number of pixels up to {_MAX_PIXELS:g}")
    return float(value)


def _pose(data: dict[str, Any], file: Path) -> NDArray[np.float64]:
    """Read and check the pose, float64 [3 or 4, 4]: a right-handed rotation and a position."""
    if "cam_to_world" not in data:
        raise UserError(f"{file} lacks cam_to_world: the camera's 4x4 pose, x right, y down, z forward")
    try:
        pose = np.array(data["cam_to_world"], dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        pose = np.empty(0)
    if pose.shape not in ((3, 4), (4, 4)) or not np.isfinite(pose).all():
        raise UserError(f"{file}: cam_to_world must be 4 rows of 4 finite numbers")
    if np.abs(pose[:3, 3]).max() > _MAX_METRES:
        raise UserError(f"{file}: cam_to_world has the camera more than {_MAX_METRES:g} metres away")
    axes = pose[:3, :3]
    if np.abs(axes.T @ axes - np.eye(3)).max() > _AXES_TOLERANCE or np.linalg.det(axes) < 0:
        raise UserError(f"{file}: the axes of cam_to_world must be unit, at right angles and right-handed")
    return pose
