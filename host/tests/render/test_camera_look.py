"""The object in a photo has the grain and blur of its camera, and the photo stays as it is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from colonnade.common.accumulation import Accumulation
from colonnade.common.errors import UserError
from colonnade.common.image_io import decode_srgb, read_picture
from colonnade.common.srgb import srgb_from_linear
from colonnade.common.types import Floats
from colonnade.render.camera_look import CameraLook
from colonnade.render.composite import composited
from colonnade.scene.model import Camera, MeshSource, Scene
from colonnade.scene.parser import load_scene

SHARP = read_picture(Path(__file__).parents[3] / "scenes" / "rooms" / "attic" / "photo.png")
HEIGHT, WIDTH = SHARP.shape[:2]
SCENE = Scene(MeshSource(name="teapot:2"))
Y, X = np.mgrid[:HEIGHT, :WIDTH]
DISC = (X - 320) ** 2 + (Y - 240) ** 2 < 100**2


def photo_of(deviation: float, blur: float = 0.0) -> NDArray[np.uint8]:
    soft = ndimage.gaussian_filter(SHARP.astype(float), (blur, blur, 0.0))
    noise = deviation * np.random.RandomState(4).standard_normal(SHARP.shape)
    return np.rint(soft + noise).clip(0, 255).astype(np.uint8)


def sums() -> Accumulation:
    """A grey disc with a shadow beside it, as from the device."""
    ratio = np.where((DISC | (X < 200))[..., None], 2048, 4096) * np.ones(3, int)
    colour = np.full((*SHARP.shape,), 700, np.uint32)
    return Accumulation.of_pixels(colour, DISC, ratio.astype(np.uint32), 4095, 4096)


def codes(image: Floats) -> Floats:
    return 255 * srgb_from_linear(image)


def look_of(photo: NDArray[np.uint8]) -> CameraLook:
    look = CameraLook.of(SCENE, photo, (WIDTH, HEIGHT))
    assert look is not None
    return look


def test_a_photo_without_grain_changes_nothing() -> None:
    look = look_of(SHARP)
    assert look == CameraLook(None, 0.0) and look.note is None
    np.testing.assert_array_equal(composited(sums(), SHARP, None, look), composited(sums(), SHARP))


def test_the_object_has_the_grain_and_the_photo_keeps_its_own() -> None:
    photo = photo_of(5.0)
    look, plain = look_of(photo), composited(sums(), photo)
    assert look.note is not None and "grain" in look.note and "blur" not in look.note
    first, again, second = (composited(sums(), photo, None, look, frame) for frame in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    np.testing.assert_array_equal(first[~DISC], plain[~DISC])
    added = (codes(first) - codes(plain))[DISC]
    np.testing.assert_allclose(added.std(axis=0), 5.0, rtol=0.15)
    assert abs(np.corrcoef(added.ravel(), (codes(second) - codes(plain))[DISC].ravel())[0, 1]) < 0.03


def test_a_pixel_of_both_has_the_missing_grain() -> None:
    photo, half = photo_of(5.0), np.full((HEIGHT, WIDTH), 0.5)
    image = decode_srgb(np.full_like(photo, 128))
    added = codes(look_of(photo).grained(image, half, 0)) - codes(image)
    # Half of the photo's deviation is there
    np.testing.assert_allclose(added.std(axis=(0, 1)), 5.0 * 0.75**0.5, rtol=0.15)


def test_outline_and_shadow_are_as_soft_as_the_photo() -> None:
    look = look_of(photo_of(0.0, blur=1.5))
    assert look.grain is None and 1.2 < look.blur < 1.8
    assert "blur" in (look.note or "")
    flat = np.full_like(SHARP, 200)
    sharp, soft = composited(sums(), flat), composited(sums(), flat, None, look)
    expected = ndimage.gaussian_filter(sharp, (look.blur, look.blur, 0.0), mode="nearest")
    np.testing.assert_allclose(soft, expected, atol=2e-3)
    whole = replace(sums(), objects=sums().objects / 4095, ratio=sums().ratio / 4096.0, white=1.0, unshadowed=1.0)
    np.testing.assert_allclose(composited(whole, flat, None, look), soft, atol=1e-3)


def test_a_scene_does_without(tmp_path: Path) -> None:
    photo = photo_of(5.0)
    assert CameraLook.of(replace(SCENE, camera=Camera(grain=False)), photo, (WIDTH, HEIGHT)) is None
    assert CameraLook.of(SCENE, None, (WIDTH, HEIGHT)) is None
    file = tmp_path / "scene.toml"
    file.write_text('mesh.name = "teapot:2"\nbackground.room = "room"\ncamera.grain = false\n')
    assert load_scene(file).camera == Camera(grain=False) and not load_scene(file).places_camera


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("camera.grain = false", "camera.grain is of the photo of a room: it needs background.room"),
        ('background.room = "room"\ncamera = {}', "the camera is the room's"),
        ('background.room = "room"\ncamera = {grain = false, fov = 30.0}', "the camera is the room's"),
        ('background = {room = "r", photo = "p"}\ncamera.grain = false', "give [camera]; a room has its photo"),
    ],
)
def test_cameras_that_are_the_rooms_stay_so(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "scene.toml"
    file.write_text(f'mesh.name = "teapot:2"\n{text}\n')
    with pytest.raises(UserError, match=message.replace("[", r"\[")):
        load_scene(file)
