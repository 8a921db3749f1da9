"""Rooms with exact geometry by number: test rooms for encodings and marches that nobody chose by hand.

A seed decides everything. Seeds of equal remainder by 4 have the same kind: a room, a corridor of 12 m, an attic with
two sloped ceilings, a room with one. Lenses are from 55 to 75 degrees wide. All rooms have furniture, thin posts and
legs, clutter and strong patterns. Encoders are tuned on `TUNING` alone; `REPORT` tells how they do in other rooms.

`python -m colonnade_lab.evaluation.studies.generated_rooms SEED FOLDER [WIDTHxHEIGHT]` writes one as a room.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from colonnade.common.types import Floats

from colonnade_lab.evaluation.studies.attic_paints import Paint, Rgb, boards, plaster, rings, spiral, stripes
from colonnade_lab.evaluation.studies.generated_paints import checkers, marble, poster
from colonnade_lab.evaluation.studies.synthetic_attic import (
    Part,
    SyntheticRoom,
    ball,
    box,
    camera_at,
    cylinder,
    quad,
    synthetic_room,
    write_room,
)

#: Seeds to tune on, and seeds to report.
TUNING, REPORT = range(10), range(100, 110)
#: Names by seed % 4.
KINDS = ("room", "corridor", "attic", "lean-to")
#: Length of a corridor, metres.
CORRIDOR = 12.0
#: Width of the picture, degrees.
LENSES = (55.0, 75.0)
#: Free floor before the camera, metres.
CLEARANCE = 1.2
#: Walls pass through each other by this length, metres, so that no ray escapes between them.
OVERLAP = 0.05


def generated_room(seed: int, width: int = 640, height: int = 480, walked: float = 0.0) -> SyntheticRoom:
    """Render the maps of the room of a seed; the camera has ``walked`` so many metres to the right, and turned left."""
    made, aside = plan_of(seed), np.array([walked, 0.0, 0.0])
    camera = camera_at(made.eye + aside, made.target + 0.4 * aside, width, height, made.focal)
    return synthetic_room(f"seed-{seed}", made.parts, camera, width, height, made.lamp)


@dataclass(frozen=True)
class Furnished:
    """The parts of a generated room, its camera and its lamp.

    Attributes:
        parts: The room.
        eye, target, lamp: Points in the world, float64 [3].
        focal: Focal length in picture widths.
    """

    parts: list[Part]
    eye: Floats
    target: Floats
    lamp: Floats
    focal: float


def plan_of(seed: int) -> Furnished:
    """The room of a seed."""
    plan = Plan(seed)
    eye = np.array([plan.uniform(-0.25, 0.25) * plan.width, plan.uniform(1.25, 1.7), plan.length / 2 - 0.3])
    target = np.array([plan.uniform(-0.2, 0.2) * plan.width, plan.uniform(0.35, 0.9), eye[2] - plan.uniform(3.0, 4.5)])
    focal = 0.5 / np.tan(np.radians(plan.uniform(*LENSES)) / 2)
    parts = [*plan.shell(), *plan.furniture(), *plan.thin_things(), *plan.clutter(), *plan.pictures()]
    lamp = np.array([plan.uniform(-0.2, 0.2) * plan.width, 0.8 * plan.top(0.0), plan.uniform(0.0, 0.25) * plan.length])
    return Furnished(parts, eye, target, lamp, float(focal))


class Plan:
    """The choices of a seed. The room is centred; the camera stands at its front and looks along -z."""

    def __init__(self, seed: int) -> None:
        self._random = np.random.default_rng([seed, 2026])
        self.kind = KINDS[seed % len(KINDS)]
        corridor = self.kind == "corridor"
        self.width = self.uniform(1.9, 2.8) if corridor else self.uniform(3.6, 6.0)
        self.length = CORRIDOR if corridor else self.uniform(4.5, 7.5)
        self.height = self.uniform(2.4, 3.2)
        self.knee = self.uniform(1.0, 1.8)

    def uniform(self, low: float, high: float) -> float:
        """A number between two bounds."""
        return float(self._random.uniform(low, high))

    def colour(self, low: float = 0.15, high: float = 0.85) -> Rgb:
        """A colour, linear."""
        red, green, blue = self._random.uniform(low, high, 3)
        return float(red), float(green), float(blue)

    def top(self, x: float) -> float:
        """Height of the ceiling at x, metres."""
        side = x / (self.width / 2)
        if self.kind == "attic":
            return self.height + (self.knee - self.height) * abs(side)
        if self.kind == "lean-to":
            return self.height + (self.knee - self.height) * (1 + side) / 2
        return self.height

    def paint(self) -> Paint:
        """A paint with or without a pattern."""
        choice = int(self._random.integers(6))
        if choice < 2:
            return plaster(self.colour())
        across, along = ((0, 2), (0, 1), (2, 1))[int(self._random.integers(3))]
        if choice == 2:
            return checkers(self.colour(0.05, 0.4), self.colour(0.5, 0.9), self.uniform(0.08, 0.4))
        if choice == 3:
            return boards(self.colour(), along, across, self.uniform(0.07, 0.2))
        if choice == 4:
            return marble(self.colour(0.1, 0.5), self.colour(0.4, 0.9), self.uniform(1.5, 6.0))
        return rings(self.colour(), self.uniform(0.04, 0.2))

    def shell(self) -> list[Part]:
        """Floor, walls and ceilings."""
        x, z, top = self.width / 2, self.length / 2, self.height + OVERLAP
        wide, far = x + OVERLAP, z + OVERLAP
        ridges = [-x, 0.0, x] if self.kind == "attic" else [-x, x]
        ceiling = self.paint()
        side = plaster(self.colour(0.4, 0.8))
        parts = [
            quad([-wide, 0, far], [wide, 0, far], [wide, 0, -far], [-wide, 0, -far], self.paint()),
            quad([-wide, 0, -z], [wide, 0, -z], [wide, top, -z], [-wide, top, -z], self.paint()),
            quad([-wide, 0, z], [wide, 0, z], [wide, top, z], [-wide, top, z], side),
            quad([-x, 0, far], [-x, 0, -far], [-x, top, -far], [-x, top, far], self.paint()),
            quad([x, 0, far], [x, 0, -far], [x, top, -far], [x, top, far], side),
        ]
        for left, right in pairwise(ridges):
            over = OVERLAP * np.sign([left, right])
            (x0, x1), slope = (left + over[0], right + over[1]), (self.top(right) - self.top(left)) / (right - left)
            y0, y1 = self.top(left) + slope * over[0], self.top(right) + slope * over[1]
            parts.append(quad([x0, y0, far], [x1, y1, far], [x1, y1, -far], [x0, y0, -far], ceiling))
        return parts

    def place(self, margin: float) -> tuple[float, float]:
        """A place (x, z) on the floor, a margin from the walls."""
        half, back, front = self.width / 2 - margin, -self.length / 2 + margin, self.length / 2 - CLEARANCE - margin
        return self.uniform(-half, half), self.uniform(max(back, front - 6.0), front)

    def beside(self, margin: float) -> tuple[float, float]:
        """A place (x, z) on the floor near a side wall."""
        _, z = self.place(margin)
        side = -1.0 if self.uniform(0, 1) < 0.5 else 1.0
        return side * (self.width / 2 - margin), z

    def furniture(self) -> list[Part]:
        """A table, a shelf, chests and a rug."""
        parts = []
        corridor = self.kind == "corridor"
        size = 0.5 if corridor else 1.0
        for _ in range(1 + int(self._random.integers(2))):
            x, z = self.beside(0.3 * size + 0.15) if corridor else self.place(0.9)
            parts += self._table(x, z, self.uniform(0.35, 0.6) * size, self.uniform(0.3, 0.45) * size)
        for _ in range(1 + int(self._random.integers(3))):
            half = self._random.uniform(0.15, 0.35, 3)
            x, z = self.beside(0.35)
            parts.append(box((x, half[1], z), (half[0], half[1], half[2]), self.uniform(0, 90), self.paint()))
        if not corridor:
            parts += self._shelf(-self.length / 2 + 0.2, self.paint())
        x, z = self.place(0.9)
        parts.append(cylinder((x, 0.004, z), self.uniform(0.4, 0.9), 0.004, rings(self.colour(), 0.12)))
        return parts

    def _table(self, x: float, z: float, wide: float, deep: float) -> list[Part]:
        """A table with four legs, and things on it."""
        top, leg, wood = self.uniform(0.42, 0.78), self.uniform(0.012, 0.03), self.paint()
        legs = [(x + i * (wide - leg), z + j * (deep - leg)) for i in (-1, 1) for j in (-1, 1)]
        half, dark = top / 2 - 0.02, plaster((0.3, 0.22, 0.16))
        parts = [box((x, top - 0.02, z), (wide, 0.02, deep), 0.0, wood)]
        parts += [box((a, half, b), (leg, half, leg), 0.0, dark) for a, b in legs]
        for _ in range(int(self._random.integers(3))):
            radius = self.uniform(0.03, 0.09)
            at = (x + self.uniform(-0.7, 0.7) * wide, top + 1.5 * radius, z + self.uniform(-0.7, 0.7) * deep)
            parts.append(cylinder(at, radius, 1.5 * radius, spiral(self.colour(), self.colour())))
        return parts

    def _shelf(self, wall: float, wood: Paint) -> list[Part]:
        """Boards and uprights at the back wall."""
        x, half = self.uniform(-0.3, 0.3) * self.width, self.uniform(0.4, 0.7)
        limit = min(self.top(x - half), self.top(x + half)) - 0.1
        levels = [level for level in (0.35, 0.75, 1.15, 1.55) if level < limit]
        tall = levels[-1] / 2 + 0.01
        parts = [box((x, level, wall), (half, 0.012, 0.16), 0.0, wood) for level in levels]
        return parts + [box((x + i * half, tall, wall), (0.012, tall, 0.16), 0.0, wood) for i in (-1, 0, 1)]

    def thin_things(self) -> list[Part]:
        """Lamp posts with shades, and a column now and then."""
        parts = []
        for _ in range(1 + int(self._random.integers(3))):
            x, z = self.beside(0.4) if self.kind == "corridor" else self.place(0.5)
            tall = min(self.uniform(1.2, 1.7), self.top(x) - 0.3)
            parts.append(cylinder((x, tall / 2, z), self.uniform(0.01, 0.025), tall / 2, plaster((0.25, 0.25, 0.27))))
            parts.append(ball((x, tall, z), (0.14, 0.11, 0.14), plaster((0.82, 0.80, 0.70)), 4))
        if self.uniform(0, 1) < 0.4:
            x, z = self.beside(0.3)
            parts.append(cylinder((x, 1.6, z), self.uniform(0.07, 0.14), 1.6, spiral(self.colour(), self.colour())))
        return parts

    def clutter(self) -> list[Part]:
        """Small boxes, balls and cans on the floor."""
        parts = []
        for _ in range(5 + int(self._random.integers(8))):
            (x, z), size = self.place(0.25), self.uniform(0.04, 0.13)
            choice = int(self._random.integers(3))
            if choice == 0:
                half = (size, size * self.uniform(0.4, 1.2), size * self.uniform(0.6, 1.6))
                parts.append(box((x, half[1], z), half, self.uniform(0, 90), self.paint()))
            elif choice == 1:
                parts.append(ball((x, size, z), (size, size, size), stripes, 4))
            else:
                parts.append(cylinder((x, size, z), 0.6 * size, size, spiral(self.colour(), self.colour())))
        return parts

    def pictures(self) -> list[Part]:
        """Posters on the back wall and on the left one, 3 mm thick."""
        parts = []
        for _ in range(1 + int(self._random.integers(3))):
            wide, tall = self.uniform(0.2, 0.5), self.uniform(0.2, 0.4)
            x = self.uniform(-0.35, 0.35) * self.width
            at = (x, min(self.uniform(1.1, 1.6), self.top(x) - tall - 0.1), 0.003 - self.length / 2)
            parts.append(box(at, (wide, tall, 0.003), 0.0, poster(self.colours(), 0, at)))
            if self.knee > 1.2 or self.kind in ("room", "corridor"):
                at = (0.003 - self.width / 2, 0.8, self.place(0.6)[1])
                parts.append(box(at, (0.003, tall, wide), 0.0, poster(self.colours(), 2, at)))
        return parts

    def colours(self) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        """The colours of a poster, float64 [5, 3]."""
        return np.asarray(self._random.uniform(0.03, 0.92, (5, 3)))


if __name__ == "__main__":
    size = sys.argv[3].split("x") if len(sys.argv) > 3 else ("640", "480")
    write_room(Path(sys.argv[2]), generated_room(int(sys.argv[1]), int(size[0]), int(size[1])).environment)
