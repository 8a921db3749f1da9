"""Figures of parts of a picture: an error counts only where it is."""

from __future__ import annotations

import numpy as np
import pytest

from colonnade.metrics import HIGHEST_PSNR, flip, flip_map
from colonnade.regions import compare_regions, frame_regions


@pytest.fixture
def picture() -> np.ndarray:
    return np.random.default_rng(4).integers(30, 220, (40, 60, 3), dtype=np.uint8)


def test_an_error_counts_in_its_region_alone(picture: np.ndarray) -> None:
    other = picture.copy()
    other[5:10, 5:10] += 30
    near, far = np.zeros((2, 40, 60), bool)
    near[4:12, 4:12] = True
    far[20:, 40:] = True
    result = compare_regions(picture, other, {"near": near, "far": far, "none": far & near}, with_dists=False)
    assert result["far"].psnr == HIGHEST_PSNR and result["far"].flip == pytest.approx(0, abs=1e-6)
    assert result["near"].psnr == pytest.approx(10 * np.log10(255**2 / (900 * 25 / 64)))
    assert result["near"].flip is not None and result["near"].flip > 0.02
    assert (result["none"].pixels, result["none"].psnr, result["none"].flip) == (0, None, None)


def test_the_whole_frame_is_a_region(picture: np.ndarray) -> None:
    other = 255 - picture
    result = compare_regions(picture, other, {"frame": np.ones((40, 60), bool)}, with_dists=False)["frame"]
    assert result.flip == pytest.approx(flip(picture, other), rel=1e-5)
    assert flip_map(picture, other).shape == (40, 60)


def test_the_shadow_is_background_that_is_darker(picture: np.ndarray) -> None:
    ratio = np.ones((4, 4, 3))
    ratio[1, :, 2] = 0.5
    ratio[2] = 0.98
    is_object = np.zeros((4, 4), bool)
    is_object[1, 0] = True
    regions = frame_regions(is_object, ratio)
    assert regions["frame"].all()
    assert regions["object"].sum() == 1
    np.testing.assert_array_equal(np.argwhere(regions["shadow"]), [[1, 1], [1, 2], [1, 3]])
