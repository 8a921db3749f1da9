"""Comparing pictures and hits: known values for known differences, and one clear line for invalid inputs."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from colonnade.cli.main import cli
from colonnade.common import image_io
from colonnade.common.errors import UserError
from colonnade.common.hits import Hits, read_hits, write_hits
from colonnade.quality.compare import compare
from colonnade.quality.image_metrics import MAX_PSNR, compare_hits, compare_pictures


@pytest.fixture
def picture() -> np.ndarray:
    """A picture with edges, ramps and noise, uint8 [32, 48, 3]."""
    rng = np.random.default_rng(3)
    ramp = np.linspace(0, 200, 48, dtype=np.uint8)
    base = np.broadcast_to(ramp[None, :, None], (32, 48, 3)).copy()
    base[8:20, 10:30] = (250, 40, 90)
    return base + rng.integers(0, 6, base.shape, dtype=np.uint8)


def save(path: Path, pixels: np.ndarray) -> Path:
    Image.fromarray(pixels).save(path)
    return path


def test_identical_pictures_are_perfect(picture: np.ndarray) -> None:
    difference = compare_pictures(picture, picture.copy())
    assert difference.identical
    assert difference.differing_pixels == 0
    assert difference.psnr == MAX_PSNR
    assert difference.ssim == pytest.approx(1.0)
    assert difference.flip == pytest.approx(0.0)


def test_one_channel_of_one_pixel_counts_once(picture: np.ndarray) -> None:
    other = picture.copy()
    other[5, 7, 1] += 10
    difference = compare_pictures(picture, other)
    assert not difference.identical
    assert difference.differing_pixels == 1
    assert difference.psnr == pytest.approx(10 * math.log10(255**2 / (100 / picture.size)))


def test_metrics_rank_a_small_error_before_a_large_one(picture: np.ndarray) -> None:
    rng = np.random.default_rng(5)
    noise = rng.normal(size=picture.shape)
    near, far = (np.clip(picture + scale * noise, 0, 255).astype(np.uint8) for scale in (3, 40))
    small, large = compare_pictures(picture, near), compare_pictures(picture, far)
    assert small.psnr > large.psnr
    assert small.ssim is not None and large.ssim is not None and small.ssim > large.ssim
    assert 0 < small.flip < large.flip


@pytest.mark.parametrize("shape", [(1, 1), (2, 9), (3, 3), (10, 10)])
def test_tiny_pictures_compare(shape: tuple[int, int]) -> None:
    black = np.zeros((*shape, 3), np.uint8)
    difference = compare_pictures(black, black + np.uint8(255))
    assert difference.differing_pixels == shape[0] * shape[1]
    assert difference.psnr == pytest.approx(0.0)
    assert (difference.ssim is None) == (min(shape) < 3)


def test_hit_and_triangle_disagreement_have_their_own_denominators() -> None:
    first = np.array([[0, 1, 2, -1, -1]], np.int64)
    second = np.array([[0, 9, -1, -1, 4]], np.int64)
    difference = compare_hits(first, second)
    assert difference.hit_disagreement == pytest.approx(2 / 5)
    assert difference.triangle_disagreement == pytest.approx(1 / 2)


def test_frames_without_a_common_hit_have_no_triangle_disagreement() -> None:
    difference = compare_hits(np.array([[-1, 3]]), np.array([[3, -1]]))
    assert (difference.hit_disagreement, difference.triangle_disagreement) == (1.0, 0.0)


def test_hits_round_trip_through_a_file(tmp_path: Path) -> None:
    hits = Hits(np.array([[3, -1]], np.int64), np.array([[0.25, np.nan]]))
    write_hits(tmp_path / "h.npz", hits)
    again = read_hits(tmp_path / "h.npz")
    np.testing.assert_array_equal(again.triangle, hits.triangle)
    np.testing.assert_array_equal(again.t, hits.t)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["h.npz"]


def test_png_round_trip_is_exact_in_srgb(tmp_path: Path) -> None:
    codes = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    image_io.write_png(tmp_path / "p.png", image_io.decode_srgb(codes))
    np.testing.assert_array_equal(image_io.read_picture(tmp_path / "p.png"), codes)


def test_colours_saturate() -> None:
    np.testing.assert_array_equal(image_io.encode_srgb(np.array([-0.5, 0.0, 1.0, 7.0])), [0, 0, 255, 255])


def test_command_reports_pictures_and_hits(tmp_path: Path, picture: np.ndarray) -> None:
    a, b = save(tmp_path / "a.png", picture), save(tmp_path / "b.png", picture)
    write_hits(tmp_path / "a.npz", Hits(np.zeros((2, 2), np.int64), np.ones((2, 2))))
    write_hits(tmp_path / "b.npz", Hits(np.array([[0, 0], [0, -1]]), np.ones((2, 2))))
    arguments = [*map(str, ("compare", a, b, "--hits-a", tmp_path / "a.npz", "--hits-b", tmp_path / "b.npz"))]
    result = CliRunner().invoke(cli, [*arguments, "--no-dists", "--json", str(tmp_path / "r.json")])
    assert result.exit_code == 0, result.output
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["identical"] is True
    assert report["dists"] is None
    assert report["hit_disagreement"] == 0.25
    assert report["triangle_disagreement"] == 0.0


def test_two_hits_files_compare_without_pictures(tmp_path: Path) -> None:
    write_hits(tmp_path / "a.npz", Hits(np.zeros((2, 2), np.int64), np.ones((2, 2))))
    report = compare(tmp_path / "a.npz", tmp_path / "a.npz")
    assert report["hit_disagreement"] == 0.0
    assert report["psnr"] is None and report["identical"] is None


def test_invalid_inputs_are_rejected(tmp_path: Path, picture: np.ndarray) -> None:
    a, smaller = save(tmp_path / "a.png", picture), save(tmp_path / "s.png", picture[:10, :10])
    hits = tmp_path / "h.npz"
    write_hits(hits, Hits(np.zeros((2, 2), np.int64), np.ones((2, 2))))
    noise = tmp_path / "noise.png"
    noise.write_bytes(b"no picture at all")
    wrong = tmp_path / "wrong.npz"
    wrong.write_bytes(noise.read_bytes())
    np.savez(tmp_path / "other.npz", something=np.zeros(3))
    cases: list[tuple[tuple[Path | None, ...], str]] = [
        ((a, smaller), "48x32"),
        ((a, tmp_path / "none.png"), "no picture"),
        ((a, noise), "not a readable picture"),
        ((a, hits), "two pictures or two .npz"),
        ((a, a, hits, None), "both --hits-a and --hits-b"),
        ((hits, hits, hits, hits), "leave out"),
        ((hits, wrong), "not a hits file"),
        ((hits, tmp_path / "other.npz"), "not a hits file"),
        ((hits, tmp_path / "none.npz"), "no hits file"),
    ]
    for arguments, message in cases:
        with pytest.raises(UserError, match=message):
            compare(*arguments)  # type: ignore[arg-type]
