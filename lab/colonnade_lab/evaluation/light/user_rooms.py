"""Rooms by kind and seed with the light of users' rooms, for frames of which only photo, depth and pose are known.

Seeds below 100 are for tuning, `REPORT` names the rooms of the page. Each kind has what others lack: a window of two
panes and a lamp; two coloured lamps in the dark; sun through leaves; a window in view.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from colonnade.common.errors import UserError

from colonnade_lab.evaluation.light.rooms import ROOMS, KnownRoom, Lamp, Thing, Window
from colonnade_lab.evaluation.studies.attic_paints import Paint, Rgb, boards, plaster, rings
from colonnade_lab.evaluation.studies.generated_paints import checkers, poster
from colonnade_lab.evaluation.studies.synthetic_attic import Part, ball, box, cylinder, quad

#: Size of the frames, pixels.
FRAME = (160, 120)
#: Distance of a window from its wall, metres.
_BEFORE = 0.02


@dataclass(frozen=True)
class _Draw:
    """The choices of a seed."""

    random: np.random.Generator

    def number(self, low: float, high: float) -> float:
        """A number between two bounds."""
        return float(self.random.uniform(low, high))

    def colour(self, low: float, high: float, grey: float = 0.5) -> Rgb:
        """A linear colour; with ``grey`` 1 it has no hue."""
        own = self.random.uniform(low, high, 3)
        red, green, blue = own + grey * (own.mean() - own)
        return float(red), float(green), float(blue)

    def light(self, warm: Rgb, level: float) -> Rgb:
        """A radiance about a level, and about a hue."""
        red, green, blue = np.array(warm) * self.random.uniform(0.9, 1.1, 3) * level * self.number(0.85, 1.2)
        return float(red), float(green), float(blue)

    def side(self) -> float:
        """1 or -1."""
        return float(self.random.choice((-1.0, 1.0)))


def user_room(kind: str, seed: int) -> KnownRoom:
    """The room of a kind and a seed."""
    room = _KINDS[kind](_Draw(np.random.default_rng([seed, *kind.encode()])))
    return replace(room, frame=FRAME, is_users=True)


def _shell(
    x: float, z: float, top: float, floor: Paint, walls: Rgb, back: Paint, has_ceiling: bool = True
) -> list[Part]:
    """Floor, walls and ceiling of a room of 2x by 2z metres; the camera looks along -z."""
    wall = plaster(walls)
    parts = [
        quad([-x, 0, z], [x, 0, z], [x, 0, -z], [-x, 0, -z], floor),
        quad([-x, 0, -z], [x, 0, -z], [x, top, -z], [-x, top, -z], back),
        quad([-x, 0, z], [x, 0, z], [x, top, z], [-x, top, z], wall),
        quad([-x, 0, z], [-x, 0, -z], [-x, top, -z], [-x, top, z], wall),
        quad([x, 0, z], [x, 0, -z], [x, top, -z], [x, top, z], wall),
    ]
    if has_ceiling:
        parts.append(quad([-x, top, z], [x, top, z], [x, top, -z], [-x, top, -z], plaster((0.8, 0.79, 0.76))))
    return parts


def _table(draw: _Draw, top: float) -> list[Part]:
    """A table in the middle of the room, and things on it beside the objects."""
    wood, dark = boards(draw.colour(0.2, 0.65, 0.3), 0, 2, draw.number(0.1, 0.2)), plaster((0.3, 0.24, 0.2))
    parts = [box((0.0, top - 0.02, 0.0), (0.75, 0.02, 0.5), 0.0, wood)]
    parts += [
        box((i * 0.7, top / 2 - 0.02, j * 0.45), (0.025, top / 2 - 0.02, 0.025), 0.0, dark)
        for i in (-1, 1)
        for j in (-1, 1)
    ]
    return parts + _clutter(draw, top, 0.6, 0.4)


def _clutter(draw: _Draw, level: float, x: float, back: float) -> list[Part]:
    """A can, a box and a ball behind the objects."""
    high, half = draw.number(0.06, 0.11), draw.number(0.05, 0.1)
    return [
        cylinder((-x, level + high, -back), 0.05, high, plaster(draw.colour(0.1, 0.8, 0.0))),
        box(
            (draw.number(-0.1, 0.1), level + half, -back),
            (0.12, half, 0.06),
            draw.number(0, 60),
            plaster(draw.colour(0.1, 0.8, 0.2)),
        ),
        ball((x, level + 0.07, -back + 0.1), (0.07, 0.07, 0.07), plaster(draw.colour(0.1, 0.8, 0.0)), 4),
    ]


def _poster(draw: _Draw, z: float) -> Part:
    at = (draw.number(-0.8, 0.8), draw.number(1.3, 1.6), 0.003 - z)
    return box(
        at,
        (draw.number(0.25, 0.4), draw.number(0.2, 0.35), 0.003),
        0.0,
        poster(draw.random.uniform(0.05, 0.9, (5, 3)), 0, at),
    )


def _frames(draw: _Draw, level: float, size: float = 1.0) -> Mapping[str, tuple[Thing, ...]]:
    """A matt and a metal object, and a mirror and glass, at the same two places."""
    turn, gap = draw.number(-40, 40), draw.number(0.19, 0.24) * size
    left, right = (-gap, level, draw.number(-0.1, 0.1)), (gap, level, draw.number(-0.1, 0.1))
    grey = draw.number(0.6, 0.8)
    return {
        "rough": (
            Thing("torus:96", "matt", (grey, grey, grey), left, 0.33 * size, turn + 20.0, 90.0),
            Thing("teapot:40", "metal", (0.95, 0.64, 0.54), right, 0.36 * size, turn, roughness=0.45),
        ),
        "clear": (
            Thing("teapot:40", "mirror", (0.95, 0.94, 0.92), right, 0.38 * size, turn, roughness=0.0),
            Thing("sphere:20480", "glass", (1.0, 1.0, 1.0), left, 0.24 * size, roughness=0.0),
        ),
    }


def _kitchen(draw: _Draw) -> KnownRoom:
    """A window of two panes in a side wall, a lamp below the ceiling and one opposite, all out of view."""
    x, z, high, level = draw.number(1.8, 2.3), draw.number(2.0, 2.6), draw.number(2.4, 2.7), draw.number(0.7, 0.9)
    side, pane, along, up = draw.side(), draw.number(0.5, 0.65), draw.number(-0.2, 0.9), draw.number(1.35, 1.6)
    day, middle = draw.light((0.85, 1.0, 1.2), 8.5), side * (x - _BEFORE)
    tall, gap = draw.number(0.9, 1.2), draw.number(0.12, 0.2)
    panes = [
        Window((middle, up, along + one * (pane + gap) / 2), (-side, 0.0, 0.0), pane, tall, day) for one in (-1, 1)
    ]
    lamp = Lamp(
        (draw.number(-0.4, 0.4), high - 0.35, draw.number(0.2, 0.8)),
        draw.number(0.08, 0.13),
        draw.light((1.3, 1.0, 0.62), 55.0),
    )
    back = checkers(draw.colour(0.3, 0.6), draw.colour(0.55, 0.85), draw.number(0.12, 0.2))
    shell = _shell(x, z, high, boards(draw.colour(0.2, 0.6), 0, 2, 0.14), draw.colour(0.5, 0.8), back)
    parts = [
        *shell,
        *_table(draw, level),
        box((-side * (x - 0.3), 0.45, -1.0), (0.3, 0.45, 0.8), 0.0, plaster(draw.colour(0.3, 0.8, 0.3))),
        _poster(draw, z),
    ]
    eye = (draw.number(-0.4, 0.4), level + draw.number(0.45, 0.6), draw.number(1.25, 1.45))
    reading = Lamp(
        (-side * (x - 0.3), draw.number(1.3, 1.7), draw.number(0.0, 0.6)), 0.07, draw.light((1.4, 1.0, 0.5), 60.0)
    )
    return KnownRoom(
        lambda: parts,
        (*panes, lamp, reading),
        eye,
        (0.0, level + 0.08, 0.0),
        0.95,
        (0.0, level + 0.15, 0.0),
        _frames(draw, level),
    )


def _passage(draw: _Draw) -> KnownRoom:
    """Dark, with a warm lamp at the side and a cool one behind the camera."""
    x, z, high = draw.number(1.1, 1.5), draw.number(2.6, 3.4), draw.number(2.3, 2.6)
    side = draw.side()
    warm = Lamp(
        (side * (x - 0.2), draw.number(1.5, 1.9), draw.number(-0.6, 0.2)),
        draw.number(0.07, 0.1),
        draw.light((1.6, 0.7, 0.25), 20.0),
    )
    cool = Lamp(
        (-side * draw.number(0.2, 0.7), draw.number(1.7, 2.0), draw.number(2.1, 2.4)),
        0.1,
        draw.light((0.15, 1.0, 1.6), 65.0),
    )
    floor = checkers(draw.colour(0.1, 0.3), draw.colour(0.4, 0.6), draw.number(0.2, 0.35))
    shell = _shell(x, z, high, floor, draw.colour(0.35, 0.65), plaster(draw.colour(0.3, 0.6)))
    chest = box(
        (-side * (x - 0.25), 0.3, -0.9),
        (0.22, 0.3, 0.4),
        draw.number(-8, 8),
        boards(draw.colour(0.2, 0.6, 0.2), 2, 1, 0.1),
    )
    parts = [*shell, *_clutter(draw, 0.0, 0.5, 0.6), chest, _poster(draw, z)]
    eye = (draw.number(-0.3, 0.3), draw.number(0.95, 1.2), 1.7)
    return KnownRoom(lambda: parts, (warm, cool), eye, (0.0, 0.15, 0.0), 1.05, (0.0, 0.2, 0.0), _frames(draw, 0.0, 1.2))


def _courtyard(draw: _Draw) -> KnownRoom:
    """Sun through the leaves of a pergola, sky above the walls."""
    x, z, high, roof = draw.number(2.2, 2.8), draw.number(2.4, 3.0), draw.number(2.3, 2.6), 3.1
    sky = Window((0.0, 7.0, 0.0), (0.0, -1.0, 0.0), 16.0, 16.0, draw.light((0.55, 0.75, 1.1), 0.75))
    away = np.array([draw.number(-0.5, 0.5), 1.0, draw.number(-0.1, 0.6)]) * 6.2
    sun = Lamp((float(away[0]), float(away[1]), float(away[2])), 0.03, draw.light((1.15, 1.0, 0.8), 60000.0))
    floor = checkers(draw.colour(0.3, 0.4, 0.6), draw.colour(0.4, 0.55, 0.6), draw.number(0.25, 0.4))
    parts = [*_shell(x, z, high, floor, draw.colour(0.5, 0.75, 0.7), plaster(draw.colour(0.4, 0.7)), has_ceiling=False)]
    leaves = plaster((0.12, 0.3, 0.07))
    for _ in range(90):
        at = np.array([draw.number(-2.4, 2.4), roof + draw.number(-0.1, 0.2), draw.number(-2.0, 2.4)])
        wide, long = np.array([draw.number(0.1, 0.25), 0.03, 0.0]), np.array([0.0, 0.02, draw.number(0.1, 0.25)])
        corners = ((at + i * wide + j * long).tolist() for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
        first, second, third, fourth = corners
        parts.append(quad(first, second, third, fourth, leaves))
    parts += _clutter(draw, 0.0, 0.6, 0.7)
    parts.append(cylinder((draw.side() * 1.1, 0.25, -1.0), 0.25, 0.25, rings(draw.colour(0.3, 0.6, 0.2), 0.1)))
    eye = (draw.number(-0.4, 0.4), draw.number(1.2, 1.45), 1.9)
    return KnownRoom(lambda: parts, (sky, sun), eye, (0.0, 0.1, 0.0), 0.95, (0.0, 0.2, 0.0), _frames(draw, 0.0, 1.2))


def _study(draw: _Draw) -> KnownRoom:
    """A window behind the table, in view, and a lamp."""
    x, z, high, level = draw.number(1.7, 2.2), draw.number(1.6, 2.0), draw.number(2.4, 2.7), draw.number(0.68, 0.78)
    wide = draw.number(0.8, 1.1)
    window = Window(
        (draw.number(-0.5, 0.5), level + 0.75, _BEFORE - z),
        (0.0, 0.0, 1.0),
        wide,
        0.9,
        draw.light((0.9, 1.0, 1.12), 7.0),
    )
    side = draw.side()
    lamp = Lamp(
        (side * (x - 0.3), draw.number(1.4, 1.8), draw.number(0.4, 1.0)), 0.1, draw.light((1.35, 1.0, 0.55), 50.0)
    )
    shell = _shell(
        x,
        z,
        high,
        boards(draw.colour(0.2, 0.5), 0, 2, 0.14),
        draw.colour(0.5, 0.75),
        plaster(draw.colour(0.45, 0.75, 0.3)),
    )
    parts = [
        *shell,
        *_table(draw, level),
        box((-side * (x - 0.2), 0.6, -0.8), (0.18, 0.6, 0.5), 0.0, boards(draw.colour(0.2, 0.6, 0.2), 1, 2, 0.2)),
    ]
    eye = (draw.number(-0.35, 0.35), level + draw.number(0.45, 0.6), draw.number(1.2, 1.35))
    return KnownRoom(
        lambda: parts,
        (window, lamp),
        eye,
        (0.0, level + 0.15, 0.0),
        0.85,
        (0.0, level + 0.15, 0.0),
        _frames(draw, level),
    )


_KINDS: Mapping[str, Callable[[_Draw], KnownRoom]] = {
    "kitchen": _kitchen,
    "passage": _passage,
    "courtyard": _courtyard,
    "study": _study,
}
#: The rooms of the page, by kind.
REPORT = {kind: 101 + index for index, kind in enumerate(_KINDS)}


def known_room(name: str) -> KnownRoom:
    """The room of a name: one of `ROOMS`, or a user's room of the page.

    Raises:
        UserError: There is none.
    """
    if name in ROOMS:
        return ROOMS[name]
    if name in REPORT:
        return user_room(name, REPORT[name])
    raise UserError(f"there is no room {name}: choose from {', '.join((*ROOMS, *REPORT))}")
