"""Grain and blur of photos, as added to pictures without any."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import ndimage

from colonnade.common.image_io import read_picture
from colonnade.environment.photo_blur import measured_blur
from colonnade.environment.photo_grain import Grain

SCENES = Path(__file__).parents[3] / "scenes"
#: Rooms that were rendered without noise, with textures.
SMOOTH = ("rooms/attic/photo.png", *(f"light/{name}/photo.webp" for name in ("attic", "chamber", "lean-to", "parlour")))


@cache
def picture(name: str) -> NDArray[np.uint8]:
    return read_picture(SCENES / name)


def noisy(photo: NDArray[np.uint8], grey: float, colour: float, seed: int = 0) -> NDArray[np.uint8]:
    """The photo with noise of a deviation that all channels share, and of each channel."""
    random = np.random.RandomState(seed)
    noise = grey * random.standard_normal(photo.shape[:2])[..., None] + colour * random.standard_normal(photo.shape)
    return np.rint(photo + noise).clip(0, 255).astype(np.uint8)


@pytest.mark.parametrize("name", SMOOTH)
def test_rooms_without_grain_and_blur_have_none(name: str) -> None:
    assert Grain.of(picture(name)) is None
    assert measured_blur(picture(name)) < 0.75


@settings(max_examples=8)
@given(name=st.sampled_from([SMOOTH[0], SMOOTH[3]]), grey=st.floats(1.5, 8), colour=st.floats(0.5, 4))
def test_noise_is_measured(name: str, grey: float, colour: float) -> None:
    grain = Grain.of(noisy(picture(name), grey, colour))
    assert grain is not None
    np.testing.assert_allclose(grain.deviation[:, 0], np.hypot(3**0.5 * grey, colour), rtol=0.15)
    np.testing.assert_allclose(grain.deviation[:, 1:], colour, rtol=0.15, atol=0.15)


def test_noise_follows_brightness() -> None:
    photo = picture(SMOOTH[1])
    scale = 1 + 4 * photo.mean(axis=2, keepdims=True) / 255
    noise = scale * np.random.RandomState(1).standard_normal(photo.shape)
    grain = Grain.of(np.rint(photo + noise).clip(0, 255).astype(np.uint8))
    assert grain is not None
    np.testing.assert_allclose(grain.deviation[:, 0], 1 + 4 * grain.brightness / 255, rtol=0.2)


def test_texture_is_no_grain() -> None:
    """A surface with as much detail in all octaves, and boards."""
    random = np.random.RandomState(2)
    rough = sum(ndimage.zoom(random.standard_normal((256 >> k, 320 >> k)) * 2**k, 1 << k, order=1) for k in range(5))
    assert Grain.of(np.repeat((128 + 4 * rough).clip(0, 255).astype(np.uint8)[..., None], 3, axis=2)) is None
    boards = np.repeat(np.tile([90, 100, 140, 120], (240, 80))[..., None], 3, axis=2).astype(np.uint8)
    assert Grain.of(boards) is None


def test_noise_of_a_frame_is_that_of_the_photo() -> None:
    grain = Grain.of(noisy(picture(SMOOTH[0]), 3.0, 1.0))
    assert grain is not None
    flat = np.full((240, 320, 3), 120.0)
    first, again, second = (grain.noise(flat, frame) for frame in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    assert abs(np.corrcoef(first.ravel(), second.ravel())[0, 1]) < 0.01
    found = Grain.of(np.rint(flat + first).astype(np.uint8))
    assert found is not None
    wanted = [np.interp(120.0, grain.brightness, own) for own in grain.deviation.T]
    np.testing.assert_allclose(found.deviation.mean(axis=0), wanted, rtol=0.1)


@pytest.mark.parametrize("name", SMOOTH[:2])
@pytest.mark.parametrize("noise", [0.0, 2.0])
def test_blur_is_measured(name: str, noise: float) -> None:
    """With the picture's own; a little too small is no harm."""
    own = measured_blur(picture(name))
    for blur in (0.8, 1.2, 1.8):
        soft = ndimage.gaussian_filter(picture(name).astype(float), (blur, blur, 0.0))
        found = measured_blur(noisy(np.rint(soft).astype(np.uint8), noise, 0.0))
        assert 0.8 * blur < found < 1.1 * np.hypot(blur, max(own, 0.3))


@pytest.mark.parametrize("size", [(60, 80), (1, 1), (16, 400), (17, 1)])
def test_small_and_plain_pictures_have_neither(size: tuple[int, int]) -> None:
    plain = np.full((*size, 3), 90, np.uint8)
    assert measured_blur(plain) == 0.0 and Grain.of(plain) is None
