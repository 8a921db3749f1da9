"""Directions of gathered rays: the reference against the device's model, and their density."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from colonnade.common.vectors import unit_vectors
from colonnade.reference.scatter import (
    COORDINATE_BITS,
    gathered_directions,
    lobe_shares,
    microfacet_normals,
    pixel_words,
    sphere_points,
)

EVERY = np.stack(np.meshgrid(np.arange(256), np.arange(256)), axis=-1).reshape(-1, 2).astype(np.uint8)


def test_points_lie_on_the_sphere_and_are_spread_evenly() -> None:
    points = sphere_points(EVERY)
    assert np.abs(np.linalg.norm(points, axis=1) - 1).max() < 0.006
    assert np.abs(points.mean(axis=0)).max() < 1e-9
    assert np.abs(points.T @ points / len(points) - np.eye(3) / 3).max() < 0.001


@settings(max_examples=20)
@given(st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(lambda v: max(map(abs, v)) > 0.1))
def test_directions_have_the_cosine_as_their_density(normal: list[float]) -> None:
    unit = unit_vectors(np.array([normal]))
    normals, smooth = np.repeat(unit, len(EVERY), axis=0), np.zeros(len(EVERY))
    directions = unit_vectors(gathered_directions(normals, normals, sphere_points(EVERY), smooth))
    cosine = directions @ unit[0]
    assert (cosine < 0).mean() < 0.001
    assert abs(cosine.mean() - 2 / 3) < 0.001
    assert abs((cosine**2).mean() - 1 / 2) < 0.001


@settings(max_examples=20)
@given(
    st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(lambda v: max(map(abs, v)) > 0.1), st.floats(0.07, 0.6)
)
def test_lobes_have_the_angles_of_microfacets(axis: list[float], alpha: float) -> None:
    """Quantiles of GGX; as bright as the lights that are sampled."""
    axes = np.repeat(unit_vectors(np.array([axis])), len(EVERY), axis=0)
    found = unit_vectors(
        gathered_directions(axes, np.zeros_like(axes), sphere_points(EVERY), np.full(len(axes), alpha))
    )
    cosine = (found * axes).sum(axis=1)
    half = np.sort(np.sqrt((1 + cosine) / 2))[::-1]
    share = np.array([26, 64, 128, 192, 230]) / 256
    quantiles = [half[rank - 256 : rank + 256].mean() for rank in (share * len(half)).astype(int)]
    expected = (1 + alpha**2 * share / (1 - share)) ** -0.5
    assert np.abs(quantiles - expected).max() < 0.002
    facets = microfacet_normals(axes, -axes, sphere_points(EVERY), np.full(len(axes), alpha))
    ordered = np.sort((facets * axes).sum(axis=1))[::-1]
    assert np.abs([ordered[rank] for rank in (share * len(half)).astype(int)] - expected).max() < 0.004
    # The share over pi is the density of directions: its integral is the number of them before the axis
    x = np.linspace(0, 1, 100_001)
    assert abs(2 * lobe_shares(x, np.full(len(x), alpha)).mean() - (cosine > 0).mean()) < 0.01


@settings(max_examples=50)
@given(st.integers(0, 120), st.integers(0, 120), st.sampled_from([4, 8]))
def test_pixels_of_a_square_have_points_far_apart(column: int, row: int, edge: int) -> None:
    y, x = np.mgrid[row * edge : (row + 1) * edge, column * edge : (column + 1) * edge]
    cells = pixel_words(x.ravel(), y.ravel()).astype(int) * edge // 256
    assert len({tuple(cell) for cell in cells}) == edge * edge


def test_points_repeat_beyond_the_coordinates_that_count() -> None:
    x, y = np.array([5, 5 + (1 << COORDINATE_BITS)]), np.array([77, 77])
    assert (pixel_words(x, y)[0] == pixel_words(x, y)[1]).all()
