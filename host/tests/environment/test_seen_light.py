"""The light around a point that one or two pictures of a room show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from colonnade_lab.evaluation.studies.synthetic_attic import EYE, TARGET, attic, attic_parts, camera_at, synthetic_room

from colonnade.environment.light_cube import LightCube
from colonnade.environment.seen_light import FINE, SeenLight


def test_a_second_view_shows_further_directions() -> None:
    """What the first one shows stays; the second one has its exposure, whatever its own."""
    first = attic(96, 72).environment
    camera = camera_at(np.array([-1.2, 1.4, -1.5]), EYE, 96, 72)
    second = synthetic_room("other", attic_parts(), camera, 96, 72).environment
    assert second.photo is not None
    point = 0.4 * EYE + 0.6 * TARGET
    seen, other = SeenLight.of(first, point), SeenLight.of(second, point)
    both = seen.beside(other)
    assert both.share > seen.share + 0.1
    np.testing.assert_array_equal(both.radiance[seen.is_seen], seen.radiance[seen.is_seen])
    shows = LightCube(np.zeros((6, FINE, FINE, 3))).texel_of((EYE - point)[None])[0]
    assert both.is_seen[shows] and not seen.is_seen[shows]
    darker = seen.beside(replace(other, radiance=other.radiance * 0.5))
    np.testing.assert_allclose(darker.radiance, both.radiance)
    alone = seen.beside(replace(other, is_seen=np.zeros_like(other.is_seen), radiance=0 * other.radiance))
    assert alone.share == seen.share
