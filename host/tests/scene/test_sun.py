"""The sun of a scene, where the photo of its room shows sun and shade."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sunny_yard import SHADE, SUN, WALL, yard

from colonnade.common import notes
from colonnade.common.accumulation import WHOLE
from colonnade.environment.lights import world_surface
from colonnade.environment.panorama import Panorama
from colonnade.environment.panorama_lights import DistantLight
from colonnade.mesh.load import load_mesh
from colonnade.scene.lit_room import photo_strength
from colonnade.scene.model import Background, MeshSource, Scene, Transform
from colonnade.scene.object_pose import Placed
from colonnade.scene.sun import sun_alone, with_sun

ROOM, UP = yard(), np.array([0.0, 1.0, 0.0])
EXTENT = load_mesh("teapot:4").extent


def scene(x: float) -> Scene:
    """An object of 40 cm on the ground of the yard, in the shade from -1 to 1."""
    scale = 0.4 / EXTENT.edge
    low, middle = EXTENT.low * scale, EXTENT.centre * scale
    place = Transform(scale=scale, translate=(x - middle[0], -low[1], -3.2 - middle[2]))
    return Scene(MeshSource("teapot:4"), transform=place, background=Background(room=Path("yard")))


@pytest.mark.parametrize(("x", "share"), [(1.7, 1.0), (0.0, 0.0)])
def test_a_panorama_in_the_shade_has_the_sun_overhead(x: float, share: float, told: list[str]) -> None:
    (sun,) = with_sun([], Panorama(np.full((8, 16, 3), 1.0) * SHADE), Placed(scene(x), EXTENT, ROOM))
    np.testing.assert_array_equal(sun.direction, UP)
    np.testing.assert_allclose(sun.colour, share * SUN, rtol=0.15)
    assert sun.is_far
    notes.flush()
    assert told[-1].endswith(f"the sun is overhead, as the panorama has none, and {share:.0%} of the object is in it")


def test_a_panorama_in_the_sun_tells_its_direction() -> None:
    """An object in the shade has none of it; other lights stay."""
    high = DistantLight(np.array([0.6, 0.8, 0.0]), 9 * SUN, 0.01)
    low = DistantLight(np.array([1.0, 0.0, 0.0]), SUN, 0.1)
    shade = Panorama(np.full((8, 16, 3), 1.0) * SHADE)
    sun, other = with_sun([low, high], shade, Placed(scene(1.7), EXTENT, ROOM))
    np.testing.assert_array_equal(sun.direction, high.direction)
    np.testing.assert_allclose(sun.colour, SUN / 0.8, rtol=0.15)
    assert other is low


def test_a_photo_alone_has_sun_and_shade() -> None:
    for x, share in ((1.7, 1.0), (0.0, 0.0)):
        found = sun_alone(Placed(scene(x), EXTENT, ROOM))
        assert found is not None
        (sun,) = found.lights
        np.testing.assert_allclose(sun.colour, share * SUN / SHADE * found.ambient, atol=0.15)
        assert sun.falloff is None and sun.position[1] > 10
    assert sun_alone(Placed(scene(0.0), EXTENT, yard(has_shadows=False))) is None


def test_an_object_takes_no_sun_away_in_the_shade() -> None:
    found = replace(scene(0.0), names_light=False)
    room = replace(ROOM, has_albedo=False)
    strength = photo_strength(Placed(found, EXTENT, room), relit=False)
    assert strength is not None
    x, is_ground = world_surface(room)[0][..., 0], room.depth < WALL
    assert strength[is_ground & (np.abs(x) > 1.3)].min() == WHOLE
    assert strength[is_ground & (np.abs(x) < 0.7)].max() < WHOLE / 2
    assert (
        photo_strength(Placed(found, EXTENT, replace(yard(has_shadows=False), has_albedo=False)), relit=False) is None
    )
