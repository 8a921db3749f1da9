"""Arithmetic in a fixed order: near the exact results, and summed in the order that its page states."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from colonnade.common import fixed_order

SIZES = st.integers(0, 21)


@given(rows=SIZES, inner=SIZES, columns=SIZES, seed=st.integers(0, 2**32 - 1), single=st.booleans())
def test_products_are_summed_by_ascending_index(rows: int, inner: int, columns: int, seed: int, single: bool) -> None:
    """Whatever the blocks: large and small numbers of both signs show any other order."""
    generator = np.random.default_rng(seed)
    kind = np.float32 if single else np.float64
    a, b = (
        (generator.normal(size=shape) * 10.0 ** generator.integers(-6, 6, shape)).astype(kind)
        for shape in ((rows, inner), (inner, columns))
    )
    expected = np.zeros((rows, columns), kind)
    for k in range(inner):
        expected = expected + a[:, k, np.newaxis] * b[k]
    found = fixed_order.product(a, b)
    assert found.dtype == kind
    np.testing.assert_array_equal(found, expected)
    # A transpose has other memory
    np.testing.assert_array_equal(fixed_order.product(np.ascontiguousarray(a.T).T, b), expected)


def test_products_of_stacks_and_vectors() -> None:
    generator = np.random.default_rng(1)
    a, b, vector = generator.normal(size=(5, 1, 4, 3)), generator.normal(size=(6, 3, 2)), generator.normal(size=3)
    np.testing.assert_allclose(fixed_order.product(a, b), a @ b, rtol=1e-12)
    np.testing.assert_allclose(fixed_order.product(a, b[0]), a @ b[0], rtol=1e-12)
    np.testing.assert_allclose(fixed_order.product(a, vector), a @ vector, rtol=1e-12)
    np.testing.assert_allclose(fixed_order.product(vector, b[0]), vector @ b[0], rtol=1e-12)


@given(seed=st.integers(0, 2**32 - 1), size=st.integers(1, 12))
def test_solutions_of_systems(seed: int, size: int) -> None:
    generator = np.random.default_rng(seed)
    rows = generator.normal(size=(3, size + 2, size))
    matrix, expected = rows.transpose(0, 2, 1) @ rows + np.eye(size), generator.normal(size=(3, size))
    right_side = (matrix @ expected[..., np.newaxis])[..., 0]
    np.testing.assert_allclose(fixed_order.solve(matrix, right_side), expected, atol=1e-9)


@pytest.mark.parametrize(
    ("ours", "exact", "low", "high"),
    [
        (fixed_order.log, math.log, 1e-12, 1e12),
        (fixed_order.exp, math.exp, -60.0, 60.0),
        (lambda x: fixed_order.power(x, 2.4), lambda x: x**2.4, 1e-6, 1e6),
        (lambda x: fixed_order.power(x, 1 / 2.4), lambda x: x ** (1 / 2.4), 1e-6, 1e6),
        (fixed_order.sin, math.sin, -1000.0, 1000.0),
        (fixed_order.cos, math.cos, -1000.0, 1000.0),
        (fixed_order.arccos, math.acos, -1.0, 1.0),
        (lambda x: fixed_order.arctan2(x, x * x - 1), lambda x: math.atan2(x, x * x - 1), -3.0, 3.0),
    ],
)
def test_elementary_functions(ours, exact, low: float, high: float) -> None:  # type: ignore[no-untyped-def]
    x = np.concatenate([np.linspace(low, high, 4001), np.geomspace(max(low, 1e-9), high, 1001)])
    expected = np.array([exact(value) for value in x.tolist()])
    np.testing.assert_allclose(ours(x), expected, rtol=2.0**-45, atol=2.0**-49)


@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 70),
    spread=st.sampled_from([0.0, 1.0, 300.0, 1074.0]),
    exponent=st.sampled_from([1 / 2.4, 2.4, -3.0, 0.0, 300.0]),
)
def test_powers_of_a_block_are_those_of_each_number(seed: int, count: int, spread: float, exponent: float) -> None:
    """To the bit, whatever else the block holds."""
    generator = np.random.default_rng(seed)
    x = generator.random(count) * 2.0 ** generator.uniform(-spread, min(spread, 1023.0), count)
    odd = generator.random(count) < 0.02
    x[odd] = generator.choice([0.0, 5e-324, math.inf], int(odd.sum()))
    found = fixed_order.power(x, exponent)
    each = [fixed_order.power(x[index : index + 1], exponent)[0] for index in range(count)]
    np.testing.assert_array_equal(found.view(np.int64), np.array(each).view(np.int64))


def test_quarters_of_a_circle() -> None:
    angles = np.radians([0.0, 90.0, 180.0, 270.0, -90.0])
    np.testing.assert_allclose(fixed_order.cos(angles), [1, 0, -1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(fixed_order.sin(angles), [0, 1, 0, -1, -1], atol=1e-15)
    assert fixed_order.arctan2(np.zeros(3), np.array([0.0, 1.0, -1.0])).tolist() == [0.0, 0.0, math.pi]


@given(arrays.arrays(np.float64, 3, elements=st.floats(-1e3, 1e3)))
def test_dot(vector: np.ndarray) -> None:
    # A power of 2 may be rounded otherwise than a product
    x, y, z = vector
    assert fixed_order.dot(vector, vector) == x * x + y * y + z * z
