"""What a frame in the photo of a room has by default: gathered light, filter and samples, and who wins."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from colonnade_lab.evaluation.studies.synthetic_attic import attic, write_room
from live_maps import SMALL_MAPS

import colonnade
from colonnade.common import notes
from colonnade.design.generator import manifest_for
from colonnade.render.room_defaults import tell_without_defaults, with_room_defaults
from colonnade.scene.parser import scene_of


def tables(folder: Path, has_photo: bool = True, **more: Any) -> dict[str, Any]:
    if has_photo:
        (folder / "photo.png").touch()
    return {"mesh": {"name": "cube"}, "background": {"room": "."}} | more


@pytest.mark.parametrize(
    ("has_photo", "more", "gathers"),
    [
        (True, {}, 1),
        (True, {"paths": {"bounces": 2}, "frame": {"budget": 0.1}}, 1),
        (True, {"paths": {"gather": 0}}, 0),
        (False, {}, 0),
        (False, {"paths": {"gather": 2}}, 2),
        (True, {"background": {"room": ".", "colours": "albedo"}}, 0),
    ],
)
def test_a_scene_that_leaves_it_open_gathers_in_a_photo(
    tmp_path: Path, has_photo: bool, more: dict[str, Any], gathers: int
) -> None:
    scene = scene_of(tables(tmp_path, has_photo, **more), "the scene", tmp_path)
    found, line = with_room_defaults(scene, "small", manifest_for("small").manifest)
    assert found.paths.gather == gathers
    assert (line is not None) == (found.frame.denoise is True) == (gathers > scene.paths.gather)
    assert with_room_defaults(scene, "tiny", manifest_for("tiny").manifest) == (scene, None)


@pytest.mark.parametrize(("more", "is_told"), [({}, True), ({"paths": {"gather": 0}}, False)])
def test_a_packed_scene_tells_that_it_does_not_gather(tmp_path: Path, more: dict[str, Any], is_told: bool) -> None:
    scene, lines = scene_of(tables(tmp_path, **more), "the scene", tmp_path), list[str]()
    with notes.opened(lines.append):
        tell_without_defaults(scene, "small", manifest_for("small").manifest)
        tell_without_defaults(scene, "tiny", manifest_for("tiny").manifest)
    assert ["gather the room's light" in line for line in lines] == [True] * is_told


def test_a_named_filter_stays(tmp_path: Path) -> None:
    scene = scene_of(tables(tmp_path, frame={"denoise": False}), "the scene", tmp_path)
    found, line = with_room_defaults(scene, "small", manifest_for("small").manifest)
    assert (found.paths.gather, found.frame.denoise) == (1, False)
    assert line is not None and "filtered" not in line


def test_the_picture_is_that_of_the_named_keys(tmp_path: Path) -> None:
    """One line names what was chosen."""
    write_room(tmp_path / "room", attic(96, 72).environment)
    light = {"position": (0.9, 1.9, 0.2), "falloff": 1.5}
    scene = colonnade.Scene("cube", background={"room": "room"}, light=light, folder=tmp_path)
    size = (48, 36)
    with pytest.warns(UserWarning, match="light gathered and noise filtered by small.*16 samples a pixel"):
        default = scene.render(overrides=SMALL_MAPS, size=size)
    named = scene.with_tables(paths={"gather": 1}, frame={"samples": 16, "denoise": True})
    assert np.array_equal(default.pixels, named.render(overrides=SMALL_MAPS, size=size).pixels)
    plain = scene.with_tables(paths={"gather": 0}).render(overrides=SMALL_MAPS, size=size)
    assert not np.array_equal(plain.pixels, default.pixels)
