"""Cameras that a motion moves, and cameras of a room other than its maps'."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from colonnade_lab.evaluation.studies.synthetic_attic import write_attic

from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.environment.load import load_environment
from colonnade.mesh.load import load_mesh
from colonnade.scene.cameras import WorldCamera, environment_camera
from colonnade.scene.model import Camera, CameraKey, MeshSource, Motion, Scene, Vector
from colonnade.scene.object_pose import Placed
from colonnade.scene.parser import load_scene
from colonnade.scene.view import world_view

SIZE = (96, 72)
EXTENT = load_mesh("teapot:4").extent
KEYS = (CameraKey(at=0.5, position=(1.0, 2.0, 3.0)), CameraKey(position=(3.0, 2.0, 3.0), target=(0.0, 0.5, 0.0)))
FIXED = Scene(MeshSource(name="teapot:4"), camera=Camera(position=(0.0, 1.0, 5.0), target=(0.0, 0.0, 0.0)))
MOVING = replace(FIXED, motion=Motion(turn=0.0, camera=KEYS))


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rooms") / "attic"
    write_attic(folder, *SIZE)
    return folder


def camera(scene: Scene, progress: float, room: Path | None = None) -> WorldCamera:
    environment = None if room is None else load_environment(room)
    return world_view(Placed(scene.at(progress), EXTENT, environment), *SIZE).camera


def vector(values: Floats) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z


def looks_at(camera: WorldCamera, target: tuple[float, float, float]) -> bool:
    way = np.array(target) - camera.position
    return bool(np.allclose(-camera.axes[2], way / np.linalg.norm(way), atol=1e-9))


def same(one: WorldCamera, other: WorldCamera, tolerance: float = 0.0) -> bool:
    return all(
        np.allclose(getattr(one, name), getattr(other, name), rtol=0.0, atol=tolerance)
        for name in ("position", "corner", "step_x", "step_y", "axes")
    )


def test_a_camera_passes_its_keys() -> None:
    assert same(camera(MOVING, 0.0), camera(FIXED, 0.0))
    half = camera(MOVING, 0.25)
    assert half.position.tolist() == [0.5, 1.5, 4.0] and looks_at(half, (0.0, 0.0, 0.0))
    key = camera(MOVING, 0.5)
    assert key.position.tolist() == [1.0, 2.0, 3.0] and looks_at(key, (0.0, 0.0, 0.0)), "the target stays"
    later = camera(MOVING, 0.75)
    assert later.position.tolist() == [2.0, 2.0, 3.0] and looks_at(later, (0.0, 0.25, 0.0))
    end = camera(MOVING, 1.0)
    assert end.position.tolist() == [3.0, 2.0, 3.0] and looks_at(end, (0.0, 0.5, 0.0))


def test_a_camera_rests_after_its_last_key() -> None:
    early = replace(FIXED, motion=Motion(turn=0.0, camera=(replace(KEYS[0], at=0.4),)))
    assert same(camera(early, 0.4), camera(early, 0.9))


def test_a_key_at_the_start_replaces_the_camera() -> None:
    first = CameraKey(at=0.0, position=(2.0, 2.0, 2.0))
    scene = replace(FIXED, motion=Motion(turn=0.0, camera=(first, *KEYS)))
    assert camera(scene, 0.0).position.tolist() == [2.0, 2.0, 2.0]


def test_a_framing_camera_starts_where_it_frames() -> None:
    framing = replace(FIXED, camera=Camera())
    moving = replace(framing, motion=MOVING.motion)
    assert same(camera(moving, 0.0), camera(framing, 0.0))
    assert same(camera(moving, 1e-9), camera(framing, 0.0), 1e-6), "no jump"


def test_a_moving_camera_is_no_closed_motion() -> None:
    assert not MOVING.motion.is_still and MOVING.frame_progress(3) == [0.0, 0.5, 1.0]


def test_lights_beside_the_object_stay_while_the_camera_moves() -> None:
    first, last = (world_view(Placed(MOVING.at(progress), EXTENT), *SIZE).lights[0].position for progress in (0.0, 1.0))
    np.testing.assert_array_equal(first, last)


def test_a_room_keeps_its_camera_unless_the_scene_places_one(room: Path) -> None:
    environment = load_environment(room)
    scene = Scene(MeshSource(name="teapot:4")).with_environment(room)
    own = environment_camera(environment, *SIZE)
    assert not scene.places_camera and same(camera(scene, 0.0, room), own)
    # The pose of the maps, given by the scene: the same lens
    given = replace(scene, camera=Camera(vector(own.position), vector(own.position - 2.0 * own.axes[2])))
    assert given.places_camera and same(camera(given, 0.0, room), own, 1e-9)
    wide = replace(given, camera=replace(given.camera, fov=90.0))
    assert np.linalg.norm(camera(wide, 0.0, room).step_y) == pytest.approx(2.0 / SIZE[1])


def test_a_motion_leaves_from_the_camera_of_the_room(room: Path) -> None:
    own = environment_camera(load_environment(room), *SIZE)
    scene = replace(MOVING, camera=Camera()).with_environment(room)
    assert scene.places_camera and same(camera(scene, 0.0, room), own)
    assert same(camera(scene, 1e-9, room), own, 1e-6), "no jump"
    assert camera(scene, 1.0, room).position.tolist() == [3.0, 2.0, 3.0]


IN_ROOM = 'mesh.name = "teapot:4"\nbackground.room = "attic"\n'
FROM = "camera = {position = [0.0, 1.0, 2.0], target = [0.0, 0.5, 0.0]}\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (IN_ROOM + "camera.fov = 30.0\n", "give camera.position, or leave out"),
        (IN_ROOM + 'background.photo = "a.png"\n', "for a camera that the scene places: give"),
        ('mesh.name = "teapot"\nbackground.photo = "a.png"\n', "it needs background.room"),
        (
            IN_ROOM + FROM + 'background.photo = "a.png"\n[[motion.camera]]\nposition = [0.0, 1.0, 1.0]\n',
            "leave out motion.camera",
        ),
        ("mesh.name = 'teapot'\n[[motion.camera]]\nat = 0.5\n", "motion.camera"),
        (
            "mesh.name = 'teapot'\n[[motion.camera]]\nat = 0.5\nposition = [0.0, 1.0, 1.0]\n"
            "[[motion.camera]]\nat = 0.5\nposition = [0.0, 2.0, 1.0]\n",
            "motion.camera.at must ascend",
        ),
        ("mesh.name = 'teapot'\n[[motion.camera]]\nat = 1.5\nposition = [0.0, 1.0, 1.0]\n", "motion.camera"),
        ("mesh.name = 'teapot'\nmotion.camera = 5\n", "motion.camera"),
    ],
)
def test_a_wrong_camera_is_one_line(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "scene.toml").write_text(text)
    with pytest.raises(UserError, match=message) as caught:
        load_scene(tmp_path / "scene.toml")
    assert len(str(caught.value).splitlines()) == 1


def test_a_target_at_the_camera_is_refused() -> None:
    scene = replace(FIXED, motion=Motion(camera=(CameraKey(position=(0.0, 0.0, 0.0)),)))
    with pytest.raises(UserError, match="position is its target"):
        camera(scene, 1.0)


def test_keys_of_a_file(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(
        IN_ROOM + FROM + "[[motion.camera]]\nat = 0.5\nposition = [0.1, 1.0, 1.9]\n"
        "[[motion.camera]]\nposition = [0.2, 1.0, 1.9]\ntarget = [0.0, 0.5, 0.1]\n"
    )
    scene = load_scene(tmp_path / "scene.toml")
    assert [key.at for key in scene.motion.camera] == [0.5, 1.0]
    assert scene.motion.camera[1].target == (0.0, 0.5, 0.1)
