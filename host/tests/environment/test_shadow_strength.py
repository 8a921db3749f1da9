"""The strength of shadows on a photo: the room's own shadows are not darkened again."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from colonnade.common.image_io import decode_srgb, encode_srgb
from colonnade.environment.lights import RoomLight, RoomLights, irradiance, world_surface
from colonnade.environment.model import Environment, EnvironmentCamera
from colonnade.environment.shadow_strength import WHOLE, shadow_strength

LIGHTS = RoomLights(
    np.array([0.2, 0.25, 0.3]), (RoomLight(np.array([0.5, 0.5, 0.0]), np.array([0.6, 0.5, 0.4]), None),)
)


def wall(share: float, scale: float = 1.0) -> Environment:
    """A wall before the camera, whose right third has a share of the light of `LIGHTS`."""
    random = np.random.default_rng(3)
    pose = np.column_stack([np.eye(3), np.zeros(3)])
    albedo = random.uniform(0.3, 0.9, (24, 30, 3))
    room = Environment(
        "wall", albedo, np.broadcast_to([0.0, 0.0, -1.0], albedo.shape), np.full((24, 30), 2.0), True,
        EnvironmentCamera(30, 30, 15, 12, pose), None,
    )  # fmt: skip
    light = irradiance(*world_surface(room), LIGHTS) - LIGHTS.ambient
    light[:, 20:] *= share
    photo = encode_srgb(albedo * (LIGHTS.ambient + light) * scale)
    return Environment("wall", albedo, room.normals, room.depth, True, room.camera, photo)


@settings(max_examples=20)
@given(st.floats(0, 1), st.floats(0.5, 1.0))
def test_an_object_leaves_the_ambient_light(share: float, scale: float) -> None:
    """Where it takes all light away, every pixel has the ambient light, whatever share the room let through."""
    room = wall(share, scale)
    assert room.photo is not None
    strength = shadow_strength(room, LIGHTS)
    whole = irradiance(*world_surface(room), LIGHTS)
    darkened = decode_srgb(room.photo) * (1 - strength[..., None] / WHOLE * (1 - LIGHTS.ambient / whole))
    expected = encode_srgb(room.albedo * LIGHTS.ambient * scale)
    assert np.abs(encode_srgb(darkened).astype(int) - expected).mean() < 2
    assert strength[:, :20].min() > 245, "lit pixels have whole shadows"


def test_a_room_s_own_shadow_takes_none() -> None:
    assert shadow_strength(wall(0.0), LIGHTS)[:, 20:].max() <= 10


def test_saturated_and_black_photos_have_whole_shadows() -> None:
    room = wall(1.0)
    for level in (0, 255):
        photo = np.full_like(room.photo, level)
        assert (
            shadow_strength(
                Environment("flat", room.albedo, room.normals, room.depth, True, room.camera, photo), LIGHTS
            )
            == WHOLE
        ).all()
