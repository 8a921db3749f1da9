"""TUM RGB-D's folder: ``rgb.txt`` and ``depth.txt`` (time, file), ``groundtruth.txt`` (time, position, quaternion).

Depth is grey of 16 bits, 5000 a metre, of the photo's pixels. Poses are camera to world, the camera's axes x right, y
down, z forward. Lines that begin with ``#`` are comments. Photos, depth and poses that lie within 20 ms are one frame.
"""

from __future__ import annotations

from bisect import bisect
from collections.abc import Iterator, Sequence
from pathlib import Path

from colonnade.capture.source import Frame, Outline, finite_numbers, lens, quaternion_pose
from colonnade.common.errors import UserError
from colonnade.common.image_io import read_picture
from colonnade.common.input_files import read_input
from colonnade.common.limits import MAX_CAPTURE_FRAMES, MAX_CAPTURE_TEXT_BYTES
from colonnade.environment import files

_STEP = 1.0 / 5000.0
#: Largest difference of times within a frame, seconds.
_TOGETHER = 0.02
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
        # (time, photo, depth, pose) of each frame
        self._frames = []
        for time, (photo, *_) in photos:
            depth, pose = (_nearest(table, time) for table in (depths, poses))
            if depth is not None and pose is not None:
                self._frames.append((time, photo, depth[0], pose))
        if not self._frames:
            raise UserError(f"{folder}: no photo has depth and a pose within {_TOGETHER * 1000:.0f} ms")
        if len(self._frames) > MAX_CAPTURE_FRAMES:
            raise UserError(f"{folder} has {len(self._frames):,} frames, {MAX_CAPTURE_FRAMES:,} at most")
        name = folder.resolve().name
        known = next((values for key, values in _LENSES.items() if key in name), None)
        self._notes = () if known else ("the lens was taken as fx = fy = 525 pixels: a TUM folder does not hold it",)
        fx, fy, cx, cy = known or _OTHER_LENS
        self._lens = lens((fx, fy, cx + 0.5, cy + 0.5), str(folder))

    @property
    def outline(self) -> Outline:
        """What is known before frames are read."""
        return Outline("TUM RGB-D", len(self._frames), notes=self._notes)

    def frames(self, numbers: Sequence[int]) -> Iterator[Frame]:
        """Read frames, by ascending number."""
        for number in numbers:
            time, photo, depth, row = self._frames[number]
            where = f"{self._folder / 'groundtruth.txt'}, time {time:.6f}"
            values = finite_numbers(row, where)
            yield Frame(
                number,
                time,
                read_picture(inside(self._folder, photo, "rgb.txt")),
                files.read_grey(inside(self._folder, depth, "depth.txt")) * _STEP,
                self._lens,
                quaternion_pose(values[3:7], values[:3], where, None),
            )

    def _list(self, name: str, columns: int) -> list[tuple[float, list[str]]]:
        file = self._folder / name
        data = read_input(file, "the list", MAX_CAPTURE_TEXT_BYTES, f"{self._folder} lacks {name}")
        found = []
        for number, line in enumerate(data.decode("utf-8", "replace").splitlines(), 1):
            words = line.replace(",", " ").split()
            if not words or words[0].startswith("#"):
                continue
            if len(words) < columns:
                raise UserError(f"{file}, line {number}: {columns} words were expected")
            found.append((finite_numbers(words[:1], f"{file}, line {number}")[0], words[1:columns]))
        if not found:
            raise UserError(f"{file} has no lines")
        return sorted(found, key=lambda entry: entry[0])


def inside(folder: Path, name: str, where: str) -> Path:
    """A file that a list names, which must lie in the folder of the capture."""
    file = folder / name
    if "\0" in name or not file.resolve().is_relative_to(folder.resolve()):
        raise UserError(f"{where} in {folder} names {name}: a file must lie in the folder of the capture")
    return file


def _nearest(table: list[tuple[float, list[str]]], time: float) -> list[str] | None:
    at = bisect(table, time, key=lambda entry: entry[0])
    near = min(table[max(at - 1, 0) : at + 1], key=lambda entry: abs(entry[0] - time))
    return near[1] if abs(near[0] - time) <= _TOGETHER else None
