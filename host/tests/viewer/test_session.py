"""A scene in view is loaded again when a file that it reads changes, and keeps a camera that can be shown."""

from __future__ import annotations

import base64
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import textured_files
from PIL import Image

import colonnade
from colonnade.common.errors import UserError
from colonnade.viewer.session import MOTION_SECONDS, Session, ViewCamera

SIZE = (48, 36)
OBJ = """mtllib m.mtl
usemtl a
v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
vt 0 0
vt 1 0
vt 0 1
f 1/1 3/2 2/3
f 1/1 2/2 4/3
f 1/1 4/2 3/3
f 2/1 3/2 4/3
"""
CAMERA = "camera = {position = [2, 2, 4], target = [0.2, 0.2, 0.2]}\n"
#: A scene, the file that changes, and another file whose content it gets; None: it was missing.
CHANGES = {
    "scene": ('mesh.path = "m.obj"\n', "scene.toml", "other.toml"),
    "mesh": ('mesh.path = "m.obj"\n', "m.obj", "other.obj"),
    "materials": ('mesh.path = "m.obj"\n', "m.mtl", "other.mtl"),
    "texture": ('mesh.path = "m.obj"\n', "t.png", "other.png"),
    "buffer": ('mesh.path = "a.gltf"\n', "m.bin", "other.bin"),
    "panorama": ('mesh.path = "m.obj"\nbackground.panorama = "p.png"\n', "p.png", "q.png"),
    "missing-materials": ('mesh.path = "bare.obj"\n', "late.mtl", "other.mtl"),
    "room": ('mesh.name = "cube"\nbackground.room = "attic"\n', "attic/albedo.png", "albedo.png"),
    "room-camera": ('mesh.name = "cube"\nbackground.room = "attic"\n', "attic/meta.json", "meta.json"),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with meshes and what they reference, a panorama and a room, each beside another one."""
    shutil.copytree(Path(__file__).parents[3] / "scenes" / "rooms" / "attic", tmp_path / "attic")
    shutil.copyfile(tmp_path / "attic" / "albedo.png", tmp_path / "albedo.png")
    Image.fromarray(255 - np.array(Image.open(tmp_path / "albedo.png"))).save(tmp_path / "albedo.png")
    meta = json.loads((tmp_path / "attic" / "meta.json").read_text())
    (tmp_path / "meta.json").write_text(json.dumps(meta | {"fx": 0.9 * meta["fx"]}))
    (tmp_path / "m.obj").write_text(OBJ)
    (tmp_path / "other.obj").write_text(OBJ.replace("v 1 0 0", "v 2 0 0"))
    (tmp_path / "bare.obj").write_text(OBJ.replace("m.mtl", "late.mtl"))
    (tmp_path / "m.mtl").write_text("newmtl a\nKd 1 1 1\nmap_Kd t.png\n")
    (tmp_path / "other.mtl").write_text("newmtl a\nKd 0.25 1 0\n")
    for name, size, red in (("t", (8, 8), 90), ("other", (8, 8), 240), ("p", (32, 16), 90), ("q", (32, 16), 240)):
        Image.new("RGB", size, (red, 40, 40)).save(tmp_path / f"{name}.png")
    (buffer,) = json.loads(textured_files.gltf(tmp_path).read_text())["buffers"]
    data = base64.b64decode(buffer["uri"].partition(",")[2])
    (tmp_path / "m.bin").write_bytes(data)
    (tmp_path / "other.bin").write_bytes((1 - np.eye(3, dtype=np.float32)).tobytes() + data[36:])
    textured_files.gltf(tmp_path, buffers=[{"uri": "m.bin", "byteLength": len(data)}])
    return tmp_path


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_of_any_file_that_a_scene_reads_shows(folder: Path, name: str) -> None:
    text, changed, other = CHANGES[name]
    file = folder / "scene.toml"
    file.write_text(text + (CAMERA if "room" not in text else ""))
    (folder / "other.toml").write_text(file.read_text().replace("0.2]", "0.4]"))
    session = Session(file, "small", size=SIZE)
    before, version = session.frame().pixels, session.state()["version"]
    session.look()
    assert session.state()["version"] == version
    shutil.copyfile(folder / other, folder / changed)
    session.look()
    assert session.state()["version"] == version + 1 and session.state()["error"] == ""
    assert (session.frame().pixels != before).any()
    session.close()


def test_a_file_that_is_missing_for_a_while_is_seen_again(folder: Path) -> None:
    file = folder / "scene.toml"
    file.write_text(f'mesh.path = "m.obj"\n{CAMERA}')
    session = Session(file, "tiny", size=SIZE)
    (folder / "m.obj").rename(folder / "away.obj")
    session.look()
    assert "m.obj does not exist" in session.state()["error"]
    (folder / "away.obj").rename(folder / "m.obj")
    session.look()
    assert session.state()["error"] == ""
    session.close()


def test_a_name_that_no_file_can_have_is_the_error_of_render(file: Path) -> None:
    session = Session(file, "tiny", size=SIZE)
    file.write_text('mesh.path = "a\\u0000.obj"\n')
    session.look()
    with pytest.raises(UserError) as error:
        colonnade.Scene.load(file).render(config="tiny", size=SIZE)
    assert session.state()["error"] == str(error.value) and "not a file name" in str(error.value)
    session.close()


@pytest.mark.parametrize(
    ("camera", "says"),
    [
        (ViewCamera((2.0, 2.0, 4.0), (2.0, 2.0, 4.0)), "position is its target"),
        (ViewCamera((1e11, 0.0, 0.0), (0.0, 0.0, 0.0)), "edges away"),
    ],
)
def test_a_camera_that_no_frame_shows_is_not_saved(file: Path, camera: ViewCamera, says: str) -> None:
    session, text = Session(file, "tiny", size=SIZE), file.read_bytes()
    with pytest.raises(UserError, match=says):
        session.save(camera)
    assert file.read_bytes() == text
    session.close()


@pytest.mark.parametrize("scale", [1e-5, 1e-3, 1e3])
def test_a_saved_camera_shows_what_was_shown_at_any_scale(file: Path, scale: float) -> None:
    file.write_text(f'mesh.name = "octahedron"\ntransform.scale = {scale}\n')
    session = Session(file, "tiny", size=SIZE)
    camera = ViewCamera((2 * scale, 2 * scale, 4 * scale), (0.2 * scale, 0.2 * scale, 0.2 * scale))
    pixels = session.frame(camera).pixels
    session.save(camera)
    session.look()
    assert session.state()["error"] == ""
    np.testing.assert_array_equal(session.frame().pixels, pixels)
    near = ViewCamera((0.20001 * scale, 0.2 * scale, 0.2 * scale), camera.target)
    session.save(near)
    session.look()
    assert session.state()["error"] == "" and session.state()["camera"]["position"] == pytest.approx(near.position)
    session.close()


def test_a_camera_is_saved_in_the_scene_as_its_file_is(file: Path) -> None:
    """Also where the file has changed since the session has last looked at it."""
    session = Session(file, "tiny", size=SIZE)
    camera = ViewCamera((0.0, 0.0, 3e4), (0.0, 0.0, 0.0))
    with pytest.raises(UserError, match="edges away"):
        session.save(camera)
    file.write_text(f"transform.scale = 1e4\n{file.read_text()}")
    session.save(camera)
    text = file.read_text()
    assert "position = [0.0, 0.0, 30000.0]" in text
    file.write_text(text.replace("35.0", "350.0"))
    with pytest.raises(UserError, match=r"while the scene has an error: .*fov"):
        session.save(camera)
    session.close()


def test_a_scene_of_the_project_is_not_edited(file: Path) -> None:
    session, text = Session(file, "tiny", size=SIZE, is_own=False), file.read_bytes()
    with pytest.raises(
        UserError, match=r"scene is a scene of the project.*: cp -r .* my-scenes && colonnade view my-scenes"
    ):
        session.save(ViewCamera((2.0, 2.0, 4.0), (0.0, 0.0, 0.0)))
    assert file.read_bytes() == text
    session.close()


def test_a_moving_camera_keeps_the_light_of_the_frames_before(tmp_path: Path) -> None:
    """So it has less noise than the frame that comes first."""
    Image.fromarray(np.repeat(np.uint8([[250], [20]]), 16, 0).repeat(64, 1)).save(tmp_path / "p.png")
    dark = "light = {position = [0, 9, 0], colour = [0, 0, 0]}\nframe.denoise = true\npaths.gather = 1\n"
    (tmp_path / "scene.toml").write_text(f'mesh.name = "teapot:6"\nbackground.panorama = "p.png"\n{dark}')
    session = Session(tmp_path / "scene.toml", "small", size=(96, 72))
    own = session.state()["camera"]
    x, y, z = own["position"]
    first, *_, last = (
        session.frame(ViewCamera((x + 0.01 * number, y, z), own["target"])).pixels.astype(float) for number in range(8)
    )
    after, before = (np.median(np.abs(np.diff(pixels[30:50, 20:60], axis=1))) for pixels in (last, first))
    assert after < 0.4 * before
    session.close()


MOVING = """[[object]]
mesh = {name = "cube"}

[[object]]
mesh = {name = "octahedron"}
transform.translate = [2.0, 0.0, 0.0]
motion = [{translate = [0.0, 1.0, 0.0], turn = 90.0}]

[camera]
position = [2.0, 2.0, 6.0]
target = [1.0, 0.0, 0.0]
"""


@pytest.mark.parametrize("text", [MOVING, 'mesh.name = "octahedron"\nmotion.turn = 90.0\n'])
def test_a_moment_of_a_motion_is_that_of_render(file: Path, text: str) -> None:
    file.write_text(text)
    session = Session(file, "tiny", size=SIZE)
    expected = [one.pixels for one in colonnade.Scene.load(file).frames(3, config="tiny", size=SIZE, samples=1)]
    for number in (1, 0, 2, 1):
        np.testing.assert_array_equal(session.frame(at=number / 2).pixels, expected[number])
    np.testing.assert_array_equal(session.frame().pixels, expected[0])
    assert (expected[1] != expected[0]).any()
    half = session.still(at=0.5)
    assert session.still(at=0.5).samples == half.samples + 1 and session.still(at=0.6).samples == 1
    session.close()


@pytest.mark.parametrize(
    ("text", "seconds", "plays"),
    [(MOVING, MOTION_SECONDS, True), ('mesh.name = "cube"\nmotion.turn = 0.0\n', None, False)],
)
def test_the_page_knows_how_long_a_motion_is(file: Path, text: str, seconds: float | None, plays: bool) -> None:
    file.write_text(text)
    session = Session(file, "tiny", size=SIZE)
    state = session.state()
    assert (state["seconds"], state["plays"]) == (seconds, plays)
    session.close()
