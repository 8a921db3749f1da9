"""Flat sensors: rays that the device makes itself (docs/rays.md)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from colonnade.common.errors import UserError

#: Columns of a sensor come in multiples of this, and directions in fractions of 2^-30.
_COLUMNS, _FRACTION = 64, 30
_MAX_RAYS = 1 << 24


@dataclass(frozen=True)
class Sensor:
    """Rays from a point: the ray of column x and row y has the direction corner + x · right + y · down.

    Attributes:
        origin: float [3].
        corner: Direction of column and row 0, float [3].
        right: Step to the next column, float [3].
        down: Step to the next row, float [3].
        width: Columns.
        height: Rows.
        near: The least t that counts.
        far: The largest t that counts.
    """

    origin: ArrayLike
    corner: ArrayLike
    right: ArrayLike
    down: ArrayLike
    width: int
    height: int
    near: float = 0
    far: float = np.inf

    def __post_init__(self) -> None:
        vectors = np.array([self.origin, *self._steps], dtype=np.float64)
        if vectors.shape != (4, 3) or not np.isfinite(vectors).all():
            raise UserError("a sensor's origin, corner, right and down are not finite vectors [3]")
        if self.width < 1 or self.height < 1 or self.columns * self.height > _MAX_RAYS:
            raise UserError(f"a sensor of {self.width} x {self.height} rays: give 1 to {_MAX_RAYS:,} rays")

    @property
    def columns(self) -> int:
        """Columns of the device: whole multiples of 64."""
        return -(-self.width // _COLUMNS) * _COLUMNS

    @property
    def exponent(self) -> int:
        """The device's directions are the sensor's times 2^-exponent: below 2 on each axis."""
        corner, right, down = np.array(self._steps, dtype=np.float64)
        ends = [corner + x * right + y * down for x in (0, self.columns - 1) for y in (0, self.height - 1)]
        return int(np.frexp(np.abs([*ends, right, down]).max())[1])

    def record(self) -> NDArray[np.uint32]:
        """The record in memory, uint32 [16]; steps are rounded to 2^-30 of the device's directions."""
        units = np.rint(np.ldexp(np.array(self._steps, dtype=np.float64), _FRACTION - self.exponent)).astype(np.int64)
        words = [*(units.ravel() & 0xFFFFFFFF), self.columns]
        return np.array([*words, *[0] * (16 - len(words))], dtype=np.uint32)

    @property
    def _steps(self) -> tuple[ArrayLike, ...]:
        return self.corner, self.right, self.down
