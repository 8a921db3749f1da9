"""Panoramas: reading, directions, their cube, and the lights that are found in them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from PIL import Image

from colonnade.common.errors import UserError
from colonnade.common.srgb import linear_from_srgb
from colonnade.common.types import Floats
from colonnade.environment import panorama_file
from colonnade.environment.light_cube import FACE, face_directions
from colonnade.environment.panorama import Panorama
from colonnade.environment.panorama_file import ROWS, read_panorama
from colonnade.environment.panorama_lights import split_lights


def write(path: Path, pixels: Floats, channels: tuple[str, ...] = ("R", "G", "B"), tile: int = 0) -> Path:
    spec = OpenImageIO.ImageSpec(pixels.shape[1], pixels.shape[0], len(channels), "float")
    spec.channelnames = channels
    spec.tile_width = spec.tile_height = tile
    output = OpenImageIO.ImageOutput.create(str(path))
    assert output is not None and output.open(str(path), spec) and output.write_image(pixels.astype(np.float32))
    output.close()
    return path


def disc(direction: tuple[float, float, float], radius: float, level: float, ground: float = 0.2) -> Panorama:
    """A disc of white light in a grey surround."""
    panorama = Panorama(np.full((ROWS, 2 * ROWS, 3), ground))
    inside = panorama.directions() @ (np.array(direction) / np.linalg.norm(direction)) > np.cos(radius)
    return Panorama(np.where(inside[..., None], level, panorama.radiance))


@pytest.mark.parametrize("name", ["sky.hdr", "sky.exr", "sky.png"])
def test_formats_show_the_same(name: str, tmp_path: Path) -> None:
    """Up is the first row; the middle looks along -z, and x is to its right."""
    pixels = np.zeros((4, 8, 3))
    pixels[0] = 1.0
    pixels[2, 4:6] = (0.25, 0.5, 0.0)
    if name.endswith("png"):
        codes = np.rint(255 * np.array([[0.0], [0.5], [1.0]]) * [1, 1, 1]).astype(np.uint8)
        picture = np.where(pixels[..., :1] == 1, codes[2], np.where(pixels[..., 1:2] > 0, codes[1], codes[0]))
        Image.fromarray(picture.astype(np.uint8)).save(tmp_path / name)
        expected = linear_from_srgb(np.array([128 / 255] * 3))
    else:
        write(tmp_path / name, pixels)
        expected = np.array([0.25, 0.5, 0.0])
    panorama = read_panorama(tmp_path / name)
    assert panorama.radiance.shape == (ROWS, 2 * ROWS, 3)
    found = panorama.at(np.array([[0, 9.0, 0.1], [0.1, -0.1, -1.0], [0.5, -0.1, 1.0], [0, -1.0, 0]]))
    np.testing.assert_allclose(found, [[1, 1, 1], expected, [0, 0, 0], [0, 0, 0]], atol=0.005)
    turned = Panorama(panorama.radiance, yaw=90.0)
    np.testing.assert_allclose(turned.at(np.array([[-1.0, -0.1, -0.1]]))[0], expected, atol=0.005)


@settings(max_examples=8)
@given(st.integers(2, 400), st.floats(0.01, 50))
def test_a_constant_panorama_is_a_constant_cube(
    tmp_path_factory: pytest.TempPathFactory, rows: int, level: float
) -> None:
    file = tmp_path_factory.mktemp("constant") / "a.exr"
    panorama = read_panorama(write(file, np.full((rows, 2 * rows, 3), level)))
    np.testing.assert_allclose(panorama.mean(), level, rtol=1e-6)
    np.testing.assert_allclose(panorama.cube(FACE).texels, level, rtol=1e-6)


@pytest.mark.parametrize("yaw", [-90.0, 37.0])
def test_yaw_turns_the_directions(yaw: float) -> None:
    """A panorama's own directions show its pixels, whatever its yaw; a turned light is elsewhere by that angle."""
    random = np.random.default_rng(1).random((ROWS, 2 * ROWS, 3))
    panorama = Panorama(random, yaw)
    np.testing.assert_array_equal(panorama.at(panorama.directions().reshape(-1, 3)), random.reshape(-1, 3))
    (light,), _ = split_lights(Panorama(disc((0.0, 0.3, -1.0), 0.1, 20.0).radiance, yaw), 1)
    expected = np.array([-np.sin(np.radians(yaw)), 0.3, -np.cos(np.radians(yaw))]) / np.sqrt(1.09)
    assert np.abs(light.direction - expected).max() < 0.01


@settings(max_examples=8)
@given(
    st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1)).filter(lambda v: float(np.linalg.norm(v)) > 0.1),
    st.floats(0.06, 0.3),
    st.floats(10.0, 500.0),
)
@example((0.0, 0.1, 1.0), 0.25, 50.0)
@example((0.0, -1.0, 0.05), 0.25, 50.0)
def test_a_lamp_becomes_a_light_of_its_size(direction: tuple[float, float, float], radius: float, level: float) -> None:
    """Across the seam and over a pole, too. Light and rest together have the light of the panorama."""
    panorama = disc(direction, radius, level)
    (light,), rest = split_lights(panorama, 4)
    assert light.direction @ np.array(direction) / np.linalg.norm(direction) > 0.999
    assert abs(light.radius - radius) < 0.03 * radius + 0.01
    np.testing.assert_allclose(light.colour / 4 + rest.mean(), panorama.mean(), rtol=1e-9)
    assert rest.radiance.max() <= 1.0 + 1e-9
    weights = np.broadcast_to(face_directions(FACE)[1][..., None], (FACE, FACE, 3))
    whole = (rest.cube(FACE).texels * weights).sum(axis=(0, 1, 2)) / (6 * weights[..., 0].sum())
    np.testing.assert_allclose(whole, rest.mean(), rtol=0.01)


def test_a_wide_region_becomes_several_lights() -> None:
    panorama = disc((1.0, 0.2, 0.0), 0.6, 20.0)
    lights, rest = split_lights(panorama, 8)
    assert len(lights) > 1 and all(light.radius < np.radians(20) for light in lights)
    assert rest.radiance.max() <= 1.0 + 1e-9, "nothing stays that a ray would cut off"
    np.testing.assert_allclose(sum(light.colour for light in lights) / 4 + rest.mean(), panorama.mean(), rtol=1e-9)


def test_the_panes_of_a_window_are_one_light_beside_a_lamp() -> None:
    """Each pane has more light than the lamp, whose rays are brighter."""
    panes = disc((1.0, 0.0, -0.18), 0.15, 12.0, 0.0), disc((1.0, 0.0, 0.18), 0.15, 12.0, 0.0)
    panorama = Panorama(0.2 + sum(part.radiance for part in (*panes, disc((0.0, 1.0, 0.0), 0.05, 60.0, 0.0))))
    (window, lamp), rest = split_lights(panorama, 2)
    assert window.direction[0] > 0.999 and lamp.direction[1] > 0.999
    assert 0.15 < window.radius < 0.4 and lamp.radius < 0.06
    assert rest.radiance.max() <= 1.0 + 1e-9


def test_faint_regions_stay_light_by_direction() -> None:
    for panorama in (disc((1, 0, 0), 0.02, 10.0), disc((1, 0, 0), 0.2, 0.9)):
        lights, rest = split_lights(panorama, 2)
        assert lights == []
        np.testing.assert_array_equal(rest.radiance, panorama.radiance)


def test_the_brightest_lights_come_first() -> None:
    parts = [
        disc(towards, 0.1, level, 0.0) for towards, level in (((1, 0, 0), 9.0), ((0, 0, 1), 30.0), ((0, 1, 0), 20.0))
    ]
    panorama = Panorama(0.2 + sum(part.radiance for part in parts))
    lights, rest = split_lights(panorama, 2)
    assert [int(np.abs(light.direction).argmax()) for light in lights] == [2, 1]
    assert rest.radiance.max() > 9, "the third one stays"


def test_a_panorama_that_reaches_a_limit_is_cut_off() -> None:
    sun = disc((0.0, 1.0, 0.0), 0.2, 30.0).radiance * np.linspace(0.5, 1.0, 2 * ROWS)[:, None]
    assert not Panorama(sun).is_cut_off
    assert Panorama(sun.clip(max=1.0)).is_cut_off


def test_bad_panoramas_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    grey = np.full((4, 8, 3), 0.5)
    (tmp_path / "cut.exr").write_bytes(write(tmp_path / "whole.exr", grey).read_bytes()[:300])
    (tmp_path / "cut.hdr").write_bytes(write(tmp_path / "whole.hdr", grey).read_bytes()[:60])
    (tmp_path / "text.hdr").write_text("no picture")
    write(tmp_path / "square.hdr", np.full((8, 8, 3), 0.5))
    write(tmp_path / "depth.exr", grey[..., :1], ("Z",))
    write(tmp_path / "bright.exr", np.where(np.arange(8)[None, :, None] == 3, np.inf, grey))
    for name, words in {
        "none.hdr": "no panorama",
        "cut.exr": "not a readable panorama",
        "cut.hdr": "not a readable panorama",
        "text.hdr": "give a Radiance HDR, OpenEXR, PNG",
        "square.hdr": "is 8x8 pixels: a panorama is equirectangular, twice as wide as high",
        "depth.exr": "has the channels Z: a panorama needs R, G, B, or Y",
        "bright.exr": "holds light that is not finite",
    }.items():
        with pytest.raises(UserError, match=words):
            read_panorama(tmp_path / name)
    monkeypatch.setitem(sys.modules, "OpenImageIO", None)
    with pytest.raises(UserError, match=r"pip install 'colonnade\[panorama\]'"):
        read_panorama(tmp_path / "whole.hdr")


def test_a_large_panorama_is_its_means_by_solid_angle(tmp_path: Path) -> None:
    radiance = np.random.default_rng(1).random((600, 1200, 3)).astype(np.float32).astype(np.float64)
    found = read_panorama(write(tmp_path / "a.exr", radiance))
    tiled = read_panorama(write(tmp_path / "tiled.exr", radiance, tile=48))
    np.testing.assert_array_equal(tiled.radiance, found.radiance)
    assert found.radiance.shape == (ROWS, 2 * ROWS, 3)
    np.testing.assert_allclose(found.mean(), Panorama(radiance).mean(), rtol=1e-3)
    angles = Panorama(radiance).solid_angles()[:2]  # rows 0 and 1 become the first one, as do columns 0 and 1
    expected = (radiance[:2, :2] * angles[..., None]).sum(axis=(0, 1)) / (2 * angles.sum())
    np.testing.assert_allclose(found.radiance[0, 0], expected)


def test_layers_take_no_memory(tmp_path: Path) -> None:
    """Of all channels only R, G and B are decoded to numbers, in a process with limits."""
    layers = tuple(f"layer{number}.Z" for number in range(61))
    pixels = np.broadcast_to(np.array([[[2.0]]]), (512, 1024, 64))
    file = write(tmp_path / "layers.exr", pixels, ("R", "G", "B", *layers))
    program = (
        "import resource, sys; from pathlib import Path\n"
        "from colonnade.environment.panorama_file import read_panorama\n"
        "assert (read_panorama(Path(sys.argv[1])).radiance == 2.0).all()\n"
        "print(Path('/proc/self/status').read_text().split('VmHWM:')[1].split()[0])\n"
        "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
    )
    done = subprocess.run([sys.executable, "-c", program, file], capture_output=True, text=True, check=True)
    assert sum(map(int, done.stdout.split())) < 300 << 10  # KiB; all channels take 400 MiB


def test_a_panorama_beyond_the_limits_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("R", "G", "B", *(f"layer{number}.Z" for number in range(62)))
    with pytest.raises(UserError, match=r"many\.exr has 65 channels, 64 at most: leave out layers"):
        read_panorama(write(tmp_path / "many.exr", np.ones((4, 8, 65)), names))
    large = write(tmp_path / "large.exr", np.ones((1024, 2048, 3)))
    monkeypatch.setattr(panorama_file, "_MEMORY", 1 << 23)
    with pytest.raises(UserError, match=r"large\.exr is damaged, or takes more than 8 MiB or 60 s to decode"):
        read_panorama(large)


def test_grey_is_light_of_all_channels(tmp_path: Path) -> None:
    np.testing.assert_allclose(read_panorama(write(tmp_path / "y.exr", np.full((4, 8, 1), 2.0), ("Y",))).radiance, 2.0)
