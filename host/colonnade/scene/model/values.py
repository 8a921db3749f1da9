"""Values of the scene file's keys, with their ranges."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from annotated_types import Interval
from pydantic import BeforeValidator, ConfigDict, Field, Strict

from colonnade.common.limits import MAX_COORDINATE

STRICT = ConfigDict(extra="forbid")

#: Largest width or height of a room's maps, pixels.
MAX_EDGE = 4096
#: The most objects of a scene.
MAX_OBJECTS = 64
#: The most bounces that any configuration supports.
MAX_BOUNCES = 15


def _require_text(value: object) -> object:
    if not isinstance(value, str | Path) or not str(value):
        raise ValueError("must be text")
    return value


# Numbers are strict: text and Booleans are not converted.
Float = Annotated[float, Strict()]
Coordinate = Annotated[Float, Interval(ge=-MAX_COORDINATE, le=MAX_COORDINATE)]
Fraction = Annotated[Float, Interval(ge=0.0, le=1.0)]
Degrees = Annotated[Float, Interval(ge=-36000.0, le=36000.0)]
Diameter = Annotated[Float, Interval(ge=0.0, le=1e6)]
Intensity = Annotated[Float, Interval(ge=0.0, le=15.0)]
MapPixel = Annotated[Float, Interval(ge=0.0, le=MAX_EDGE)]
Triangles = Annotated[int, Strict(), Interval(ge=4)]
Text = Annotated[str, Field(min_length=1)]
File = Annotated[Path, BeforeValidator(_require_text)]

#: Filters of the noise of gathered light: the host's own, and Open Image Denoise.
Denoiser = Literal["atrous", "oidn"]
Vector = tuple[float, float, float]
WorldVector = tuple[Coordinate, Coordinate, Coordinate]
LinearColour = tuple[Fraction, Fraction, Fraction]
BrightColour = tuple[Intensity, Intensity, Intensity]
RoomPixel = tuple[MapPixel, MapPixel]
