"""TUM RGB-D's folder: ``rgb.txt`` and ``depth.txt`` (time, file), ``groundtruth.txt`` (time, position, quaternion).

Depth is grey of 16 bits, 5000 a metre, of the photo's pixels. Poses are camera to world, the camera's axes x right, y
down, z forward. Lines that begin with ``#`` are comments. Photos, depth and poses that lie within 20 ms are one frame.
"""

from __future__ import annotations

from bisect import bisect
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from statistics import median

from colonnade.capture.source import Frame, Outline, finite_numbers, lens, quaternion_pose
from colonnade.capture.text_lines import text_lines
from colonnade.common.errors import UserError
from colonnade.common.image_io import read_picture
from colonnade.common.limits import MAX_CAPTURE_FRAMES
from colonnade.environment import files

_STEP = 1.0 / 5000.0
#: Largest difference of times within a frame, seconds.
_TOGETHER = 0.02
#: Lines of a list.
_MAX_LINES = 1 << 19
#: Other units of times, and the least that a list's times are apart in them; seconds are less apart.
_UNITS = {"nanoseconds": 2e6, "microseconds": 2e3, "milliseconds": 2.0}
#: fx, fy, cx, cy of the cameras, by a part of the folder's name; the centre of their first pixel is at 0.
_LENSES = {
    "freiburg1": (517.3, 516.5, 318.6, 255.3),
    "freiburg2": (520.9, 521.0, 325.1, 249.7),
    "freiburg3": (535.4, 539.2, 320.1, 247.6),
}
_OTHER_LENS = (525.0, 525.0, 319.5, 239.5)


class TumRgbd:
    """A folder with ``groundtruth.txt``."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        photos, depths = (self._list(name, 2) for name in ("rgb.txt", "depth.txt"))
        poses = self._list("groundtruth.txt", 8)
        self._notes = tuple(
            note
            for name, table in (("rgb.txt", photos), ("depth.txt", depths), ("groundtruth.txt", poses))
            if (note := _unit_note(folder / name, table)) is not None
        )
        # (time, photo, depth, pose) of each frame
        self._frames = []
        for time, (photo, *_) in photos:
            depth, pose = (_nearest(table, time) for table in (depths, poses))
            if depth is not None and pose is not None:
                self._frames.append((time, photo, depth[0], pose))
        if not self._frames:
            problem = f"{folder}: no photo has depth and a pose within {_TOGETHER * 1000:.0f} ms"
            raise UserError("; ".join((problem, *self._notes)))
        if len(self._frames) > MAX_CAPTURE_FRAMES:
            raise UserError(f"{folder} has {len(self._frames):,} frames, {MAX_CAPTURE_FRAMES:,} at most")
        name = folder.resolve().name
        known = next((values for key, values in _LENSES.items() if key in name), None)
        if known is None:
            self._notes += ("the lens was taken as fx = fy = 525 pixels: a TUM folder does not hold it",)
        fx, fy, cx, cy = known or _OTHER_LENS
        self._lens = lens((fx, fy, cx + 0.5, cy + 0.5), str(folder))

    @property
    def outline(self) -> Outline:
        """What is known before frames are read."""
        return Outline("TUM RGB-D", len(self._frames), notes=self._notes)

    def frames(self, numbers: Sequence[int]) -> Iterator[Frame]:
        """Read frames, by ascending number."""
        return map(self._frame, numbers)

    def _frame(self, number: int) -> Frame:
        time, photo, depth, row = self._frames[number]
        where = f"{self._folder / 'groundtruth.txt'}, time {time:.6f}"
        values = finite_numbers(row, where)
        return Frame(
            number,
            time,
            read_picture(files.inside(self._folder, photo, "rgb.txt")),
            files.read_grey(files.inside(self._folder, depth, "depth.txt"), _STEP),
            self._lens,
            quaternion_pose(values[3:7], values[:3], where, None),
        )

    def _list(self, name: str, columns: int) -> list[tuple[float, list[str]]]:
        file = self._folder / name
        found = []
        for number, line in enumerate(text_lines(file, "the list", _MAX_LINES), 1):
            words = line.replace(",", " ").split()
            if not words or words[0].startswith("#"):
                continue
            if len(words) < columns:
                raise UserError(f"{file}, line {number}: {columns} words were expected")
            found.append((finite_numbers(words[:1], f"{file}, line {number}")[0], words[1:columns]))
        if not found:
            raise UserError(f"{file} has no lines")
        return sorted(found, key=lambda entry: entry[0])


def _unit_note(file: Path, table: list[tuple[float, list[str]]]) -> str | None:
    """A line on times that are too far apart to be seconds."""
    interval = median(later[0] - earlier[0] for earlier, later in pairwise(table)) if len(table) > 1 else 0.0
    unit = next((unit for unit, least in _UNITS.items() if interval >= least), None)
    return unit and f"the times in {file} are {interval:g} apart, as of {unit}: they must be seconds"


def _nearest(table: list[tuple[float, list[str]]], time: float) -> list[str] | None:
    at = bisect(table, time, key=lambda entry: entry[0])
    near = min(table[max(at - 1, 0) : at + 1], key=lambda entry: abs(entry[0] - time))
    return near[1] if abs(near[0] - time) <= _TOGETHER else None
