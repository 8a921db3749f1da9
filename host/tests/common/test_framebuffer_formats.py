"""Photos with strengths of the shadow: the shell's rule is the host's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from colonnade.common.accumulation import UNSHADOWED, Accumulation
from colonnade.common.framebuffer import Frame
from colonnade.common.framebuffer_formats import framebuffer_bytes, photo_lines
from colonnade.common.image_io import decode_srgb, encode_srgb

SHAPE = (256, 33)


@pytest.fixture(scope="module")
def frame() -> Frame:
    """Pixels in columns, whose ratios are the first column's."""
    random = np.random.default_rng(5)
    colour = random.integers(0, 4096, (*SHAPE, 3)).astype(np.uint16)
    ratio = np.repeat(random.integers(0, 2 * UNSHADOWED, (SHAPE[0], 1, 3)), SHAPE[1], axis=1).astype(np.uint16)
    empty, none = np.zeros(SHAPE), np.zeros(SHAPE, np.int64)
    return Frame(colour, random.random(SHAPE) < 0.2, none, none, empty, {}, [], ratio)


@pytest.fixture(scope="module")
def photo() -> np.ndarray:
    """Each strength in a row."""
    colours = np.random.default_rng(6).integers(0, 256, (*SHAPE, 3))
    return np.dstack([colours, np.repeat(np.arange(256)[:, None], SHAPE[1], axis=1)]).astype(np.uint8)


def test_the_shell_composites_as_the_host(frame: Frame, photo: np.ndarray) -> None:
    lines = framebuffer_bytes(frame, 0, photo)
    host = Accumulation.of_frame(frame).over(decode_srgb(photo[..., :3]), photo[..., 3])
    np.testing.assert_array_equal(lines.reshape(*SHAPE, 4)[..., 2::-1], encode_srgb(host))


def test_whole_shadows_are_those_of_a_photo_without_strengths_and_strength_0_is_the_photo(
    frame: Frame, photo: np.ndarray
) -> None:
    colours = np.ascontiguousarray(photo[..., :3])
    whole, none = (np.dstack([colours, np.full(SHAPE, strength, np.uint8)]) for strength in (255, 0))
    for code in range(3):
        plain = framebuffer_bytes(frame, code, colours)
        np.testing.assert_array_equal(framebuffer_bytes(frame, code, whole), plain)
        assert (framebuffer_bytes(frame, code, photo) != plain).any()
    background = replace(frame, is_object=np.zeros(SHAPE, np.bool_))
    written = framebuffer_bytes(background, 0, none).reshape(*SHAPE, 4)
    np.testing.assert_array_equal(written[..., 2::-1], colours)


def test_photos_have_lines_of_whole_tile_rows(photo: np.ndarray) -> None:
    lines = photo_lines(photo, 16).reshape(SHAPE[0], 48, 4)
    np.testing.assert_array_equal(lines[:, : SHAPE[1]], photo[..., [2, 1, 0, 3]])
    assert (photo_lines(photo[..., :3], 8).reshape(SHAPE[0], 40, 4)[..., 3] == 255).all()
