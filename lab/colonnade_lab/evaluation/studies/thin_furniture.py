"""Generated rooms with an object behind thin things: a stool, a plant or a lamp, by seed.

A seed decides everything. The room is one of `generated_rooms`, with its own furniture beside the object. Encoders and
tolerances are tuned on `TUNING` alone; `REPORT` tells how they do in other rooms.
"""

from __future__ import annotations

import numpy as np
from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors

from colonnade_lab.evaluation.studies.attic_paints import Paint, boards, plaster, rings
from colonnade_lab.evaluation.studies.furnished_rooms import Furnished
from colonnade_lab.evaluation.studies.generated_rooms import LENSES, Plan
from colonnade_lab.evaluation.studies.synthetic_attic import Part, ball, cylinder

#: Seeds to tune on, and seeds to report.
TUNING, REPORT = range(12), range(300, 312)
#: What hides the object, by seed % 3.
KINDS = ("stool", "plant", "lamp")
#: Free space around the object and the line of sight to it, metres.
FREE = 0.35
#: The camera's distance from the wall behind it, metres.
BEHIND = 0.3


def kind_of(seed: int) -> str:
    """What hides the object in the room of a seed."""
    return KINDS[seed % len(KINDS)]


def behind_thin_things(seed: int) -> Furnished:
    """The room of a seed, with a teapot on its floor behind a stool, a plant or a lamp."""
    plan, random = Plan(seed), np.random.default_rng([seed, 2027])
    eye = np.array([random.uniform(-0.2, 0.2) * plan.width, random.uniform(0.9, 1.5), plan.length / 2 - BEHIND])
    away = random.uniform(1.8, 3.2)
    foot = np.array([eye[0] + random.uniform(-0.2, 0.2) * away, 0.0, eye[2] - away])
    size = random.uniform(0.4, 0.7)
    towards = unit_vectors((eye - foot)[None] * (1.0, 0.0, 1.0))[0]
    aside = np.array([towards[2], 0.0, -towards[0]])
    place = foot + (size / 2 + random.uniform(0.25, 0.5)) * towards + random.uniform(-0.1, 0.1) * aside
    target = foot + np.array((random.uniform(-0.3, 0.3), random.uniform(0.2, 0.5), 0.0))
    thing = {"stool": _stool, "plant": _plant, "lamp": _lamp}[kind_of(seed)](place, random)
    others = [*plan.furniture(), *plan.thin_things(), *plan.clutter(), *plan.pictures()]

    def parts() -> list[Part]:
        return thing + [part for part in others if _is_aside(part, eye, foot, size)]

    return Furnished(
        parts,
        "teapot",
        size,
        (float(foot[0]), 0.0, float(foot[2])),
        (float(eye[0]), float(eye[1]), float(eye[2])),
        (float(target[0]), float(target[1]), float(target[2])),
        float(random.uniform(0, 360)),
        float(0.5 / np.tan(np.radians(random.uniform(*LENSES)) / 2)),
        plan.shell,
    )


def _is_aside(part: Part, eye: Floats, foot: Floats, size: float) -> bool:
    """Whether a part leaves the object's place and the line of sight to it free; seen from above."""
    low, high = part.vertices.min(axis=0) - size / 2 - FREE, part.vertices.max(axis=0) + size / 2 + FREE
    line = foot + np.linspace(0, 1, 33)[:, None] * (eye - foot)
    inside = ((line >= low) & (line <= high))[:, [0, 2]].all(axis=1)
    return not inside.any()


def _rod(start: Floats, end: Floats, radius: float, paint: Paint) -> Part:
    """A thin rod of six sides between two points."""
    along = unit_vectors((end - start)[None])[0]
    across = unit_vectors(np.cross(along, np.eye(3)[np.abs(along).argmin()])[None])[0]
    angle = np.arange(6)[:, None] * np.pi / 3
    ring = radius * (np.cos(angle) * across + np.sin(angle) * np.cross(along, across))
    here = np.arange(6)
    after = (here + 1) % 6
    sides = [np.stack([here, after, here + 6], axis=1), np.stack([after, after + 6, here + 6], axis=1)]
    return Part(np.concatenate([start + ring, end + ring]), np.concatenate(sides).astype(np.int32), paint)


def _stool(place: Floats, random: np.random.Generator) -> list[Part]:
    """A round seat on three or four thin legs, which are spread, with rungs."""
    height, seat, radius = random.uniform(0.42, 0.72), random.uniform(0.14, 0.2), random.uniform(0.008, 0.016)
    count, turn, wood = int(random.integers(3, 5)), random.uniform(0, np.pi), boards((0.62, 0.42, 0.24), 0, 1, 0.09)
    angle = turn + np.arange(count) * 2 * np.pi / count
    ring = np.stack([np.cos(angle), np.zeros(count), np.sin(angle)], axis=1)
    feet, tops = place + seat * 1.15 * ring, place + seat * 0.75 * ring + (0.0, height, 0.0)
    rungs = feet + 0.3 * (tops - feet)
    x, _, z = (float(value) for value in place)
    parts = [cylinder((x, height + 0.012, z), seat, 0.014, rings((0.62, 0.42, 0.24), 0.04))]
    parts += [_rod(foot, top, radius, wood) for foot, top in zip(feet, tops, strict=True)]
    return parts + [_rod(a, b, 0.7 * radius, wood) for a, b in zip(rungs, np.roll(rungs, 1, axis=0), strict=True)]


def _plant(place: Floats, random: np.random.Generator) -> list[Part]:
    """A pot with stems, each with flat leaves."""
    x, _, z = (float(value) for value in place)
    pot, green = random.uniform(0.09, 0.14), plaster((0.16, 0.36, 0.12))
    parts = [cylinder((x, 0.1, z), pot, 0.1, plaster((0.55, 0.28, 0.18)))]
    for _ in range(int(random.integers(4, 8))):
        angle, tall = random.uniform(0, 2 * np.pi), random.uniform(0.35, 0.8)
        lean = random.uniform(0.05, 0.3) * np.array([np.cos(angle), 0.0, np.sin(angle)])
        start, end = place + np.array((0.0, 0.19, 0.0)), place + lean + np.array((0.0, 0.2 + tall, 0.0))
        parts.append(_rod(start, end, random.uniform(0.003, 0.006), green))
        for along in np.linspace(0.35, 1.0, int(random.integers(3, 7))):
            parts.append(_leaf(start + along * (end - start), random, green))
    return parts


def _leaf(stem: Floats, random: np.random.Generator, paint: Paint) -> Part:
    """A flat leaf, pointed at both ends."""
    length, wide = random.uniform(0.08, 0.2), random.uniform(0.015, 0.045)
    angle, rise = random.uniform(0, 2 * np.pi), random.uniform(-0.4, 0.7)
    along = unit_vectors(np.array([[np.cos(angle), rise, np.sin(angle)]]))[0]
    across = unit_vectors(np.cross(along, random.normal(size=3))[None])[0]
    outline = [(0.0, 0.0), (0.25, 0.8), (0.5, 1.0), (0.8, 0.55), (1.0, 0.0), (0.8, -0.55), (0.5, -1.0), (0.25, -0.8)]
    vertices = np.array([stem + a * length * along + b * wide * across for a, b in outline])
    faces = np.array([[0, k, k + 1] for k in range(1, len(outline) - 1)], dtype=np.int32)
    return Part(vertices, faces, paint)


def _lamp(place: Floats, random: np.random.Generator) -> list[Part]:
    """A thin post on a flat base, with a shade above."""
    x, _, z = (float(value) for value in place)
    tall, radius, metal = random.uniform(1.1, 1.5), random.uniform(0.006, 0.014), plaster((0.25, 0.25, 0.27))
    return [
        cylinder((x, 0.01, z), random.uniform(0.1, 0.15), 0.01, metal),
        cylinder((x, tall / 2, z), radius, tall / 2, metal),
        ball((x, tall, z), (0.16, 0.12, 0.16), plaster((0.82, 0.80, 0.70)), 4),
    ]
