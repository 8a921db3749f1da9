"""nerfstudio's folder: ``transforms.json`` with a lens, and frames with a photo, depth and a matrix.

``fl_x fl_y cx cy w h`` stand at the top or in a frame. ``transform_matrix`` is camera to world, the camera's axes x
right, y up, z backward. Depth is a picture of 16 bits or a ``.npy`` array, millimetres.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from colonnade.capture.source import OPENGL_AXES, Frame, Lens, Outline, clean_depth, lens, pose
from colonnade.common.errors import UserError
from colonnade.common.image_io import read_picture
from colonnade.common.input_files import read_json
from colonnade.common.limits import MAX_CAPTURE_FRAMES, MAX_CAPTURE_TEXT_BYTES
from colonnade.environment import files

_MILLIMETRE = 0.001
#: Camera models without distortion, or with some that may be zero; and the keys of distortion.
_MODELS = ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "perspective")
_DISTORTION = ("k1", "k2", "k3", "k4", "p1", "p2")
#: Time between frames, which the file does not hold, seconds.
_INTERVAL = 1.0 / 30.0


class TransformsJson:
    """A folder with ``transforms.json``."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._file = folder, folder / "transforms.json"
        data = read_json(self._file, "the capture", MAX_CAPTURE_TEXT_BYTES)
        frames = data.get("frames") if isinstance(data, dict) else None
        if not isinstance(frames, list) or not frames or not all(isinstance(frame, dict) for frame in frames):
            raise UserError(f"{self._file} has no frames")
        if len(frames) > MAX_CAPTURE_FRAMES:
            raise UserError(f"{self._file} has {len(frames):,} frames, {MAX_CAPTURE_FRAMES:,} at most")
        self._data: dict[str, Any] = data
        self._frames: list[dict[str, Any]] = frames
        if not any("depth_file_path" in frame for frame in frames):
            raise UserError(f"{self._file} has no depth: its frames lack depth_file_path")
        model = data.get("camera_model", "OPENCV")
        if model not in _MODELS:
            raise UserError(f"{self._file}: a capture needs a lens without distortion, not camera_model {model}")
        bent = any(data.get(key) for key in _DISTORTION)
        self._notes = ("the lens's distortion (k1, …) is not undone",) if bent else ()

    @property
    def outline(self) -> Outline:
        """What is known before frames are read."""
        return Outline("nerfstudio", len(self._frames), notes=("times assume 30 frames a second", *self._notes))

    def frames(self, numbers: Sequence[int]) -> Iterator[Frame]:
        """Read frames, by ascending number."""
        return map(self._frame, numbers)

    def _frame(self, number: int) -> Frame:
        frame = self._frames[number]
        where = f"{self._file}, frame {number}"
        try:
            matrix = np.array(frame["transform_matrix"], np.float64)
        except (KeyError, TypeError, ValueError):
            matrix = np.empty(0)
        if matrix.shape not in ((3, 4), (4, 4)):
            raise UserError(f"{where} has no pose: transform_matrix must be 4 rows of 4 numbers")
        photo = read_picture(self._path(frame, "file_path", where))
        depth_file = self._path(frame, "depth_file_path", where)
        read = files.read_array if depth_file.suffix == ".npy" else files.read_grey
        return Frame(
            number,
            number * _INTERVAL,
            photo,
            clean_depth(read(depth_file, _MILLIMETRE)),
            self._lens(frame, photo.shape[1], photo.shape[0], where),
            pose(matrix[:3, :3], matrix[:3, 3], where, OPENGL_AXES),
        )

    def _path(self, frame: dict[str, Any], key: str, where: str) -> Path:
        name = frame.get(key)
        if not isinstance(name, str):
            raise UserError(f"{where} lacks {key}")
        return files.inside(self._folder, name, where)

    def _lens(self, frame: dict[str, Any], width: int, height: int, where: str) -> Lens:
        def value(key: str, default: float | None = None) -> float:
            found = frame.get(key, self._data.get(key, default))
            if isinstance(found, bool) or not isinstance(found, int | float):
                raise UserError(f"{where}: {key} must be a number of pixels")
            return float(found)

        fx = value("fl_x")
        size = value("w", width), value("h", height)
        if min(size) < 1:
            raise UserError(f"{where}: w and h must be the pixels of the photo")
        across, down = width / size[0], height / size[1]
        values = fx * across, value("fl_y", fx) * down, value("cx", width / 2) * across, value("cy", height / 2) * down
        return lens(values, where)
