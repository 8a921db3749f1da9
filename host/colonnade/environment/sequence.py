"""A sequence: a room seen by a moving camera, in a file ``sequence.toml`` beside its pictures.

The schema is `Sequence` and `SequenceFrame`: keys, ranges and defaults. Unknown keys are refused.
"""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval, Len
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, Strict, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from colonnade.common.errors import UserError
from colonnade.common.image_io import read_picture
from colonnade.common.input_files import read_input
from colonnade.common.limits import MAX_CAPTURE_TEXT_BYTES, MAX_FRAMES
from colonnade.common.toml_files import parse_toml
from colonnade.environment.camera import check_size, read_camera
from colonnade.environment.derived_albedo import hue_lights
from colonnade.environment.files import inside
from colonnade.environment.lights import RoomLights
from colonnade.environment.load import DEFAULT_DEPTH_STEP, MAX_EDGE, RoomFiles, depth_step, load_maps
from colonnade.environment.model import Environment, EnvironmentCamera

_STRICT = ConfigDict(extra="forbid")
_Float = Annotated[float, Strict()]
_Pixels = Annotated[int, Strict(), Interval(ge=16, le=MAX_EDGE)]
_Name = Annotated[str, Field(min_length=1)]
_Row = tuple[_Float, _Float, _Float, _Float]


@dataclass(frozen=True, config=_STRICT)
class SequenceFrame:
    """A frame.

    Attributes:
        time: Seconds.
        photo, depth: Pictures, relative to the file; depth is grey of 16 bits or a ``.npy`` array.
        fx, fy, cx, cy: The lens, pixels.
        cam_to_world: Three rows of the pose, as in ``meta.json``.
        albedo, normal: Pictures as of a room; derived if they are missing.
    """

    time: _Float
    photo: _Name
    depth: _Name
    fx: _Float
    fy: _Float
    cx: _Float
    cy: _Float
    cam_to_world: tuple[_Row, _Row, _Row]
    albedo: _Name | None = None
    normal: _Name | None = None


@dataclass(frozen=True, config=_STRICT)
class SequenceMaps:
    """Which frames have maps.

    Attributes:
        every: Each frame of this number, from the first one on. The frames between see its maps from their cameras.
    """

    every: Annotated[int, Strict(), Interval(ge=1, le=MAX_FRAMES)] = 1


@dataclass(frozen=True, config=_STRICT)
class SequenceFile:
    """The content of the file.

    Attributes:
        width, height: Of all pictures, pixels.
        frame: The frames, by ascending time.
        rate: Frames a second.
        depth_step: Metres of a step of a depth picture.
        depth_noise: Error of the depth on flat surfaces, as a share of it.
        maps: Which frames have maps.
    """

    width: _Pixels
    height: _Pixels
    frame: Annotated[tuple[SequenceFrame, ...], Len(1, MAX_FRAMES)]
    rate: Annotated[_Float, Interval(gt=0, le=1e6)] = 30.0
    depth_step: _Float = DEFAULT_DEPTH_STEP
    depth_noise: Annotated[_Float, Interval(ge=0.0, le=1.0)] = 0.005
    maps: SequenceMaps = SequenceMaps()


_SCHEMA = TypeAdapter(SequenceFile)


class Sequence:
    """A sequence's file and the cameras of its frames.

    Attributes:
        path: Of the file.
        content: What it holds.
        cameras: Of the frames.
    """

    def __init__(self, path: Path, content: SequenceFile) -> None:
        self.path, self.content = path, content
        self.cameras: list[EnvironmentCamera] = []
        for number, frame in enumerate(content.frame):
            values: dict[str, Any] = {name: getattr(frame, name) for name in ("fx", "fy", "cx", "cy", "cam_to_world")}
            self.cameras.append(read_camera(values, Path(f"{path}, frame {number}")))

    def __len__(self) -> int:
        return len(self.content.frame)

    def room(self, number: int) -> Environment:
        """The maps of a frame; maps that the sequence does not hold are derived.

        Albedos are derived with one light, which is fitted to the first frame without an albedo.

        Raises:
            UserError: A picture is missing, unreadable or of another size.
        """
        return self._room(number, None if self.content.frame[number].albedo else self._lights)

    def photo(self, number: int) -> NDArray[np.uint8]:
        """The photo of a frame, sRGB, uint8 [height, width, 3].

        Raises:
            UserError: It is missing, unreadable or of another size.
        """
        file = self.path.parent / self.content.frame[number].photo
        photo = read_picture(file)
        check_size(self._sizes, (photo.shape[1], photo.shape[0]), self.path, file)
        return photo

    @property
    def _sizes(self) -> dict[str, Any]:
        return {"width": self.content.width, "height": self.content.height}

    @cached_property
    def _lights(self) -> RoomLights:
        first = next(number for number, frame in enumerate(self.content.frame) if frame.albedo is None)
        return hue_lights(self._room(first, None))

    def _room(self, number: int, lights: RoomLights | None) -> Environment:
        frame = self.content.frame[number]
        maps = RoomFiles(
            self._file(frame.albedo),
            self._file(frame.normal),
            self._file(frame.depth),
            self._file(frame.photo),
            self.content.depth_step,
            "srgb",
        )
        name = f"{self.path.parent.name} {number}"
        return load_maps(name, self.cameras[number], maps, (self._sizes, self.path), lights=lights)

    def _file(self, name: str | None) -> Path | None:
        return None if name is None else self.path.parent / name


def load_sequence(path: Path) -> Sequence:
    """Read a sequence's file; pictures are read frame by frame.

    Raises:
        UserError: The file is missing, is not TOML, or has an invalid key or value.
    """
    content = read_input(path, "the sequence", MAX_CAPTURE_TEXT_BYTES, f"sequence {path} does not exist")
    data = parse_toml(content, f"sequence {path}")
    depth_step(data, path)
    try:
        # Lists become the tuples of the schema
        found = _SCHEMA.validate_python(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        if first["type"] == "unexpected_keyword_argument":
            raise UserError(f"sequence {path}: unknown key {place}") from None
        problem = "is missing" if first["type"] in ("missing", "missing_argument") else f": {first['msg']}"
        raise UserError(f"sequence {path}: {place} {problem}".replace(" :", ":")) from None
    times = [frame.time for frame in found.frame]
    if not np.isfinite(times).all() or sorted(set(times)) != times:
        raise UserError(f"sequence {path}: the times of its frames must ascend")
    for number, frame in enumerate(found.frame):
        for name in (frame.photo, frame.depth, frame.albedo, frame.normal):
            if name is not None:
                inside(path.parent, name, f"sequence {path}, frame {number},")
    return Sequence(path, found)
