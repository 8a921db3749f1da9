"""What every format of a capture is read into: frames with a photo, depth, a lens and a pose.

The pose goes from view space, x right, y down, z forward, to the world of the capture. Readers convert other axes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from colonnade.common.errors import UserError
from colonnade.common.types import Bytes, Floats
from colonnade.environment.repair import holes_of

#: Factors of the camera's axes in OpenGL, x right, y up, z backward, to view space's.
OPENGL_AXES = np.array([1.0, -1.0, -1.0])
#: Largest distance of a camera from the origin, metres; largest focal length or principal point, pixels.
_MAX_METRES, _MAX_PIXELS = 1e6, 1e6
_AXES_TOLERANCE = 1e-2
#: Confidence of a depth sensor that counts: high, of low 0, medium 1 and high 2.
CERTAIN = 2


@dataclass(frozen=True)
class Lens:
    """Focal lengths and principal point, pixels of the photo, whose first pixel's centre is at (0.5, 0.5)."""

    fx: float
    fy: float
    cx: float
    cy: float


@dataclass(frozen=True)
class Frame:
    """A frame of a capture.

    Attributes:
        number: In the capture, from 0.
        time: Seconds.
        photo: sRGB, uint8 [height, width, 3].
        depth: Metres along z, of the same view in any size; 0 is a hole; float64 [rows, columns].
        lens: Of the photo.
        to_world: View space to the capture's world, float64 [3, 4].
    """

    number: int
    time: float
    photo: Bytes
    depth: Floats
    lens: Lens
    to_world: Floats


@dataclass(frozen=True)
class Outline:
    """What is known before frames are read.

    Attributes:
        format: Name of the format.
        count: Number of frames.
        up: The vertical of the capture's world; None if the format does not tell it.
        notes: What the reader assumed, one line each.
    """

    format: str
    count: int
    up: Floats | None = None
    notes: tuple[str, ...] = field(default=())


class Source(Protocol):
    """A capture of one format."""

    @property
    def outline(self) -> Outline:
        """What is known before frames are read."""

    def frames(self, numbers: Sequence[int]) -> Iterator[Frame]:
        """Read frames, by ascending number."""


def pose(rotation: Floats, position: Floats, where: str, axes: Floats | None = None) -> Floats:
    """A checked pose, float64 [3, 4].

    Args:
        rotation: Camera to world, float64 [3, 3].
        position: Of the camera, float64 [3].
        where: For messages.
        axes: Factors of the camera's axes to view space's; None: they are equal.
    """
    if not (np.isfinite(rotation).all() and np.isfinite(position).all()) or np.abs(position).max() > _MAX_METRES:
        raise UserError(f"{where}: the pose must be finite, and the camera within {_MAX_METRES:g} metres")
    if np.abs(rotation.T @ rotation - np.eye(3)).max() > _AXES_TOLERANCE or np.linalg.det(rotation) < 0:
        raise UserError(f"{where}: the axes of the pose must be unit, at right angles and right-handed")
    # The nearest rotation: files hold few digits
    left, _, right = np.linalg.svd(rotation)
    turned = left @ right * (1.0 if axes is None else axes)
    return np.column_stack([turned, position])


def quaternion_pose(quaternion: Sequence[float], position: Sequence[float], where: str, axes: Floats | None) -> Floats:
    """A checked pose of a quaternion (x, y, z, w) and a position."""
    x, y, z, w = quaternion
    length = math.hypot(x, y, z, w)
    if not abs(length - 1.0) <= _AXES_TOLERANCE:
        raise UserError(f"{where}: the pose has a quaternion of length {length:.3g}, not 1")
    x, y, z, w = (value / length for value in (x, y, z, w))
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    return pose(rotation, np.array(position, np.float64), where, axes)


def lens(values: Sequence[float], where: str) -> Lens:
    """A checked lens of fx, fy, cx, cy."""
    if not all(math.isfinite(value) and abs(value) <= _MAX_PIXELS for value in values) or min(values[:2]) < 1.0:
        raise UserError(f"{where}: focal lengths and principal point must be pixels, from 1 and up to {_MAX_PIXELS:g}")
    return Lens(*values)


def clean_depth(depth: Floats) -> Floats:
    """Set holes, which are negative, infinite or no number in files, to 0; returns the same array."""
    depth[holes_of(depth)] = 0.0
    return depth


def finite_numbers(text: Sequence[str], where: str) -> list[float]:
    """Finite numbers of a line of a text file."""
    try:
        found = [float(word) for word in text]
    except ValueError:
        found = [math.nan]
    if not all(map(math.isfinite, found)):
        raise UserError(f"{where} does not hold finite numbers")
    return found
