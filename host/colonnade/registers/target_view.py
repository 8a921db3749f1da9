"""Registers as a target computes them: ``driver/src/colonnade_view.c`` (docs/driver.md)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from colonnade.design.manifest import Manifest

#: x, y, z; rotation row by row.
Position = Sequence[int]
Rotation = Sequence[int]


class TargetView:
    """A view file, the poses that replace its scene's, and the words that the device has."""

    def __init__(self, file: bytes, manifest: Manifest) -> None:
        """Read a view file.

        Raises:
            ValueError: With the name of the driver's error: it is no view file, or one of another design.
        """
        from colonnade import _core

        self._registers = [register for register in manifest.registers.values() if register.access == "rw"]
        first = min(register.address for register in self._registers)
        end = max(register.address + register.words for register in self._registers)
        self._words = dict.fromkeys(range(first, end), 0)
        self._view: Any = _core.TargetView(manifest.format_words, first, end, file)

    def set_object(self, position: Position, rotation: Rotation) -> None:
        """Move the object: 2^-32 m; 2^-30, row by row."""
        self._view.set_object(position, rotation)

    def set_camera(self, position: Position, rotation: Rotation, lens: Rotation, size: tuple[int, int]) -> None:
        """Move the camera: as `set_object`, then fx, fy, cx, cy, 2^-32 pixels, and width and height."""
        self._view.set_camera(position, rotation, *lens, *size)

    def set_bounds(self, low: Position, high: Position) -> None:
        """Change the bounds of what moves within the object's cube: vertex units."""
        self._view.set_bounds(low, high)

    def set_light(self, index: int, position: Position, colour: Position, reach: int = 0) -> None:
        """Change a light: 2^-32 m; linear colour, 2^-16; its reach, 2^-32 m, 0 for a constant intensity."""
        self._view.set_light(index, position, colour, reach)

    def set_sample(self, index: int, count: int) -> None:
        """Compute pass `index` of a frame of `count` passes, 1, 2, 4, … 64: its pixel shift and sample points."""
        self._view.set_sample(index, count)

    def writes(self) -> list[tuple[int, int]]:
        """Word addresses and values that differ from the last accepted frame's.

        Raises:
            ValueError: With the name of the driver's error, such as ``tooFar``.
        """
        pairs = np.frombuffer(self._view.frame(), dtype="<u4").reshape(-1, 2)
        return [(int(address), int(value)) for address, value in pairs]

    def accept(self, writes: list[tuple[int, int]]) -> dict[str, int]:
        """Write to the device, as it were: the values of all registers, by name."""
        self._view.accept()
        for address, value in writes:
            self._words[address] = value
        return {
            register.name: register.decode([self._words[register.address + word] for word in range(register.words)])
            for register in self._registers
        }

    def forget(self) -> None:
        """The device has lost its registers: the next frame has all words."""
        self._view.forget()

    def registers(self) -> dict[str, int]:
        """Compute a frame, and write it: the values of all registers, by name."""
        return self.accept(self.writes())


def rotation_of(quaternion: Sequence[int]) -> Rotation:
    """The rotation of a unit quaternion x, y, z, w, 2^-30 each."""
    from colonnade import _core

    return tuple(_core.target_rotation(quaternion))
