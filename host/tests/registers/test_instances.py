"""Registers of instances, as the driver's C computes them, against exact rationals."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from itertools import chain, product
from typing import Any

import numpy as np
import pytest
from instance_worlds import FRAME, instance, transform

from colonnade import _core
from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.design.generator import manifest_for
from colonnade.registers.instances import POSITION_FRACTION, instance_registers, transform_values

#: Bits of vertices, fraction bits of grids, bits of the scene: of three precisions and two extreme designs.
NUMBERS = [(16, 5, 32), (16, 13, 40), (16, -3, 24), (24, 37, 72), (10, 3, 24)]
KINDS = ("rigid", "scaled", "mirrored", "sheared", "thin")
ORDER = [
    *(f"matrix[{a}].{axis}" for a in range(3) for axis in "xyz"),
    *("shift", "origin.x", "origin.y", "origin.z"),
    *(f"normal[{a}].{axis}" for a in range(3) for axis in "xyz"),
    *("root", "materialBase"),
    *(f"box.{side}.{axis}" for side in ("low", "high") for axis in "xyz"),
]
WIDTHS = {"matrix": 25, "shift": 6, "normal": 16, "root": 32, "materialBase": 8, "box": 7}


def linear_part(random: np.random.Generator, kind: str) -> Floats:
    """In units of cubes, so that a placed cube is within the world's."""
    if kind == "thin":
        turns = [np.linalg.qr(random.normal(size=(3, 3)))[0] for _ in range(2)]
        linear = turns[0] @ np.diag([1.0, random.uniform(0.01, 1.0), 0.01]) @ turns[1]
    else:
        linear = transform(random, kind)[:3, :3]
    return np.asarray(linear * random.uniform(0.5 if kind == "thin" else 0.02, 1.0) / np.abs(linear).sum(axis=1).max())


class Case:
    """An object at a random place, in whole numbers."""

    def __init__(self, random: np.random.Generator, numbers: tuple[int, int, int], kind: str) -> None:
        self.numbers = numbers
        self.bits, self.fraction, _ = numbers
        cube = 1 << self.bits
        corners = np.sort(random.integers(0, cube, size=(2, 3)), axis=0)
        self.low, self.high = corners[0].tolist(), corners[1].tolist()
        linear = linear_part(random, kind)
        self.exponent = math.frexp(np.abs(linear).max())[1] - 30
        self.linear = np.rint(np.ldexp(linear, -self.exponent)).astype(int).tolist()
        self.matrix = [[Fraction(value) * Fraction(2) ** self.exponent for value in row] for row in self.linear]
        zero = self.placed((Fraction(0),) * 3)
        space = [cube - 1 - (high - low) for low, high in zip(*zero, strict=True)]
        steps = [random.uniform() * float(room) - float(low) for room, low in zip(space, zero[0], strict=True)]
        self.position = [math.floor(step * 2**POSITION_FRACTION) for step in steps]
        self.position = [
            max(p, math.ceil(-low * 2**POSITION_FRACTION)) for p, low in zip(self.position, zero[0], strict=True)
        ]
        self.offset = int(random.integers(1, 1 << max(1, self.bits + self.fraction - 8)))

    def placed(self, position: Any) -> tuple[list[Fraction], list[Fraction]]:
        """The box of the placed corners, vertex units of the world."""
        corners = [
            [
                sum((f * u for f, u in zip(row, corner, strict=True)), at)
                for row, at in zip(self.matrix, position, strict=True)
            ]
            for corner in product(*zip(self.low, self.high, strict=True))
        ]
        axes = list(zip(*corners, strict=True))
        return [min(axis) for axis in axes], [max(axis) for axis in axes]

    def words(self) -> tuple[dict[str, int], Any]:
        """Values of the instance's registers by name, and what instances share."""
        target = _core.TargetInstances(*self.numbers)
        flat = [value for row in self.linear for value in row]
        words = target.add(self.low, self.high, self.offset, 77, 5, flat, self.exponent, self.position)
        grid_bits, values = sum(self.numbers[:2]) + 3, {}
        for name in ORDER:
            width = WIDTHS.get(name.split(".")[0].split("[")[0], grid_bits)
            value = words.pop(0) | (words.pop(0) << 32 if width > 32 else 0)
            assert value >> width == 0
            is_signed = name[:3] in ("mat", "ori", "nor")
            values[name] = value - (1 << width) if is_signed and value >> (width - 1) else value
        assert not words
        return values, target.shared()


def inverse(m: list[list[Fraction]]) -> list[list[Fraction]]:
    minors = [
        [
            m[(i + 1) % 3][(j + 1) % 3] * m[(i + 2) % 3][(j + 2) % 3]
            - m[(i + 1) % 3][(j + 2) % 3] * m[(i + 2) % 3][(j + 1) % 3]
            for j in range(3)
        ]
        for i in range(3)
    ]
    determinant = sum(a * b for a, b in zip(m[0], minors[0], strict=True))
    return [[minors[j][i] / determinant for j in range(3)] for i in range(3)]


@pytest.mark.parametrize("numbers", NUMBERS)
@pytest.mark.parametrize("kind", KINDS)
def test_registers_are_those_of_exact_arithmetic(kind: str, numbers: tuple[int, int, int]) -> None:
    random = np.random.default_rng(len(kind) + numbers[1])
    vertex_bits, fraction, _ = numbers
    step, cell = Fraction(2) ** -fraction, Fraction(1 << (vertex_bits - 7))
    for _ in range(60):
        case = Case(random, numbers, kind)
        found, (low, high, offset) = case.words()
        exact = inverse(case.matrix)
        stretches = np.linalg.svd(np.array(case.matrix, dtype=float), compute_uv=False)
        # 24 bits, each rounded
        matrix = [found[f"matrix[{a}].{axis}"] for a in range(3) for axis in "xyz"]
        assert 1 << 23 <= max(map(abs, matrix)) < 1 << 24
        for value, whole in zip(matrix, chain(*exact), strict=True):
            assert abs(value - whole * 2 ** found["shift"]) <= Fraction(501, 1000)
        for a, axis in enumerate("xyz"):
            at = Fraction(case.position[a], 1 << POSITION_FRACTION) / step
            assert abs(found[f"origin.{axis}"] - at) <= Fraction(1, 2)
            for b, other in enumerate("xyz"):  # no unit vector becomes longer
                normal = float(exact[b][a]) * stretches[2] * 2.0**14
                assert abs(found[f"normal[{a}].{other}"] - normal) <= 0.51
        assert (found["root"], found["materialBase"]) == (77, 5)
        # Conservative by design, not by much
        ratio = stretches[0] / stretches[2]
        least = Fraction(((case.offset + 6) * stretches[0] + 8) * ratio)
        most_offset = 1 << (vertex_bits + fraction - 2)
        assert min(least * Fraction(1 - 1e-9), most_offset) <= offset
        assert offset <= min(
            math.ceil(least * Fraction(1 + 2.0**-12)) + 1 + ratio * 2.0 ** (fraction - 18), most_offset
        )
        corners = case.placed([Fraction(p, 1 << POSITION_FRACTION) for p in case.position])
        for a, axis in enumerate("xyz"):
            assert low[a] == max(math.floor(corners[0][a]) - 1, 0)
            assert high[a] == min(math.ceil(corners[1][a]) + 1, (1 << vertex_bits) - 1)
            wide = 2 * least * step
            first, last = math.floor((corners[0][a] - wide) / cell), math.floor((corners[1][a] + wide) / cell)
            box = found[f"box.low.{axis}"], found[f"box.high.{axis}"]
            assert max(0, first - 1) <= box[0] <= max(0, first)
            assert min(127, last) <= box[1] <= min(127, last + 1)


@pytest.mark.parametrize("config", ["small", "32b32s64d"])
def test_words_are_in_the_order_of_the_register_map(config: str) -> None:
    manifest = manifest_for(config, ("frame.instances=2",)).manifest
    for number in range(2):
        prefix = f"instances[{number}]."
        own = [one for name, one in manifest.registers.items() if name.startswith(prefix)]
        assert [one.name.removeprefix(prefix) for one in own] == ORDER[: len(own)]
        assert [one.address - own[0].address for one in own] == list(range(len(own)))
        for one in own:
            name = one.name.removeprefix(prefix).split(".")[0].split("[")[0]
            assert name == "root" or one.width == WIDTHS.get(name, manifest.numbers["gridBits"])


@pytest.mark.parametrize(
    ("linear", "message"),
    [
        (np.zeros((3, 3)), "object 2 is flat"),
        (np.diag([1.0, 1.0, 0.0]), "object 2 is flat"),
        (np.ones((3, 3)), "object 2 is flat"),
        (np.diag([1.0, 1.0, 0.9e-4]), "object 2 is flat"),
        (np.diag([1.0, 1.0, 1.1e-4]), "object 2 is too small"),
        (np.eye(3) / 400, "object 2 is too small"),
        (np.eye(3) * 1e-300, "object 2 is too small"),
        (np.eye(3) * 1e300, "object 2 is stretched too far"),
        (np.diag([1.0, 1.0, 20.0]), "object 2 is stretched too far"),
    ],
)
def test_transforms_out_of_range_are_refused(linear: Floats, message: str) -> None:
    manifest = manifest_for("small", ("frame.instances=2",)).manifest
    with pytest.raises(UserError, match=message):
        instance_registers([instance(np.eye(3)), instance(linear)], FRAME, manifest)


def test_an_object_at_the_end_of_the_range_is_accepted() -> None:
    manifest = manifest_for("small", ("frame.instances=2",)).manifest
    registers = instance_registers([instance(np.eye(3) / 390)], FRAME, manifest)
    assert registers["shading.offset"] > 0


@pytest.mark.parametrize("place", [(0.3, 0.0, 0.0), (-0.31, 0.0, 0.0), (0.0, 0.0, 5.0), (1e300, 0.0, 0.0)])
def test_an_object_that_leaves_the_world_is_refused(place: tuple[float, float, float]) -> None:
    target = _core.TargetInstances(16, 5, 32)
    one = instance(np.eye(3) / 2, place)
    with pytest.raises(ValueError, match="outside"):
        target.add(one.bounds_low, one.bounds_high, 60, 0, 0, *transform_values(one, FRAME))


def test_an_object_that_does_not_move_is_exact() -> None:
    """The identity: powers of two, and its own bounds."""
    manifest = manifest_for("small", ("frame.instances=2",)).manifest
    one = instance(np.eye(3))
    found = instance_registers([one, replace(one, transform=instance(-np.eye(3) / 2).transform)], FRAME, manifest)
    for number, factor in enumerate((1, -2)):
        matrix = [found[f"instances[{number}].matrix[{a}].{axis}"] for a in range(3) for axis in "xyz"]
        normal = [found[f"instances[{number}].normal[{a}].{axis}"] for a in range(3) for axis in "xyz"]
        assert np.array_equal(np.ldexp(matrix, -found[f"instances[{number}].shift"]), factor * np.eye(3).ravel())
        assert np.array_equal(normal, math.copysign(1 << 14, factor) * np.eye(3).ravel())
    assert [found[f"instances[0].origin.{axis}"] for axis in "xyz"] == [0, 0, 0]
    assert found["bounds.high.x"] == 65001
