"""Arithmetic on float arrays with equal bits on every processor and with every number of threads.

numpy's `@`, `dot`, `tensordot`, `einsum` and `linalg`, and its elementary functions but `sqrt`, choose their order and
their rounding by the processor. What decides words of the device uses the functions of this module, and of numpy
elementwise operations, comparisons, `sqrt`, `sum`, `bincount` and sorting, whose order is fixed.
"""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats

Number = TypeVar("Number", np.float32, np.float64)

#: Rows of fewer numbers are summed by `sum` from left to right, but slowly.
_SHORT = 8


def product(a: NDArray[Number], b: NDArray[Number]) -> NDArray[Number]:
    """The matrix product of ``a`` [..., n, k] and ``b`` [..., k, m], summed by ascending k.

    A vector ``a`` [k] gives [..., m], a vector ``b`` [k] gives [..., n].
    """
    from colonnade import _core

    if a.ndim == 1:
        return product(a[np.newaxis], b)[..., 0, :] if b.ndim > 1 else product(a[np.newaxis], b)[0]
    if b.ndim == 1:
        return product(a, b[:, np.newaxis])[..., 0]
    stacks: tuple[int, ...] = np.broadcast_shapes(a.shape[:-2], b.shape[:-2])
    if b.ndim == 2 and a.ndim > 2:  # One product of all rows
        rows = a.reshape(math.prod(a.shape[:-1]), a.shape[-1])
        return product(rows, b).reshape(*a.shape[:-1], b.shape[-1])

    def stack(matrices: NDArray[Number]) -> NDArray[Number]:
        each = np.broadcast_to(matrices, stacks + matrices.shape[-2:])
        return np.ascontiguousarray(each).reshape(math.prod(stacks), *matrices.shape[-2:])

    # The transpose of a matrix need not be copied
    is_transposed = a.ndim == 2 and not stacks and a.T.flags.c_contiguous
    result: NDArray[Number] = _core.product(stack(a.T if is_transposed else a), stack(b), is_transposed)
    return result.reshape(*stacks, a.shape[-2], b.shape[-1])


def dot(a: Floats, b: Floats) -> Floats:
    """Scalar products of vectors [..., n] along their last axis."""
    products = a * b
    if not 0 < products.shape[-1] < _SHORT:
        return np.asarray(products.sum(axis=-1))
    total = products[..., 0]
    for index in range(1, products.shape[-1]):
        total = total + products[..., index]
    return np.asarray(total)


def solve(matrix: Floats, right_side: Floats) -> Floats:
    """Solve systems with symmetric positive definite matrices [..., n, n] for vectors [..., n], by elimination."""
    n = matrix.shape[-1]
    rows = np.concatenate([matrix, right_side[..., np.newaxis]], axis=-1)
    for k in range(n - 1):
        factors = rows[..., k + 1 :, k] / rows[..., k, np.newaxis, k]
        rows[..., k + 1 :, k:] -= factors[..., np.newaxis] * rows[..., k, np.newaxis, k:]
    solution = np.empty(np.broadcast_shapes(matrix.shape[:-1], right_side.shape))
    for k in reversed(range(n)):
        known = dot(rows[..., k, k + 1 : n], solution[..., k + 1 :])
        solution[..., k] = (rows[..., k, n] - known) / rows[..., k, k]
    return solution


def log(x: Floats) -> Floats:
    """Natural logarithms of positive numbers; relative error below 2^-50."""
    return _each("log", x)


def exp(x: Floats) -> Floats:
    """Exponentials; relative error below 2^-48 for \\|x\\| < 64."""
    return _each("exp", x)


def power(x: Floats, y: float) -> Floats:
    """Numbers >= 0 to a power; relative error below 2^-45 for results from 2^-64 to 2^64."""
    return _each("power", x, y)


def cos(x: Floats) -> Floats:
    """Cosines of angles below 2^20; error below 2^-50."""
    return _each("cosine", x, 0)


def sin(x: Floats) -> Floats:
    """Sines of angles below 2^20; error below 2^-50."""
    return _each("cosine", x, 1)


def arccos(x: Floats) -> Floats:
    """Arc cosines of -1 to 1; error below 2^-49."""
    return _each("arccos", x)


def arctan2(y: Floats, x: Floats) -> Floats:
    """Angles of the vectors (x, y), -pi to pi; error below 2^-50."""
    from colonnade import _core

    up, across = np.broadcast_arrays(np.asarray(y, np.float64), np.asarray(x, np.float64))
    angles: Floats = _core.arctan2(up.ravel(), across.ravel())
    return angles.reshape(up.shape)


def _each(function: str, x: Floats, *arguments: float) -> Floats:
    from colonnade import _core

    values = np.asarray(x, np.float64)
    results: Floats = getattr(_core, function)(np.ascontiguousarray(values).ravel(), *arguments)
    return results.reshape(values.shape)
