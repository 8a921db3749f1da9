"""Stray Scanner's folder: ``rgb.mp4``, ``depth/N.png``, ``confidence/N.png``, ``odometry.csv``, ``camera_matrix.csv``.

Depth is grey of 16 bits, millimetres, confidence grey of 8 bits, 0 to 2. ``odometry.csv`` has a title line and, for
each frame, ``timestamp frame x y z qx qy qz qw`` and perhaps ``fx fy cx cy``: camera to world, the camera's axes x
right, y down, z forward, the world's y up. The camera matrix is in pixels of the video, whose pictures are as the
sensor lies.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from colonnade.capture.source import CERTAIN, Frame, Lens, Outline, finite_numbers, lens, quaternion_pose
from colonnade.capture.text_lines import text_lines
from colonnade.capture.video import frames_of_video
from colonnade.common.errors import UserError
from colonnade.common.extras import require_extra
from colonnade.common.input_files import require_regular
from colonnade.common.limits import MAX_CAPTURE_FRAMES
from colonnade.common.types import Floats
from colonnade.environment import files

_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
_COLUMNS, _LENS = ("timestamp", "frame", *_POSE), ("fx", "fy", "cx", "cy")
_MILLIMETRE = 0.001


class StrayScanner:
    """A folder with ``odometry.csv``."""

    def __init__(self, folder: Path) -> None:
        require_extra("capture", "a Stray Scanner capture")
        self._folder = folder
        require_regular(self._file("rgb.mp4"), "the video", f"{folder} has no photos: it lacks rgb.mp4")
        rows = self._table("odometry.csv")
        titles = [title.strip() for title in next(rows, [])]
        missing = [name for name in _COLUMNS if name not in titles]
        self._rows = [
            {name: value for name, value in zip(titles, row, strict=False) if name in (*_COLUMNS, *_LENS)}
            for row in rows
        ]
        if missing or not self._rows:
            what = f"it lacks the column {missing[0]}" if missing else "it has no lines"
            raise UserError(f"{self._file('odometry.csv')} has no poses: {what}")
        matrix = list(islice(self._table("camera_matrix.csv"), 3))
        if len(matrix) < 3 or any(len(row) < 3 for row in matrix):
            raise UserError(f"{self._file('camera_matrix.csv')} must have three lines of three numbers")
        k = [finite_numbers(row[:3], str(self._file("camera_matrix.csv"))) for row in matrix]
        self._matrix = [k[0][0], k[1][1], k[0][2], k[1][2]]

    @property
    def outline(self) -> Outline:
        """What is known before frames are read."""
        return Outline("Stray Scanner", len(self._rows), np.array([0.0, 1.0, 0.0]))

    def frames(self, numbers: Sequence[int]) -> Iterator[Frame]:
        """Read frames, by ascending number."""
        places = [int(self._value(number, "frame")) for number in numbers]
        if any(place < 0 for place in places) or sorted(set(places)) != places:
            raise UserError(f"{self._file('odometry.csv')}: the column frame must ascend from 0")
        photos = frames_of_video(self._file("rgb.mp4"), places)
        for number, place, photo in zip(numbers, places, photos, strict=True):
            values = [self._value(number, name) for name in _POSE]
            where = f"{self._file('odometry.csv')}, line {number + 2}"
            yield Frame(
                number,
                self._value(number, "timestamp"),
                photo,
                self._depth(f"{place:06d}.png"),
                self._lens(number, where),
                quaternion_pose(values[3:], values[:3], where, None),
            )

    def _depth(self, name: str) -> Floats:
        file, confidence_file = self._file(f"depth/{name}"), self._file(f"confidence/{name}")
        depth = files.read_grey(file, _MILLIMETRE)
        if confidence_file.exists():
            confidence = files.read_samples(confidence_file)[..., 0]
            if confidence.shape != depth.shape:
                raise UserError(f"{confidence_file} has another size than {file}")
            depth[confidence < CERTAIN] = 0.0
        return depth

    def _lens(self, number: int, where: str) -> Lens:
        """Of the line, else of the matrix."""
        row = self._rows[number]
        if all(str(row.get(name) or "").strip() for name in _LENS):
            return lens([self._value(number, name) for name in _LENS], where)
        return lens(self._matrix, str(self._file("camera_matrix.csv")))

    def _value(self, number: int, name: str) -> float:
        value = self._rows[number].get(name) or ""
        return finite_numbers([value], f"{self._file('odometry.csv')}, line {number + 2}: {name}")[0]

    def _table(self, name: str) -> Iterator[list[str]]:
        file = self._file(name)
        for line in text_lines(file, "the table", MAX_CAPTURE_FRAMES + 1):
            try:
                yield from filter(None, csv.reader([line]))
            except csv.Error as error:
                raise UserError(f"{file} is not a table: {error}") from None

    def _file(self, name: str) -> Path:
        return files.inside(self._folder, name, str(self._folder))
