"""The rooms of the comparison: geometry, emitters, camera, and the objects of each frame, all in metres.

Nothing of Colonnade is tuned on the generated rooms, whose seeds are for reports; `parlour` was made last.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors
from colonnade.environment.model import EnvironmentCamera
from colonnade.scene.model import Vector
from colonnade.scene.samples import disc_point, square_points

from colonnade_lab.evaluation.studies.generated_rooms import plan_of
from colonnade_lab.evaluation.studies.synthetic_attic import Part, attic_parts, camera_at

#: Size of a photo and of its maps, and of the frames that are compared, pixels.
PHOTO, FRAME = (640, 480), (320, 240)

#: Points of an emitter, for the part of it that can be seen.
_POINTS = 1024

#: A point light: position, intensity, float64 [3] each, and radius, metres.
PointLight = tuple[Floats, Floats, float]

Kind = Literal["matt", "metal", "plastic", "mirror", "glass", "rough mirror", "rough glass"]
#: Kinds of metal, and of glass.
METALS: tuple[Kind, ...] = ("metal", "mirror", "rough mirror")
GLASSES: tuple[Kind, ...] = ("glass", "rough glass")


@dataclass(frozen=True)
class Thing:
    """An object that stands in a room.

    Attributes:
        mesh: Name of a mesh that the repository can make.
        kind: Its material, one of a kind in a frame; metal and plastic are rough.
        colour: Linear base colour.
        foot: Where it stands: the middle of its lowest level.
        size: Longest edge of its bounding box.
        turn: About the vertical, after `tilt` about x, degrees.
        roughness: As in glTF.
    """

    mesh: str
    kind: Kind
    colour: Vector
    foot: Vector
    size: float
    turn: float = 0.0
    tilt: float = 0.0
    roughness: float = 1.0

    @property
    def middle(self) -> Floats:
        """A point in its middle, float64 [3]: objects are about six tenths as high as long."""
        x, y, z = self.foot
        return np.array([x, y + 0.3 * self.size, z])


@dataclass(frozen=True)
class Lamp:
    """A ball that emits.

    Attributes:
        radiance: Linear.
    """

    centre: Vector
    radius: float
    radiance: Vector

    @property
    def power(self) -> Floats:
        """Intensity of a point that lights as it does: light on a surface that faces it at 1 m, over pi."""
        return np.array(self.radiance) * self.radius**2

    def seen_from(self, point: Floats) -> PointLight:
        """The point light that stands for it: position, intensity, radius."""
        return np.array(self.centre), self.power, self.radius

    def points(self, point: Floats) -> Floats:
        """Points of its surface, spread evenly as ``point`` sees it, float64 [n, 3]."""
        towards = unit_vectors((point - np.array(self.centre))[None])[0]
        right = unit_vectors(np.cross(towards, np.eye(3)[np.abs(towards).argmin()])[None])[0]
        disc = np.array([disc_point(*one) for one in square_points(_POINTS, 0)])
        height = np.sqrt((1 - (disc**2).sum(axis=1)).clip(min=0.0))
        offsets = disc[:, :1] * right + disc[:, 1:] * np.cross(towards, right) + height[:, None] * towards
        return np.asarray(np.array(self.centre) + self.radius * offsets)


@dataclass(frozen=True)
class Window:
    """A rectangle that emits to one side.

    Attributes:
        normal: The way that it faces: level, up or down.
    """

    centre: Vector
    normal: Vector
    width: float
    height: float
    radiance: Vector

    def corners(self) -> Floats:
        """Its corners, counter-clockwise for those whom it faces, float64 [4, 3]."""
        up = np.array([0.0, 1.0, 0.0]) if self.normal[1] == 0.0 else np.array([0.0, 0.0, 1.0])
        right = unit_vectors(np.cross(up, np.array(self.normal))[None])[0]
        across, high = right * self.width / 2, up * self.height / 2
        offsets = np.array([-across - high, across - high, across + high, high - across])
        return np.asarray(np.array(self.centre) + offsets)

    def seen_from(self, point: Floats) -> PointLight:
        """The point light that stands for it: position, intensity, radius."""
        towards = unit_vectors((point - np.array(self.centre))[None])[0]
        area = self.width * self.height
        power = np.array(self.radiance) * (area * float(towards @ np.array(self.normal)) / np.pi)
        return np.array(self.centre), power, float(np.sqrt(area / np.pi))

    def points(self, point: Floats) -> Floats:
        """Points that are spread evenly over it, float64 [n, 3]."""
        first, right, _, up = self.corners()
        parts = square_points(_POINTS, 0)
        return np.asarray(first + parts[:, :1] * (right - first) + parts[:, 1:] * (up - first))


@dataclass(frozen=True)
class KnownRoom:
    """A room whose geometry and light are known.

    Attributes:
        parts: Makes its geometry.
        emitters: What lights it.
        eye, target: The camera's position, and a point in the middle of its picture.
        focal: Focal length in picture widths.
        place: Where the panorama is taken.
        frames: The objects of each frame.
        frame: Size of the frames, pixels.
        is_users: Of the room only photo, depth, pose and a panorama without exposure are known.
    """

    parts: Callable[[], list[Part]]
    emitters: tuple[Lamp | Window, ...]
    eye: Vector
    target: Vector
    focal: float
    place: Vector
    frames: Mapping[str, tuple[Thing, ...]]
    frame: tuple[int, int] = FRAME
    is_users: bool = False

    def camera(self, size: tuple[int, int] = PHOTO) -> EnvironmentCamera:
        """The camera of the photo, for a picture of another size."""
        return camera_at(np.array(self.eye), np.array(self.target), *size, self.focal)


def _things(
    matt: tuple[Vector, float],
    metal: tuple[Vector, float],
    plastic: tuple[Vector, float],
    mirror: tuple[Vector, float],
    glass: tuple[Vector, float],
    turn: float,
) -> Mapping[str, tuple[Thing, ...]]:
    """The objects, each at a foot and in a size, in three frames; the last one's are the second's, rough."""
    tint, white = (0.95, 0.94, 0.92), (1.0, 1.0, 1.0)
    return {
        "rough": (
            Thing("torus:96", "matt", (0.8, 0.8, 0.8), *matt, turn + 15.0, 90.0),
            Thing("teapot:40", "metal", (0.95, 0.64, 0.54), *metal, turn, roughness=0.45),
            Thing("sphere:20480", "plastic", (0.2, 0.35, 0.7), *plastic, roughness=0.3),
        ),
        "clear": (
            Thing("teapot:40", "mirror", tint, *mirror, turn, roughness=0.0),
            Thing("sphere:20480", "glass", white, *glass, roughness=0.0),
        ),
        "blurred": (
            Thing("teapot:40", "rough mirror", tint, *mirror, turn, roughness=0.15),
            Thing("sphere:20480", "rough glass", white, *glass, roughness=0.2),
        ),
    }


#: All rooms by name; the first one is of the study on which the gather was designed.
ROOMS = {
    "attic": KnownRoom(
        attic_parts,
        (
            Lamp((1.2, 2.1, 1.6), 0.12, (170.0, 150.0, 118.0)),
            Window((-0.9, 1.3, 2.98), (0.0, 0.0, -1.0), 1.2, 0.9, (20.0, 23.0, 28.0)),
        ),
        (0.5, 1.25, 0.85),
        (0.14, 0.72, -0.35),
        0.95,
        (0.15, 0.85, -0.3),
        _things(
            ((-0.12, 0.725, -0.42), 0.36),
            ((0.36, 0.725, -0.36), 0.34),
            ((0.13, 0.725, -0.06), 0.2),
            ((0.32, 0.725, -0.36), 0.42),
            ((0.0, 0.725, -0.12), 0.24),
            30.0,
        ),
    ),
    "lean-to": KnownRoom(
        lambda: plan_of(107).parts,
        (
            Lamp((0.7, 1.9, 2.4), 0.1, (170.0, 125.0, 80.0)),
            Window((2.78, 1.05, 1.7), (-1.0, 0.0, 0.0), 1.2, 0.9, (30.0, 36.0, 44.0)),
        ),
        (-0.6, 1.3, 2.35),
        (-0.2, 0.74, 0.95),
        0.9,
        (-0.2, 0.93, 1.0),
        _things(
            ((-0.52, 0.779, 0.9), 0.34),
            ((-0.02, 0.779, 0.84), 0.36),
            ((-0.26, 0.779, 1.22), 0.19),
            ((-0.06, 0.779, 0.9), 0.42),
            ((-0.42, 0.779, 1.1), 0.24),
            -20.0,
        ),
    ),
    "chamber": KnownRoom(
        lambda: plan_of(100).parts,
        (
            Lamp((-0.9, 2.25, 1.9), 0.14, (120.0, 112.0, 100.0)),
            Lamp((2.05, 1.25, 1.75), 0.1, (110.0, 62.0, 30.0)),
        ),
        (0.3, 1.15, 2.35),
        (0.2, 0.15, 0.6),
        1.15,
        (0.2, 0.18, 0.6),
        _things(
            ((-0.3, 0.0, 0.4), 0.46),
            ((0.4, 0.0, 0.25), 0.5),
            ((0.64, 0.0, 0.95), 0.28),
            ((0.35, 0.0, 0.35), 0.56),
            ((-0.2, 0.0, 0.8), 0.34),
            40.0,
        ),
    ),
    "parlour": KnownRoom(
        lambda: plan_of(104).parts,
        (
            Lamp((-0.6, 2.1, 2.2), 0.11, (90.0, 72.0, 51.6)),
            Window((2.3, 1.4, 2.2), (-1.0, 0.0, 0.0), 1.0, 1.0, (14.4, 16.8, 20.4)),
        ),
        (0.75, 1.4, 2.45),
        (1.05, 0.78, 1.1),
        0.95,
        (1.05, 0.92, 1.15),
        _things(
            ((0.78, 0.767, 1.0), 0.34),
            ((1.3, 0.767, 1.05), 0.36),
            ((1.02, 0.767, 1.32), 0.2),
            ((1.25, 0.767, 1.05), 0.42),
            ((0.85, 0.767, 1.1), 0.24),
            10.0,
        ),
    ),
}
