"""Rays between float32 and the device's integers, against exact arithmetic (docs/numbers.md, section 9)."""

from __future__ import annotations

from fractions import Fraction
from math import ceil, floor, inf, isfinite, isnan

import numpy as np
import pytest
from numpy.typing import NDArray

from colonnade import _core
from colonnade.design.generator import manifest_for
from colonnade.scene_image.packer import record_format

PLACEMENT = {"mantissa": 0xC0FFEE, "exponent": 5, "base": (-(1 << 17), 12345, 7)}
LEGAL, REFUSED, OUT_OF_RANGE = range(3)


def numbers_of(config: str) -> dict[str, int]:
    manifest = manifest_for(config).manifest
    return {**manifest.numbers, **record_format(manifest)}


def exact(value: np.float32) -> Fraction:
    """A finite float32; subnormal ones are 0."""
    return Fraction(float(value)) if abs(value) >= np.finfo(np.float32).tiny else Fraction(0)


def power(exponent: int) -> Fraction:
    return Fraction(2) ** exponent


def expected(numbers: dict[str, int], ray: NDArray[np.float32]) -> tuple[int, tuple[int, ...] | None]:
    """Kind and integers of a ray by the rules; `round` of a fraction is to nearest, ties to even."""
    near, far = ray[3], ray[7]
    if not np.isfinite(ray[[0, 1, 2, 4, 5, 6]]).all() or isnan(near) or isnan(far) or near > far or far == -inf:
        return REFUSED, None
    direction = [exact(value) for value in ray[4:7]]
    dominant = max(map(abs, direction))
    if dominant == 0 or (isfinite(far) and exact(far) < 0):
        return REFUSED, None
    g, e, scale = numbers["gridFraction"], PLACEMENT["exponent"], Fraction(PLACEMENT["mantissa"], 1 << 24)
    places = [
        round((round(exact(value) * power(g + e + 3)) - base) * scale / 8)
        for value, base in zip(ray[:3], PLACEMENT["base"], strict=True)
    ]
    exponent = floor(np.log2(float(dominant))) + 1
    exponent += (dominant >= power(exponent)) - (dominant < power(exponent - 1))
    ways = [round(value * power(numbers["directionBits"] - 2 - exponent)) for value in direction]
    unlimited = (1 << (numbers["sceneBits"] + 1)) - 1
    steps = dominant * scale * power(e + g)
    low = unlimited if near == inf else max(0, 0 if near == -inf else ceil(exact(near) * steps))
    high = unlimited if far == inf else floor(exact(far) * steps) + 1
    values = (*places, *ways, min(low, unlimited), min(high, unlimited))
    return (OUT_OF_RANGE if max(map(abs, places)) >= 1 << (numbers["gridBits"] + 1) else LEGAL), values


def rays(random: np.random.Generator, count: int) -> NDArray[np.float32]:
    """Arbitrary patterns of bits, and rays near the box."""
    bits = random.integers(0, 1 << 32, size=(count, 8), dtype=np.uint32).view(np.float32)
    near = (random.normal(size=(count, 8)) * 2.0 ** random.integers(-9, 9, size=(count, 8))).astype(np.float32)
    near[:, 3] = np.abs(near[:, 3])
    near[:, 7] = near[:, 3] + np.abs(near[:, 7])
    mixed = np.where(random.random((count, 8)) < 0.1, bits, near)
    special = random.choice(np.float32([0, -0.0, inf, -inf, np.nan, 1e-42, -1e-42, 3e38]), size=(count, 8))
    return np.where(random.random((count, 8)) < 0.05, special, mixed)


@pytest.mark.parametrize("config", ("edge", "lean", "16b16s32d"))
def test_rays_are_those_of_exact_arithmetic(config: str) -> None:
    """Every exponent, subnormal numbers, infinities, no numbers; 3,000 rays a design."""
    numbers = numbers_of(config)
    batch = rays(np.random.default_rng(1), 3000)
    found = _core.convert_rays(numbers, batch, False, *PLACEMENT.values())
    kinds = [0, 0, 0]
    for ray, (kind, values, product, exponent) in zip(batch, found, strict=True):
        wanted, integers = expected(numbers, ray)
        kinds[kind] += 1
        assert kind == wanted, ray
        if kind == LEGAL:
            assert tuple(values) == integers, ray
            steps = max(exact(v) for v in np.abs(ray[4:7])) * power(
                numbers["gridFraction"] + PLACEMENT["exponent"] - 24
            )
            assert product * power(-exponent) == steps * PLACEMENT["mantissa"]
    assert min(kinds) > 30


def test_limits_at_the_ends_of_their_range() -> None:
    """A tfar of 0 along a direction of any length; a tnear that rounds up to 2^33 steps."""
    numbers = numbers_of("edge")
    ray = np.float32([[0, 0, 0, 0, 0, 0, 3e38, 0], [0, 0, 0, 8345589, 0, 0, 11242465 / 2**23, inf]])
    _, last = (values[6:] for _, values, *_ in _core.convert_rays(numbers, ray, True, 0xC00000, 5, (0, 0, 0)))
    first, _ = (values[6:] for _, values, *_ in _core.convert_rays(numbers, ray, True, 0xC00000, 110, (0, 0, 0)))
    assert tuple(first) == (0, 1)
    assert tuple(last) == ((1 << 33) - 1, (1 << 33) - 1)


def test_local_origins_have_no_base() -> None:
    numbers = numbers_of("edge")
    ray = np.float32([[0.5, -1, 2, 0, 0, 0, -3, 9]])
    scale = PLACEMENT["mantissa"] / 2**24 * 2 ** (PLACEMENT["exponent"] + numbers["gridFraction"])
    ((_, values, *_),) = _core.convert_rays(numbers, ray, True, *PLACEMENT.values())
    assert values[:3] == [round(0.5 * scale), round(-scale), round(2 * scale)]


def test_a_quotient_is_the_nearest_float() -> None:
    """Ties to even, overflow to infinity, no subnormal numbers."""
    random = np.random.default_rng(2)
    for _ in range(4000):
        numerator, denominator = (int(random.integers(1, 1 << int(bits))) for bits in random.integers(1, 62, size=2))
        exponent = int(random.integers(-230, 230)) if random.random() < 0.3 else int(random.integers(-40, 40))
        if random.random() < 0.2:  # a tie, or next to one
            denominator, numerator = 1 << 20, (int(random.integers(1 << 24, 1 << 25)) | 1) + (1 << 26) * 0
        value = Fraction(numerator, denominator) * power(exponent)
        found = np.float32(_core.nearest_float(numerator, denominator, exponent))
        largest = Fraction(float(np.finfo(np.float32).max))
        if value >= largest + power(103):
            assert found == np.inf
        elif found == 0:
            assert value < power(-126)
        else:
            below, above = (Fraction(float(np.nextafter(found, np.float32(way)))) for way in (0, 3.4e38))
            error = abs(Fraction(float(found)) - value)
            assert error <= abs(below - value)
            assert error <= abs(above - value)
            if error in (abs(below - value), abs(above - value)) and below != above != found:
                assert found.view(np.uint32) % 2 == 0
