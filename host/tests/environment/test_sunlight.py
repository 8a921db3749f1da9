"""Sun and shade on the ground of a photo: how bright the sun is, where it shines, and what is neither."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sunny_yard import SHADE, SUN, WALL, yard

from colonnade.environment.lights import world_surface
from colonnade.environment.model import Environment
from colonnade.environment.sunlight import Sunlight


def test_the_sun_is_as_bright_as_the_photo_shows_it() -> None:
    room = yard()
    found = Sunlight.of(room)
    assert found is not None
    np.testing.assert_allclose(found.ratio, (SHADE + SUN) / SHADE, rtol=0.1)
    np.testing.assert_allclose(found.colour(SHADE), SUN, rtol=0.15)
    is_ground = room.depth < WALL
    assert (found.is_lit == (np.abs(world_surface(room)[0][..., 0]) > 1))[is_ground].mean() > 0.97


@pytest.mark.parametrize(("x", "tilt", "share"), [(0.0, 0.0, 0.0), (1.6, 0.0, 1.0), (0.0, 1.5, 0.6), (9.0, 0.0, 1.0)])
def test_a_point_is_sunlit_where_its_shadow_falls_on_sunlit_ground(x: float, tilt: float, share: float) -> None:
    """A column of points of 1.6 m; the last one is out of the picture."""
    room, towards = yard(), np.array([tilt, 1.0, 0.0]) / np.hypot(tilt, 1.0)
    points = np.column_stack([np.full(9, x), np.linspace(0, 1.6, 9), np.full(9, -3.5)])
    found = Sunlight.of(room)
    assert found is not None and found.share(room, points, towards) == pytest.approx(share, abs=0.06)


@pytest.mark.parametrize(
    "room",
    [
        replace(yard(), photo=None),
        yard(has_shadows=False),
        yard(sun=SUN[::-1]),
        yard(has_shadows=False, ground=np.array([0.6, 0.45, 0.3])),
    ],
    ids=["no photo", "all shade", "what is bright is bluer", "a dark rug on wood"],
)
def test_what_is_no_sun(room: Environment) -> None:
    assert Sunlight.of(room) is None
