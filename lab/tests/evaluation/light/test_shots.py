"""The scenes of the contact sheets."""

from __future__ import annotations

from pathlib import Path

import pytest
from colonnade.design.toolchain import project_root
from colonnade.scene.parser import load_scene

from colonnade_lab.evaluation.light import shots
from colonnade_lab.evaluation.light.shots import SHOTS, Item, Shot
from colonnade_lab.evaluation.light.user_rooms import known_room


def test_every_shot_has_a_room_and_places_in_it() -> None:
    for shot in SHOTS.values():
        if "/" in shot.room:
            assert (project_root() / shot.room / "meta.json").is_file() and not shot.has_panorama
        else:
            places = len(known_room(shot.room).frames["rough"])
            assert all(isinstance(item.place, int) and item.place < places for item in shot.items)


def test_a_shot_leaves_light_and_noise_to_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    items = (Item("cube", "metal", size=0.3), Item("octahedron", None, size=0.2, place=(200, 300)))
    monkeypatch.setitem(SHOTS, "a", Shot("scenes/rooms/office", items))
    (file,) = shots.write_shots(tmp_path, ("a",))
    scene = load_scene(file)
    assert not scene.names_light and not scene.names_gather
    assert scene.frame.samples is None and scene.frame.denoise is None
    first, second = scene.objects
    assert (first.material.kind, first.material.roughness) == ("mirror", 0.45)
    assert second.stand_at == (200, 300)
