"""The rooms of the comparison with a path tracer: their files, and the probe against light that is known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from colonnade.environment.panorama_file import read_radiance
from colonnade.mesh.load import load_mesh
from hypothesis import given
from hypothesis import strategies as st

from colonnade_lab.evaluation.light import files
from colonnade_lab.evaluation.light.columns import columns
from colonnade_lab.evaluation.light.probe import Probe
from colonnade_lab.evaluation.light.report import write_pictures
from colonnade_lab.evaluation.light.rooms import FRAME, PHOTO, ROOMS, KnownRoom, Lamp, Thing, Window
from colonnade_lab.evaluation.light.surfaces import RoomSurface, ThingSurface
from colonnade_lab.evaluation.light.user_rooms import REPORT, known_room, user_room

#: What the stored pictures may take, bytes.
BUDGET = 3_000_000


def test_every_room_is_stored() -> None:
    total = 0
    for name in (*ROOMS, *REPORT):
        room = known_room(name)
        for frame in room.frames:
            assert files.truth(name, frame).shape == (room.frame[1], room.frame[0], 3)
        for panorama in ("panorama", "around"):
            assert read_radiance(files.stored(name) / f"{panorama}.hdr").shape[2] == 3
        total += sum(file.stat().st_size for file in files.stored(name).iterdir())
    assert PHOTO[0] % FRAME[0] == 0
    assert total <= BUDGET


@pytest.mark.parametrize("kind", REPORT)
def test_a_users_room_follows_from_its_seed(kind: str) -> None:
    """So rooms for tuning are none of the reported ones."""

    def corners(room: KnownRoom) -> np.ndarray:
        return np.concatenate([part.vertices for part in room.parts()])

    reported, tuned = known_room(kind), user_room(kind, 1)
    np.testing.assert_array_equal(corners(reported), corners(user_room(kind, REPORT[kind])))
    assert not np.array_equal(corners(reported), corners(tuned)) and reported.emitters != tuned.emitters
    assert set(reported.frames) == {"rough", "clear"} and REPORT[kind] > 100


@pytest.mark.parametrize("is_users", [False, True])
def test_pictures_stand_side_by_side(is_users: bool, tmp_path: Path) -> None:
    """A user's room has no frame of ambient light."""
    titles = ("truth", "no object", "probe, rasteriser", *columns(is_users))
    pictures = {title: np.full((40, 50, 3), 9, np.uint8) for title in titles}
    pictures["truth"][15:20, 20:30] = 200
    strip = write_pictures(tmp_path, "a-rough", pictures)
    assert strip.shape == (24, 5 * 29, 3)
    assert len(list((tmp_path / "a-rough").iterdir())) == len(titles)


@given(scale=st.floats(1e-6, 1e6), seed=st.integers(0, 99))
def test_a_panorama_keeps_its_radiance(scale: float, seed: int, tmp_path_factory: pytest.TempPathFactory) -> None:
    radiance = np.random.default_rng(seed).random((4, 8, 3)) * scale
    radiance[0, 0] = 0.0
    file = tmp_path_factory.mktemp("hdr") / "a.hdr"
    files.write_panorama(file, radiance)
    found = read_radiance(file)
    assert np.all(np.abs(found - radiance) <= radiance.max(axis=2, keepdims=True) / 128)


def test_an_object_has_its_material_and_its_place(tmp_path: Path) -> None:
    thing = Thing("torus:12", "glass", (1.0, 1.0, 1.0), (1.0, 2.0, 3.0), 0.5, turn=20.0, tilt=90.0)
    files.write_glb(tmp_path / "a.glb", thing)
    mesh = load_mesh(tmp_path / "a.glb")
    assert [material.kind for material in mesh.materials] == ["glass"]
    assert len(mesh.faces) == len(load_mesh("torus:12").faces)
    vertices = ThingSurface.of(thing).vertices
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    np.testing.assert_allclose([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2], thing.foot, atol=1e-12)


def test_a_probe_of_constant_light_lights_all_surfaces_alike() -> None:
    probe, ways = Probe(np.full((32, 64, 3), 0.7)), np.eye(3)
    harmonics = probe.harmonics()
    np.testing.assert_allclose(harmonics[0] * 0.282095, 0.7, rtol=2e-3)
    assert np.abs(harmonics[1:]).max() < 0.02
    np.testing.assert_allclose(probe.at(ways), 0.7)
    np.testing.assert_allclose(probe.filtered(ways, 0.4), 0.7)


def test_a_light_is_what_the_objects_see_of_its_emitter() -> None:
    """Half of a window behind a wall: half as bright, in the middle of the other half; a ball has a front."""
    window, ball = (
        Window((0.0, 0.0, -2.0), (0.0, 0.0, 1.0), 1.0, 0.8, (5.0, 6.0, 7.0)),
        Lamp((0.0, 3.0, 0.0), 0.1, (5.0,) * 3),
    )
    thing = Thing("sphere", "matt", (0.5,) * 3, (0.0, 0.0, 0.0), 1e-6)
    room = replace(ROOMS["attic"], emitters=(window, ball), place=(0.0, 0.0, 0.0), frames={"one": (thing,)})
    wall = np.array([[0.0, -9.0, -1.0], [9.0, -9.0, -1.0], [9.0, 9.0, -1.0], [0.0, 9.0, -1.0]])
    surface = RoomSurface(wall, np.zeros((4, 3)), np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    (half, whole), place = surface.lights(room), np.zeros(3)
    full = window.seen_from(place)
    np.testing.assert_allclose(half[0], [-0.25, 0.0, -2.0], atol=0.01)
    np.testing.assert_allclose(half[1] / full[1], 0.5, atol=0.01)
    assert half[2] == pytest.approx(full[2] * 0.5**0.5, rel=0.01)
    for one, other in zip(whole, ball.seen_from(place), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)
    points = ball.points(place) - ball.centre
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 0.1)
    assert (points[:, 1] < 0).all()


@pytest.mark.parametrize("emitter", [Lamp((0.0, 9.0, 0.0), 0.1, (5.0, 6.0, 7.0)), None])
def test_a_point_light_is_as_bright_as_its_emitter(emitter: Lamp | None) -> None:
    one = emitter or Window((0.0, 0.0, -9.0), (0.0, 0.0, 1.0), 0.3, 0.2, (5.0, 6.0, 7.0))
    at, power, _ = one.seen_from(np.zeros(3))
    area = np.pi * 0.1**2 if emitter else 0.06
    # A small emitter of this area, face on, seen by a surface that faces it: radiance times solid angle over pi
    np.testing.assert_allclose(power / (at @ at), np.array([5.0, 6.0, 7.0]) * area / 81 / np.pi)
