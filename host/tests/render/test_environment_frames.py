"""A scene in a room, from the room's folder to the reference's frame."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from colonnade_lab.evaluation.studies.synthetic_attic import attic, write_attic

from colonnade.common.errors import UserError
from colonnade.common.progress import QUIET
from colonnade.design.manifest import Manifest
from colonnade.environment.load import load_environment
from colonnade.render.reference_frames import reference_frames
from colonnade.scene.parser import load_scene

SCENE = """
[mesh]
name = "teapot:3"
[background]
room = "rooms/attic"
[object]
stand_at = [32, 28.5]
size = 0.6
[material]
kind = "glass"
[[light]]
position = [0.6, 2.2, 0.6]
falloff = 1.5
[[light]]
position = [-1.0, 1.5, 1.0]
colour = [0.2, 0.2, 0.3]
"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    write_attic(tmp_path / "rooms" / "attic", 64, 48)
    (tmp_path / "scene.toml").write_text(SCENE)
    return tmp_path / "scene.toml"


def test_the_attic_round_trips_through_its_folder(scene: Path) -> None:
    made, environment = attic(64, 48).environment, load_environment(scene.parent / "rooms" / "attic")
    np.testing.assert_allclose(environment.depth, made.depth, atol=2e-4)
    np.testing.assert_allclose(environment.camera_to_world, made.camera_to_world, atol=1e-12)
    np.testing.assert_allclose(environment.albedo, made.albedo, atol=0.01)
    assert (np.einsum("hwi,hwi->hw", environment.normals, made.normals) > 0.999).all()
    assert np.einsum("hwi,hwi->hw", environment.normals, environment.points()).max() < 0.05


def test_the_reference_shows_object_and_room(scene: Path, make_manifest: Callable[..., Manifest]) -> None:
    (result,) = reference_frames([load_scene(scene)], make_manifest(), (64, 48), QUIET)
    rays = result.report.rays
    assert 20 < result.object_mask.sum() < 400
    assert rays["refraction"] > result.object_mask.sum() and rays["primary"] == 64 * 48
    assert rays["shadow"] > 64 * 48
    assert result.report.backend == "reference"
    bright = result.image[~result.object_mask]
    assert 0.02 < bright.mean() < 0.9


def test_a_wrong_room_is_one_line(scene: Path, make_manifest: Callable[..., Manifest]) -> None:
    with pytest.raises(UserError, match="64x64 pixels does not have the proportions of room attic, 64x48"):
        list(reference_frames([load_scene(scene)], make_manifest(), (64, 64), QUIET))
    for name in ("normal.png", "depth.png"):
        (scene.parent / "rooms" / "attic" / name).unlink()
    with pytest.raises(UserError, match=r"lacks normal\.png"):
        list(reference_frames([load_scene(scene)], make_manifest(), (64, 48), QUIET))
