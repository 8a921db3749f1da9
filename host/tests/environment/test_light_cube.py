"""The light cube: texels, words, and the light of a room."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from colonnade.common.vectors import unit_vectors
from colonnade.environment.light_cube import FACE, MOST, LightCube, face_directions
from colonnade.environment.lights import RoomLights
from colonnade.environment.load import load_environment
from colonnade.maps.cache import encoded_environment
from colonnade.maps.layout import AttributeLayout
from colonnade.maps.room_light import room_light

ROOMS = Path(__file__).parents[3] / "scenes" / "rooms"
DIRECTION = st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(lambda v: max(map(abs, v)) > 0.01)


def fields_of(word: int) -> tuple[int, ...]:
    """Mark and exponent, and the mantissas of red, green and blue."""
    return word >> 21, *(word >> shift & 127 for shift in (14, 7, 0))


def test_a_texel_lies_in_its_directions() -> None:
    cube = LightCube(np.arange(6 * FACE * FACE * 3, dtype=np.float64).reshape(6, FACE, FACE, 3))
    directions, weights = face_directions(FACE)
    np.testing.assert_array_equal(cube.texel_of(directions.reshape(-1, 3)), np.arange(6 * FACE * FACE))
    assert abs(6 * weights.sum() * (2 / FACE) ** 2 - 4 * np.pi) < 0.05, "they fill the sphere"


@settings(max_examples=50)
@given(DIRECTION, st.floats(0.1, 100))
def test_length_does_not_matter(direction: list[float], length: float) -> None:
    cube = LightCube(np.random.default_rng(1).random((6, FACE, FACE, 3)))
    once = np.array([direction])
    np.testing.assert_array_equal(cube.radiance(once), cube.radiance(2.0 ** round(np.log2(length)) * once))


def test_a_smooth_light_survives_the_cube_and_a_turn() -> None:
    light = lambda d: 1 + 0.5 * d  # noqa: E731
    angle = 0.7
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    cube = LightCube.of(light, 32)
    directions = unit_vectors(np.random.default_rng(2).normal(size=(500, 3)))
    assert np.abs(cube.radiance(directions) - light(directions)).max() < 0.05
    turned = cube.turned(turn)
    assert np.abs(turned.radiance(directions) - light(directions @ turn.T)).max() < 0.12


def test_words_hold_light_above_one_and_saturate() -> None:
    texels = np.zeros((6, FACE, FACE, 3))
    texels[0, 0, :3] = (0.5, 2.0, 99.0), (1 / 4096, 127.4 / 4096, 0), (127.6 / 4096, 0.01, 16.0)
    words = LightCube(texels).words()
    assert words.shape == (1536, 4)
    assert [fields_of(word) for word in words.view("<u4")[:4, 0].tolist()] == [
        (9, 4, 16, 127),
        (0, 1, 127, 0),
        (9, 0, 0, 127),
        (0, 0, 0, 0),
    ]


@settings(max_examples=50)
@given(st.lists(st.floats(0, 15.8), min_size=3, max_size=3))
def test_a_word_holds_its_light_to_a_hundredth(texel: list[float]) -> None:
    """Of its largest channel, and to half a step of 12 bits."""
    words = LightCube(np.broadcast_to(np.array(texel), (6, 1, 1, 3))).words()
    exponent, *mantissas = fields_of(int(words.view("<u4")[0, 0]))
    assert np.abs(np.ldexp(mantissas, exponent - 12) - texel).max() <= max(max(texel) / 128, 0.5 / 4096)


@settings(max_examples=30)
@given(DIRECTION, st.floats(0.0, 0.6))
def test_a_light_is_where_it_is(direction: list[float], radius: float) -> None:
    """In its directions and near them, for paths that see lights; its texels keep their light for the others."""
    middle = unit_vectors(np.array([direction]))[0]
    cube = LightCube(np.full((6, FACE, FACE, 3), 0.25)).with_lights([(middle, radius)])
    directions = unit_vectors(np.random.default_rng(3).normal(size=(2000, 3)))
    angle = np.arccos((directions @ middle).clip(-1, 1))
    sees = np.ones(len(directions), dtype=np.bool_)
    light = cube.radiance(directions, sees_lights=sees)[:, 0]
    texel = 2 * np.sqrt(2) / FACE  # At least the angle between two corners
    assert (light[angle < radius - texel] == MOST).all() and (light[angle > radius + texel] == 0.25).all()
    assert cube.radiance(middle[None], sees_lights=sees[:1])[0, 0] == MOST
    assert (cube.radiance(directions) == 0.25).all() and (cube.radiance(directions, sees_lights=~sees) == 0.25).all()
    assert (cube.words().view("<u4") >> 25).sum() == np.count_nonzero(cube.lights)


def test_a_ray_meets_the_surface_that_it_hits() -> None:
    """Nearly, in a cube of that size around the middle."""
    random, middle, size = np.random.default_rng(4), np.array([3.0, -1.0, 0.5]), 2.0
    texels = face_directions(FACE)[0]
    cube = LightCube(texels, middle=middle, distance=size)
    directions, offsets = random.normal(size=(2, 4000, 3))
    for reach in (0.2, 0.4):
        origins = middle + offsets * reach
        inside = np.clip(offsets * reach, -0.99 * size, 0.99 * size)
        steps = ((size * np.sign(directions) - inside) / directions).min(axis=1)
        hit = unit_vectors(inside + steps[:, None] * directions)
        errors = [
            np.degrees(np.arccos((unit_vectors(found) * hit).sum(axis=1).clip(-1, 1))).mean()
            for found in (cube.radiance(directions, origins), cube.radiance(directions))
        ]
        assert errors[0] < 0.6 * errors[1]


@pytest.mark.parametrize("name", ["living", "attic"])
def test_the_light_of_a_room_is_that_of_its_photo(name: str) -> None:
    """In the directions of its pixels it is their colour; the planes have their albedo under the lights."""
    room = load_environment(ROOMS / name)
    image = encoded_environment(room, AttributeLayout(room.width, room.height), encoder="live")
    middle = room.camera_to_world @ np.append(room.points()[room.height // 2, room.width // 2] * 0.6, 1.0)
    found = room_light(room, image, RoomLights(np.full(3, 0.5)), middle, from_photo=False)
    assert 0.1 < found.seen < 0.7
    assert found.cube.texels.min() >= 0 and found.cube.texels.max() <= 1
    forward = room.camera_to_world[:, 2]
    assert np.abs(found.cube.radiance(forward[None])).max() > 0
    dark = room_light(room, image, RoomLights(np.zeros(3)), middle, from_photo=False)
    assert dark.cube.texels.max() == 0
