"""Record3D's ``.r3d``: a ZIP archive with the JSON file ``metadata`` and ``rgbd/N.jpg .depth .conf`` for each frame N.

``metadata`` has ``w h`` of the photos, ``K`` (3x3, column by column, pixels) or ``perFrameIntrinsicCoeffs`` (fx, fy,
cx, cy), ``poses`` (quaternion x, y, z, w and position, OpenGL axes, camera to world), ``fps``, ``frameTimestamps`` and
the size ``dw dh`` of depth. Depth is float32, metres, confidence a byte from 0 to 2; both are LZFSE streams. The world
is the first camera's, so its y is not up.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from colonnade.capture.archive import Archive, opened
from colonnade.capture.lzfse_streams import decode_lzfse, longest
from colonnade.capture.source import (
    CERTAIN,
    OPENGL_AXES,
    Frame,
    Lens,
    Outline,
    clean_depth,
    lens,
    quaternion_pose,
)
from colonnade.common.errors import UserError
from colonnade.common.extras import require_extra
from colonnade.common.image_io import opened_bytes, rgb_pixels
from colonnade.common.input_files import parse_json
from colonnade.common.limits import MAX_CAPTURE_FRAMES, MAX_CAPTURE_TEXT_BYTES, MAX_DEPTH_PIXELS, MAX_MEMBER_BYTES
from colonnade.common.types import Floats

#: Bytes of depth and confidence that are decoded together, if these are of several frames.
_BATCH = 1 << 23


class Record3D:
    """An ``.r3d`` file."""

    def __init__(self, path: Path) -> None:
        require_extra("capture", "a Record3D capture")
        self._path = path
        with opened(path) as archive:
            data = parse_json(archive.read("metadata", MAX_CAPTURE_TEXT_BYTES), f"metadata in {path}")
            if not isinstance(data, dict):
                raise self._wrong("must be a JSON object")
            self._data: dict[str, Any] = data
            self._size = self._whole("w"), self._whole("h")
            self._poses = self._poses_of()
            self._depth_size = self._depth_size_of(archive)

    @property
    def outline(self) -> Outline:
        """What is known before frames are read."""
        return Outline("Record3D", len(self._poses))

    def frames(self, numbers: Sequence[int]) -> Iterator[Frame]:
        """Read frames, by ascending number."""
        count = max(1, _BATCH // (5 * self._depth_size[0] * self._depth_size[1]))
        with opened(self._path) as archive:
            for first in range(0, len(numbers), count):
                yield from self._batch(archive, numbers[first : first + count])

    def _batch(self, archive: Archive, numbers: Sequence[int]) -> Iterator[Frame]:
        pixels = self._depth_size[0] * self._depth_size[1]
        streams = []
        for number in numbers:
            for kind, size in (("depth", 4), ("conf", 1)):
                name = f"rgbd/{number}.{kind}"
                if kind == "depth" or archive.has(name):
                    streams.append((name, archive.read(name, longest(size * pixels)), size * pixels))
        decoded = dict(zip((name for name, *_ in streams), decode_lzfse(streams, str(self._path)), strict=True))
        for number in numbers:
            yield self._frame(archive, number, decoded)

    def _frame(self, archive: Archive, number: int, decoded: Mapping[str, bytes]) -> Frame:
        width, height = self._depth_size
        depth = np.frombuffer(decoded[f"rgbd/{number}.depth"], "<f4").reshape(height, width).astype(np.float64)
        confidence = decoded.get(f"rgbd/{number}.conf")
        if confidence is not None:
            depth[np.frombuffer(confidence, np.uint8).reshape(height, width) < CERTAIN] = 0.0
        name = f"rgbd/{number}.jpg"
        with opened_bytes(archive.read(name, MAX_MEMBER_BYTES), f"{name} in {self._path}") as picture:
            photo = rgb_pixels(picture)
        return Frame(
            number,
            self._time(number),
            photo,
            clean_depth(depth),
            self._lens(number, photo.shape[1], photo.shape[0]),
            self._poses[number],
        )

    def _poses_of(self) -> list[Floats]:
        rows = self._data.get("poses")
        if not isinstance(rows, list) or not rows:
            raise self._wrong("lacks poses, those of the camera: record with LiDAR")
        if len(rows) > MAX_CAPTURE_FRAMES:
            raise self._wrong(f"has {len(rows):,} frames, {MAX_CAPTURE_FRAMES:,} at most")
        found = []
        for number, row in enumerate(rows):
            values = self._numbers(row, 7, f"poses[{number}]")
            where = f"metadata in {self._path}: poses[{number}]"
            found.append(quaternion_pose(values[:4], values[4:], where, OPENGL_AXES))
        if len(found) > 1 and all((one == found[0]).all() for one in found):
            raise self._wrong("has the same pose for every frame, as without LiDAR: there is no pose of the camera")
        return found

    def _depth_size_of(self, archive: Archive) -> tuple[int, int]:
        """Width and height of depth."""
        if "dw" in self._data or "dh" in self._data:
            size = self._whole("dw"), self._whole("dh")
        else:
            portrait = self._size[1] >= self._size[0]
            size = (192, 256) if portrait else (256, 192)
        if size[0] * size[1] > MAX_DEPTH_PIXELS:
            raise self._wrong(f"has depth of {size[0]}x{size[1]} pixels, {MAX_DEPTH_PIXELS:,} at most")
        if not archive.has("rgbd/0.depth"):
            raise UserError(f"{self._path} has no depth: it lacks rgbd/0.depth")
        return size

    def _lens(self, number: int, width: int, height: int) -> Lens:
        rows = self._data.get("perFrameIntrinsicCoeffs")
        where = f"metadata in {self._path}"
        if isinstance(rows, list) and number < len(rows):
            values = self._numbers(rows[number], 4, f"perFrameIntrinsicCoeffs[{number}]")
        else:
            k = self._numbers(self._data.get("K"), 9, "K")
            values = [k[0], k[4], k[6], k[7]]
        across, down = width / self._size[0], height / self._size[1]
        return lens([values[0] * across, values[1] * down, values[2] * across, values[3] * down], where)

    def _time(self, number: int) -> float:
        times = self._data.get("frameTimestamps")
        if isinstance(times, list) and number < len(times):
            return self._numbers([times[number]], 1, "frameTimestamps")[0]
        return number / max(self._numbers([self._data.get("fps", 30.0)], 1, "fps")[0], 1.0)

    def _whole(self, key: str) -> int:
        value = self._data.get(key)
        if isinstance(value, bool) or not isinstance(value, int) or not 0 < value <= 1 << 16:
            raise self._wrong(f"must have {key}, a number of pixels")
        return value

    def _numbers(self, values: Any, count: int, key: str) -> list[float]:
        if (
            not isinstance(values, list)
            or len(values) < count
            or any(isinstance(value, bool) or not isinstance(value, int | float) for value in values)
        ):
            raise self._wrong(f"must have {key} with {count} numbers")
        return [float(value) for value in values[:count]]

    def _wrong(self, problem: str) -> UserError:
        return UserError(f"metadata in {self._path} {problem}")
