"""A camera is written into a scene file, whose other lines stay."""

from __future__ import annotations

from pathlib import Path

import pytest

import colonnade
from colonnade.common import ledger
from colonnade.common.errors import UserError
from colonnade.viewer.camera_table import save_camera


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ('mesh.name = "cube"\n', "position = [1.0, 2.0, 3.0]"),
        ('camera = {direction = [1.0, 0.0, 0.0], fov = 30.0} # c\nmesh.name = "cube"\n', "fov = 30.0"),
        ('camera.framing = 0.5 # c\ncamera.fov = 30.0 # f\nmesh.name = "cube"\n', "camera.fov = 30.0 # f"),
        ('[mesh]\nname = "cube"\n[camera]\nposition = [0.0, 0.0, 9.0] # here\n', "position = [1.0, 2.0, 3.0] # here"),
    ],
)
def test_a_camera_in_every_form_of_a_table_is_saved(tmp_path: Path, before: str, after: str) -> None:
    file = tmp_path / "scene.toml"
    file.write_text(before)
    with ledger.opened():  # as of the command, which has read the scene
        save_camera(file, (1, 2, 3), (0, 0, 0.123456), lambda _: None)
    assert after in file.read_text()
    camera = colonnade.Scene.load(file).description.camera
    assert camera.position == (1, 2, 3) and camera.target == (0, 0, 0.1235)
    for broken in ("camera = 5", "camera =", ".".join(["a"] * 50_000) + " = 1"):
        file.write_text(broken)
        with pytest.raises(UserError):
            save_camera(file, (1, 2, 3), (0, 0, 0), lambda _: None)
        assert file.read_text() == broken


@pytest.mark.parametrize("scale", [1e-9, 1e-5, 1.0, 1e4, 1e10])
def test_a_camera_is_rounded_by_its_distance(tmp_path: Path, scale: float) -> None:
    file = tmp_path / "scene.toml"
    file.write_text('mesh.name = "cube"\n')
    save_camera(file, (scale * 2 / 3, 0.0, scale * 3), (scale / 3, 0.0, 0.0), lambda _: None)
    camera = colonnade.Scene.load(file).description.camera
    assert camera.position == pytest.approx((scale * 2 / 3, 0.0, scale * 3), rel=2e-4)
    assert camera.target == pytest.approx((scale / 3, 0.0, 0.0), rel=2e-4)
    assert all(value == float(f"{value:.5g}") for value in camera.position or ())
