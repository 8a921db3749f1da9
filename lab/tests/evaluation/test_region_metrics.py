"""Metrics of regions: an error counts only in its region."""

from __future__ import annotations

import numpy as np
import pytest
from colonnade.quality.image_metrics import MAX_PSNR, flip, flip_map

from colonnade_lab.evaluation import region_metrics
from colonnade_lab.evaluation.region_metrics import compare_regions, frame_regions


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
    assert result["far"].psnr == MAX_PSNR and result["far"].flip == pytest.approx(0, abs=1e-6)
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
    parts = frame_regions(is_object, ratio)
    assert parts["frame"].all()
    assert parts["object"].sum() == 1
    np.testing.assert_array_equal(np.argwhere(parts["shadow"]), [[1, 1], [1, 2], [1, 3]])


def test_dists_uses_only_the_region_and_a_margin(picture: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[tuple[np.ndarray, np.ndarray]] = []

    def keep(reference: np.ndarray, test: np.ndarray) -> float:
        seen.append((reference, test))
        return 0.25

    monkeypatch.setattr(region_metrics, "dists_or_none", keep)
    other, region = picture + np.uint8(10), np.zeros((40, 60), bool)
    region[20:25, 50:60] = True
    assert compare_regions(picture, other, {"part": region})["part"].dists == 0.25
    reference, test = seen[0]
    np.testing.assert_array_equal(reference, picture[12:33, 42:60])
    np.testing.assert_array_equal((reference != test).any(axis=2), region[12:33, 42:60])
