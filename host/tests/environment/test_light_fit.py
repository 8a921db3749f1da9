"""Lights that are fitted to a room's photo, and colours that show it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from colonnade_lab.evaluation.studies.synthetic_attic import AMBIENT, LAMP, LAMP_COLOUR, attic
from numpy.typing import NDArray
from scipy import ndimage

from colonnade.common.errors import UserError
from colonnade.common.image_io import encode_srgb
from colonnade.environment import light_fit
from colonnade.environment.derived_albedo import derived_albedo, hue_lights
from colonnade.environment.fitted_lights import fitted_lights
from colonnade.environment.light_fit import fit_lights, relit, relit_psnr
from colonnade.environment.lights import MAX_FALLOFF, RoomLight, RoomLights, exposure, irradiance, world_surface
from colonnade.environment.model import Environment
from colonnade.environment.photo_colours import MAX_CLAMPED, photo_colours
from colonnade.environment.seen_sources import SEEN_RADIANCE, seen_sources


@pytest.fixture(scope="module")
def environment() -> Environment:
    return attic(96, 72).environment


def test_the_lamp_of_the_attic_is_found(environment: Environment) -> None:
    """The attic's photo has shadows of furniture, which are outliers, and one lamp."""
    fit = fit_lights(environment)
    (lamp,) = fit.lights.lights
    np.testing.assert_allclose(lamp.position, LAMP, atol=0.05)
    assert lamp.falloff is not None
    np.testing.assert_allclose(lamp.colour * lamp.falloff**2, LAMP_COLOUR, rtol=0.06)
    np.testing.assert_allclose(fit.lights.ambient, AMBIENT, rtol=0.06)
    assert fit.psnr > 30 > 23 > fit.ambient_psnr
    assert fit.psnr == relit_psnr(environment, fit.lights)


def test_a_fit_is_deterministic_and_cached(environment: Environment, tmp_path: Path) -> None:
    first = fitted_lights(environment, 1, tmp_path)
    (file,) = tmp_path.glob("*.json")
    assert repr(fitted_lights(environment, 1, tmp_path)) == repr(first) == repr(fit_lights(environment, 1))
    fitted_lights(replace(environment, albedo=environment.albedo * 0.9), 1, tmp_path)
    assert len(list(tmp_path.glob("*.json"))) == 2
    file.write_text("damaged")
    assert repr(fitted_lights(environment, 1, tmp_path)) == repr(first)


def test_a_fit_relights_its_room_no_more_than_it_reports(
    environment: Environment, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The pictures of the fit that is dropped cost a third of the time."""
    relights: list[RoomLights] = []
    monkeypatch.setattr(light_fit, "relit_psnr", lambda _, lights: relights.append(lights) or 30.0)
    fit_lights(environment, 1, walls=True)
    assert len(relights) == 2


def test_two_lamps_and_ambient_light_are_told_apart(environment: Environment) -> None:
    lamps = (
        RoomLight(np.array([-1.2, 1.6, 0.4]), np.array([0.9, 0.6, 0.3]), 1.2),
        RoomLight(np.array([1.6, 1.4, -0.2]), np.array([0.2, 0.4, 0.9]), 1.2),
    )
    lights = RoomLights(np.array([0.15, 0.15, 0.15]), lamps)
    lit = replace(environment, photo=encode_srgb(relit(environment, lights)))
    assert fit_lights(lit, 0).lights.lights == ()
    fit = fit_lights(lit, 2)
    assert len(fit.lights.lights) == 2 and fit.psnr > 38


def test_light_and_albedo_share_the_hue_of_a_photo(environment: Environment) -> None:
    """Grey light on coloured things, or coloured light on grey ones: half is wrong at most."""
    grey = replace(environment, albedo=np.full_like(environment.albedo, 0.5))
    lit = encode_srgb(relit(grey, RoomLights(np.array([0.3, 0.6, 0.9]))))
    albedo = derived_albedo(replace(grey, photo=lit)).mean(axis=(0, 1))
    assert 1.0 < albedo[2] / albedo[0] < np.sqrt(3.0)
    lights = hue_lights(replace(grey, photo=lit)).ambient
    assert np.sqrt(3.0) < lights[2] / lights[0] < 3.0


def test_a_window_in_view_is_a_light(environment: Environment) -> None:
    """It keeps its place; a saturated floor, on which the sun shines, is none, and neither is a small highlight."""
    surface, normals = world_surface(environment)
    upright, level = np.abs(normals[..., 1]) < 0.3, normals[..., 1] > 0.9
    (window,) = (source for source in seen_sources(_saturated(environment, upright, 12)) if source.radius > 0)
    assert 0.0 < window.radius < 1.0
    assert np.sqrt(((surface - window.position) ** 2).sum(axis=2)).min() < 0.3
    seen = _saturated(environment, upright, 12)
    found = fit_lights(seen, 2).lights.lights[0]
    np.testing.assert_allclose(found.position, window.position, atol=1e-3)
    assert found.colour.min() >= SEEN_RADIANCE * window.radius**2 - 1e-3
    assert seen_sources(_saturated(environment, level, 12)) == seen_sources(_saturated(environment, upright, 2)) == []


def _saturated(environment: Environment, surface: NDArray[np.bool_], size: int) -> Environment:
    """The room with a saturated square, in pixels, where it first fits on a surface."""
    assert environment.photo is not None
    fits = ndimage.binary_erosion(surface, np.ones((size, size)), origin=-(size // 2))
    row, column = np.argwhere(fits)[0]
    photo = np.minimum(environment.photo, 240)
    photo[row : row + size, column : column + size] = 255
    return replace(environment, photo=photo)


def test_a_room_without_a_useful_photo_is_one_line(environment: Environment) -> None:
    with pytest.raises(UserError, match=r"room attic has no photo.png or render.png"):
        fit_lights(replace(environment, photo=None))
    with pytest.raises(UserError, match="nearly all black or saturated"):
        fit_lights(replace(environment, photo=np.full_like(environment.albedo, 255, dtype=np.uint8)))


def test_light_follows_the_rules_of_the_reference() -> None:
    points, normals = np.array([[0.0, 0.0, 0.0]]), np.array([[0.0, 1.0, 0.0]])
    assert exposure(points, normals, np.array([0.0, 2.0, 0.0]), 1.0) == pytest.approx(0.25)
    assert exposure(points, normals, np.array([0.0, 0.1, 0.0]), 1.0) == pytest.approx(MAX_FALLOFF)
    assert exposure(points, normals, np.array([0.0, -1.0, 0.0]), None) == 0.0
    assert exposure(points, normals, np.array([1.0, 1.0, 0.0]), None) == pytest.approx(np.sqrt(0.5))


@pytest.mark.parametrize("ambient", [0.6, 0.2, 0.06])
def test_colours_under_their_lights_are_the_photo(environment: Environment, ambient: float) -> None:
    """Lights that are too dark are scaled up, as far as the range of an albedo needs."""
    lights = RoomLights(np.full(3, ambient), (RoomLight(LAMP, LAMP_COLOUR * ambient, 1.0),))
    colours = photo_colours(environment, lights)
    assert colours.environment.albedo.max() <= 1.0 and colours.headroom >= 1.0
    light = irradiance(*world_surface(environment), lights) * colours.headroom
    shown, photo = encode_srgb(colours.environment.albedo * light), environment.photo
    assert photo is not None
    different = (np.abs(shown.astype(int) - photo) > 1).any(axis=2).mean()
    assert different <= max(colours.clamped, MAX_CLAMPED)
    assert (colours.clamped <= MAX_CLAMPED + 1e-3) == (ambient > 0.1)
