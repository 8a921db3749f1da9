"""The normals of leaves: their length, which shading relies on, and their direction."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from colonnade import _core
from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors
from colonnade.design.manifest import Manifest

Integers = npt.NDArray[np.int64]

#: The lowest number of a code, and the length of the octahedron's axes
LOWEST, ONE = -1024, 1023


def sines(a: Floats, b: Integers) -> Floats:
    """Of the angles between vectors that are less than 90 degrees apart."""
    assert (np.einsum("ij,ij->i", a, b) > 0).all()
    return np.asarray(np.linalg.norm(np.cross(unit_vectors(a), unit_vectors(b.astype(np.float64))), axis=1))


def points(codes: Integers) -> Floats:
    """The points of the octahedron that codes stand for."""
    u, v = np.maximum(codes, -ONE).T
    z = ONE - np.abs(u) - np.abs(v)
    x, y = ((ONE - np.abs(b)) * np.where(a < 0, -1, 1) for a, b in ((u, v), (v, u)))
    return np.stack([np.where(z < 0, x, u), np.where(z < 0, y, v), z], axis=1).astype(np.float64)


def check_lengths(normals: Integers, along: Floats, one: int) -> None:
    """Normals are at most `one` long, but for the rounding of components, and at least 99 % of it along a direction."""
    assert np.abs(normals).max() <= one
    assert np.linalg.norm(normals, axis=1).max() <= one + np.sqrt(3) / 2
    assert np.einsum("ij,ij->i", normals, unit_vectors(along)).min() >= 0.99 * one


@pytest.mark.parametrize("step", [7, pytest.param(1, marks=pytest.mark.matrix)])
def test_every_code_of_a_corner_is_a_direction(manifest: Manifest, step: int) -> None:
    fraction = manifest.numbers["normalFraction"]
    numbers = np.unique(np.concatenate([np.arange(LOWEST, ONE + 1, step), [-ONE, -512, -1, 0, 1, 511, 512, ONE]]))
    codes = np.stack(np.meshgrid(numbers, numbers, indexing="ij"), axis=-1).reshape(-1, 2)
    exact, normals = points(codes), _core.corner_normals(codes, fraction)
    check_lengths(normals, exact, (1 << fraction) - 1)
    assert np.degrees(sines(exact, normals)).max() < 0.024


def test_a_code_is_near_its_normal(manifest: Manifest) -> None:
    random = np.random.default_rng(5)
    normals = random.normal(size=(100_000, 3)) * 10.0 ** random.uniform(-4, 1, (100_000, 3))
    normals = np.concatenate([normals, np.eye(3), -np.eye(3)])
    decoded = _core.corner_normals(_core.corner_codes(normals), manifest.numbers["normalFraction"])
    assert np.degrees(sines(normals, decoded)).max() < 0.14
    assert (np.sign(decoded[-6:]) == np.sign(normals[-6:])).all()


@pytest.mark.parametrize("count", [20_000, pytest.param(2_000_000, marks=pytest.mark.matrix)])
def test_a_geometric_normal_is_long_enough_to_leave_the_surface(manifest: Manifest, count: int) -> None:
    """Triangles of every size and shape; `surface_offset` relies on the length along the exact normal."""
    fraction = manifest.numbers["normalFraction"]
    random = np.random.default_rng(6)
    sizes = random.integers(1, 20, (count, 1, 3))
    triangles = random.integers(0, 1 << 24, (count, 3, 3)) >> (24 - sizes)
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals = _core.geometric_normals(triangles.reshape(-1, 9), fraction)
    has_area = cross.any(axis=1)
    assert not normals[~has_area].any() and has_area.sum() > count // 2
    exact = cross[has_area].astype(np.float64)
    check_lengths(normals[has_area], exact, (1 << fraction) - 1)
    assert np.degrees(sines(exact, normals[has_area])).max() < 0.07
