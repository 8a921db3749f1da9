"""Synthetic rooms with an object that stands partly behind furniture, with exact geometry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from colonnade.scene.model import Vector

from colonnade_lab.evaluation.studies.attic_paints import boards, plaster, rings, spiral
from colonnade_lab.evaluation.studies.synthetic_attic import (
    FOCAL,
    Part,
    SyntheticRoom,
    box,
    camera_at,
    cylinder,
    quad,
    synthetic_room,
)

#: Edge of a leg's cross-section, or its diameter, metres.
LEG = 0.04


@dataclass(frozen=True)
class Furnished:
    """A room with furniture, and an object behind it.

    Attributes:
        furniture: Makes the parts that hide the object.
        mesh: Name of the object's mesh.
        size: Longest edge of its bounding box, metres.
        foot: Where it stands: the middle of its lowest level, world space, metres.
        eye, target: The camera's position, and a point in the middle of its picture.
        turn: Of the object about the vertical, degrees.
        focal: Focal length in picture widths.
        shell: Makes floor, walls and ceiling.
    """

    furniture: Callable[[], list[Part]]
    mesh: str
    size: float
    foot: Vector
    eye: Vector = (0.3, 1.2, 1.75)
    target: Vector = (0.0, 0.3, -0.4)
    turn: float = 25.0
    focal: float = FOCAL
    shell: Callable[[], list[Part]] = field(default_factory=lambda: _shell)

    def room(self, name: str, width: int = 640, height: int = 480) -> SyntheticRoom:
        """Render the room's maps."""
        camera = camera_at(np.array(self.eye), np.array(self.target), width, height, self.focal)
        return synthetic_room(name, [*self.shell(), *self.furniture()], camera, width, height)


def _shell() -> list[Part]:
    """Floor, walls and ceiling of 4.4 x 5.4 m, 2.6 m high."""
    west, east, front, back, top = -2.2, 2.2, 2.7, -2.7, 2.6
    walls = plaster((0.70, 0.68, 0.62))
    return [
        quad(
            [west, 0, front], [east, 0, front], [east, 0, back], [west, 0, back], boards((0.50, 0.36, 0.24), 0, 2, 0.16)
        ),
        quad([west, top, front], [east, top, front], [east, top, back], [west, top, back], plaster((0.8, 0.8, 0.78))),
        quad([west, 0, front], [west, top, front], [west, top, back], [west, 0, back], walls),
        quad([east, 0, front], [east, top, front], [east, top, back], [east, 0, back], walls),
        quad([west, 0, back], [east, 0, back], [east, top, back], [west, top, back], plaster((0.36, 0.48, 0.56))),
        quad([west, 0, front], [east, 0, front], [east, top, front], [west, top, front], walls),
    ]


def _stool() -> list[Part]:
    wood = boards((0.62, 0.42, 0.24), 0, 2, 0.09)
    legs = [(-0.13, -0.13), (0.13, -0.13), (-0.13, 0.13), (0.13, 0.13)]
    x, z = 0.12, 0.45
    return [
        cylinder((x, 0.43, z), 0.21, 0.02, rings((0.62, 0.42, 0.24), 0.04)),
        *(cylinder((x + dx, 0.205, z + dz), LEG / 2, 0.205, wood) for dx, dz in legs),
    ]


def _table() -> list[Part]:
    wood, dark = boards((0.58, 0.40, 0.26), 0, 2, 0.12), plaster((0.32, 0.24, 0.18))
    corners = [(-0.5, -0.3), (0.5, -0.3), (-0.5, 0.3), (0.5, 0.3)]
    z = 0.2
    return [
        box((0.0, 0.66, z), (0.56, 0.02, 0.36), 0.0, wood),
        *(box((x, 0.32, z + dz), (LEG / 2, 0.32, LEG / 2), 0.0, dark) for x, dz in corners),
    ]


def _column() -> list[Part]:
    return [cylinder((0.12, 1.3, 0.5), 0.12, 1.3, spiral((0.80, 0.78, 0.72), (0.45, 0.20, 0.16)))]


def _shelf() -> list[Part]:
    wood, z, half = boards((0.55, 0.44, 0.32), 1, 0, 0.2), -0.9, 0.22
    levels, uprights = (0.3, 0.75, 1.2), (-0.6, 0.0, 0.6)
    return [
        *(box((0.0, y, z), (0.6, 0.015, half), 0.0, wood) for y in levels),
        *(box((x, 0.61, z), (0.015, 0.61, half), 0.0, wood) for x in uprights),
    ]


def _chest() -> list[Part]:
    return [box((0.15, 0.2, 0.5), (0.35, 0.2, 0.22), 32.0, boards((0.36, 0.44, 0.25), 0, 1, 0.14))]


#: The five scenes of the occlusion study.
FURNISHED = {
    "stool": Furnished(_stool, "bunny", 0.55, (-0.02, 0.0, -0.25)),
    "table": Furnished(_table, "bunny", 0.6, (0.28, 0.0, -0.3), eye=(0.35, 0.85, 1.9)),
    "column": Furnished(_column, "bunny", 0.75, (0.2, 0.0, -0.25)),
    "shelf": Furnished(_shelf, "teapot", 0.46, (-0.3, 0.315, -0.95), eye=(0.75, 0.85, 0.6), target=(-0.15, 0.5, -0.9)),
    "chest": Furnished(_chest, "bunny", 0.7, (0.0, 0.0, -0.25)),
}
