"""The panorama behind the object in a scene without a room."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from PIL import Image

from colonnade.common.errors import UserError
from colonnade.common.srgb import linear_from_srgb
from colonnade.render.frames import render_frames
from colonnade.render.request import RenderRequest
from colonnade.render.result import RenderResult
from colonnade.scene.model import Background, Camera, MeshSource, Scene
from colonnade.scene.parser import load_scene
from colonnade.scene.passes import of_a_device

#: Colours of the four quarters around, from -z on to the right, and of the sky above 45 degrees, sRGB.
QUARTERS, ABOVE = [(200, 40, 40), (40, 200, 40), (40, 40, 200), (200, 200, 40)], (255, 255, 255)


def panorama(path: Path) -> Path:
    """A picture whose middle looks along -z."""
    pixels = np.zeros((80, 160, 3), np.uint8)
    for number, colour in enumerate(QUARTERS):
        pixels[:, (np.arange(40) + 60 + 40 * number) % 160] = colour
    pixels[:20] = ABOVE
    Image.fromarray(pixels).save(path)
    return path


def frame(sky: Background, backend: Literal["model", "reference"], samples: int = 1) -> RenderResult:
    scene = Scene(mesh=MeshSource(name="sphere:2"), camera=Camera(direction=(0.0, 0.0, 1.0)), background=sky)
    (result,) = render_frames(RenderRequest(scene.with_samples(samples), "tiny", backend=backend, size=(40, 30)))
    return result


@pytest.mark.parametrize("backend", ["model", "reference"])
@pytest.mark.parametrize("samples", [1, 4])
def test_pixels_beside_the_object_show_the_panorama(
    tmp_path: Path, backend: Literal["model", "reference"], samples: int
) -> None:
    """The camera looks along -z; turned by a quarter to the left, the panorama shows what is to the right of that."""
    sky = Background(panorama=panorama(tmp_path / "sky.png"), panorama_exposure=0.5)
    plain = frame(replace(sky, backdrop="colour"), backend, samples)
    corners = np.zeros((30, 40), bool)
    corners[12:18, :4] = corners[12:18, -4:] = True
    assert (plain.image[corners] == 0).all() and plain.object_mask.any()
    for yaw, quarter in ((0.0, 0), (90.0, 1), (-90.0, 3)):
        found = frame(replace(sky, panorama_yaw=yaw), backend, samples)
        expected = 0.5 * linear_from_srgb(np.array(QUARTERS[quarter]) / 255)
        np.testing.assert_allclose(found.image[corners], np.broadcast_to(expected, (48, 3)), atol=1e-9)
        inside = found.sums.coverage == samples
        if yaw == 0.0:
            np.testing.assert_array_equal(found.image[inside], plain.image[inside])
        edge = (found.sums.coverage > 0) & ~inside
        assert samples == 1 or (found.image[edge] >= plain.image[edge]).all()


def test_a_device_by_itself_says_that_it_does_not_draw_it(tmp_path: Path, told: list[str]) -> None:
    of_a_device(Scene(mesh=MeshSource(name="cube"), background=Background(panorama=tmp_path / "sky.png")))
    assert told == ["colonnade render draws the panorama behind the object; a device by itself shows background.colour"]


@pytest.mark.parametrize(
    ("background", "says"),
    [
        ('backdrop = "colour"', "background.backdrop is of a panorama: it needs background.panorama"),
        ('room = "a"\npanorama = "a.png"\nbackdrop = "panorama"', "is of scenes without a room: leave it out"),
    ],
)
def test_a_backdrop_without_use_is_refused(tmp_path: Path, background: str, says: str) -> None:
    (tmp_path / "a.toml").write_text(f"[background]\n{background}\n")
    with pytest.raises(UserError, match=says):
        load_scene(tmp_path / "a.toml")
