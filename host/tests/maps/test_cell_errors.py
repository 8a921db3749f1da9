"""Tests of `colonnade.maps.cell_errors`."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from colonnade.maps.cell_errors import PIXEL_DETAIL, TilePixels
from colonnade.maps.layout import AttributeLayout
from colonnade.maps.tiles import sum_cells


@settings(max_examples=12)
@given(st.integers(0, 1000), st.sampled_from([2, 4, 8, 16]), st.sampled_from([16, 32]))
def test_costs_are_errors_with_less_weight_on_detail_of_single_pixels(seed: int, cells: int, size: int) -> None:
    random = np.random.default_rng(seed)
    layout = AttributeLayout(112, 80, tile_size=size, palette_size=16)
    pixels = TilePixels(random.uniform(0, 255, (80, 112, 3)), layout)
    entries = random.uniform(0, 255, (layout.tiles, 3, 3))
    distances = ((pixels.points[..., np.newaxis, :] - entries[:, np.newaxis, np.newaxis]) ** 2).sum(axis=4)
    expected = sum_cells(distances * pixels.weights[..., np.newaxis], cells)
    blocks = pixels.points.reshape(layout.tiles, size // 2, 2, size // 2, 2, 3)
    inside = pixels.weights.reshape(blocks.shape[:-1])[..., np.newaxis]
    means = (blocks * inside).sum(axis=(2, 4), keepdims=True) / np.maximum(
        inside.sum(axis=(2, 4), keepdims=True), 1e-12
    )
    detail = ((blocks - means) ** 2 * inside).sum(axis=5).reshape(pixels.weights.shape)
    if cells < size:
        expected -= (1 - PIXEL_DETAIL) * sum_cells(detail, cells)[..., np.newaxis]
    assert pixels.cell_costs(cells, entries) == pytest.approx(expected, rel=1e-3, abs=1e-2)
