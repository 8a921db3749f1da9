"""Several objects of a scene: their poses, materials and face ids, and the places where they stand."""

from __future__ import annotations

import dataclasses
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from animated_documents import arm
from colonnade_lab.evaluation.studies.synthetic_attic import attic
from colonnade_lab.evaluation.verify import verify

from colonnade.common import notes
from colonnade.common.errors import UserError
from colonnade.common.hits import read_hits, write_hits
from colonnade.common.image_io import encode_srgb
from colonnade.environment.model import Environment
from colonnade.mesh.load import load_mesh
from colonnade.quality.image_metrics import psnr
from colonnade.render.frames import render, render_frames
from colonnade.render.request import RenderRequest
from colonnade.scene.joined_mesh import joined_mesh
from colonnade.scene.model import Material, MeshSource, Motion, ObjectKey, Scene, SceneObject, Transform
from colonnade.scene.object_mesh import object_mesh
from colonnade.scene.object_pose import Placed, rotation_about, rotation_matrix
from colonnade.scene.parser import load_scene
from colonnade.scene.standing import Footprint, free_place, surface_point


def test_colours_that_the_scene_replaces_are_noted(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text("newmtl a\nKd 1 0 0\n")
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    lines: list[str] = []
    with notes.opened(lines.append):
        for material in (Material(kind="mirror"), Material(albedo=(1.0, 1.0, 1.0))):
            assert lines == []
            object_mesh(Scene(MeshSource(path=tmp_path / "a.obj"), material=material))
    assert lines == [
        "mesh a: the material has the albedo of the scene, not that of the file: leave out material.albedo"
    ]


TWO = """
[[object]]
mesh.name = "cube"
transform = {translate = [-1.5, 0, 0], rotate = [0, 30, 0]}
material = {albedo = [0.8, 0.1, 0.1]}
[[object]]
mesh.name = "sphere:3"
transform = {translate = [1.5, 0, 0], scale = 0.8}
material = {kind = "mirror"}
"""


@pytest.fixture(scope="module")
def room() -> Environment:
    return attic(320, 240).environment


def objects(*described: SceneObject) -> Scene:
    return Scene(described[0].mesh, objects=described)


def test_clips_of_objects_play_where_they_are_placed(tmp_path: Path) -> None:
    path = arm().write(tmp_path / "arm.gltf")
    moving = MeshSource(path=path, animation="bend")
    place = Transform((0.0, 90.0, 0.0), 2.0, (5.0, 1.0, 0.0))
    scene = objects(
        SceneObject(mesh=moving), SceneObject(mesh=MeshSource("cube")), SceneObject(mesh=moving, transform=place)
    )
    joined, own, cube = joined_mesh(scene, None), load_mesh(path, animation="bend"), load_mesh("cube")
    assert scene.is_animated and joined.clip is not None and own.clip is not None
    assert joined.clip.duration == own.clip.duration
    parts = np.split(np.arange(len(joined.clip.positions)), np.cumsum([len(own.clip.positions), len(cube.vertices)]))
    turned = Placed(Scene(moving, transform=place), own.extent).pose
    for time in (0.0, 0.4 * own.clip.duration, own.clip.duration):
        pose, alone = joined.clip.pose(time), own.clip.pose(time)
        found = joined.clip.vertices(pose.matrices, pose.weights)
        expected = own.clip.vertices(alone.matrices, alone.weights)
        for part, vertices in zip(parts, (expected, cube.vertices, turned.to_world(expected)), strict=True):
            np.testing.assert_allclose(found[part], vertices, atol=1e-12)
    still = joined_mesh(objects(SceneObject(mesh=MeshSource("cube")), SceneObject(mesh=MeshSource("cube"))), None)
    assert still.clip is None and still.clip_corners is None


def test_an_object_moves_by_itself_about_its_centre() -> None:
    keys = (
        ObjectKey(0.5, turn=90.0, translate=(1.0, 0.0, 0.0)),
        ObjectKey(turn=360.0, rotate=(0.0, 0.0, 30.0), translate=(0.0, 0.5, 0.0)),
    )
    place = Transform((0.0, 30.0, 0.0), 2.0, (5.0, 1.0, 0.0))
    sphere = SceneObject(mesh=MeshSource("sphere:2"))
    scene = objects(SceneObject(mesh=MeshSource("cube"), transform=place, motion=keys), sphere)
    joined, cube = joined_mesh(scene, None), load_mesh("cube")
    assert scene.is_animated and not scene.is_still and joined.clip is not None
    start = Placed(Scene(MeshSource("cube"), transform=place), cube.extent).pose
    for progress, turn, lean, shift in ((0.0, 0, 0, (0, 0)), (0.25, 45, 0, (0.5, 0)), (0.75, 225, 15, (0.5, 0.25))):
        pose = joined.clip.pose(progress * joined.clip.duration)
        found = joined.clip.vertices(pose.matrices, pose.weights)
        turned = rotation_about((0.0, 1.0, 0.0), turn) @ rotation_matrix(Transform(rotate=(0.0, 0.0, lean)))
        own = (cube.vertices - cube.extent.centre) @ (2.0 * turned @ start.rotation).T
        moved = start.to_world(cube.extent.centre) + np.array([*shift, 0.0])
        np.testing.assert_allclose(found[: len(own)], own + moved, atol=1e-12)
        np.testing.assert_allclose(found[len(own) :], load_mesh("sphere:2").vertices, atol=1e-12)


@pytest.mark.parametrize(
    ("keys", "last"),
    [
        ((ObjectKey(turn=720.0),), 0.75),
        ((ObjectKey(0.5, translate=(1.0, 0.0, 0.0)), ObjectKey(translate=(0.0, 0.0, 0.0))), 0.75),
        ((ObjectKey(turn=90.0),), 1.0),
        ((ObjectKey(translate=(1.0, 0.0, 0.0)),), 1.0),
    ],
)
def test_frames_leave_out_the_end_if_all_objects_return(keys: tuple[ObjectKey, ...], last: float) -> None:
    still = SceneObject(mesh=MeshSource("cube"))
    scene = replace(objects(still, replace(still, motion=keys)), motion=Motion(turn=0.0))
    assert scene.frame_progress(4)[-1] == last


def test_objects_keep_their_poses_materials_and_faces() -> None:
    red = Material(albedo=(0.8, 0.1, 0.1), flat=True)
    moved = SceneObject(
        mesh=MeshSource("sphere:2"), material=red, transform=Transform((0.0, 90.0, 0.0), 2.0, (5.0, 0.0, 0.0))
    )
    joined = joined_mesh(
        objects(SceneObject(mesh=MeshSource("cube")), moved, SceneObject(mesh=MeshSource("cube"))), None
    )
    cube, sphere = load_mesh("cube"), load_mesh("sphere:2")
    own = slice(len(cube.faces), len(cube.faces) + len(sphere.faces))
    corners = sphere.vertices[sphere.faces] * 2.0
    turned = np.stack([corners[..., 2] + 5.0, corners[..., 1], -corners[..., 0]], axis=-1)
    np.testing.assert_allclose(joined.vertices[joined.faces[own]], turned, atol=1e-12)
    assert [joined.materials[k].albedo for k in joined.face_materials[[0, own.start, -1]]] == [
        (0.8, 0.8, 0.8),
        (0.8, 0.1, 0.1),
        (0.8, 0.8, 0.8),
    ]
    geometric = np.cross(turned[:, 1] - turned[:, 0], turned[:, 2] - turned[:, 0])
    assert (
        np.einsum("ni,nji->nj", geometric, joined.corner_normals[own])
        > 0.999 * np.linalg.norm(geometric, axis=1)[:, None]
    ).all()
    assert [part.first_face for part in joined.parts] == [0, 12, 12 + sphere.source_count]
    assert joined.parts[1].edge == pytest.approx(2 * sphere.extent.edge)


def test_model_and_reference_show_the_same_objects(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(TWO)
    request = RenderRequest(tmp_path / "a.toml", "small", backend="model", size=(96, 72))
    model, reference = render(request), render(dataclasses.replace(request, backend="reference"))
    assert psnr(encode_srgb(reference.image), encode_srgb(model.image)) > 35.0
    hits = model.hits()
    assert hits.object is not None
    assert {int(k): int(hits.triangle[hits.object == k].max()) < n for k, n in ((-1, 0), (0, 12), (1, 5120))} == {
        -1: True,
        0: True,
        1: True,
    }
    assert (hits.object[:, :40] != 1).all() and (hits.object[:, 56:] != 0).all()
    assert np.mean(hits.numbers() != reference.hits().numbers()) < 0.01
    write_hits(tmp_path / "h.npz", hits)
    np.testing.assert_array_equal(read_hits(tmp_path / "h.npz").numbers(), hits.numbers())


@pytest.mark.verilator
def test_hardware_shows_the_objects_of_the_model(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(TWO)
    report = verify(tmp_path / "a.toml", "small", (), (), (96, 72))
    assert report["equal"] and list(report["meshes"]) == ["a"]
    assert report["meshes"]["a"]["reference"]["psnr"] > 35.0


def test_a_motion_moves_all_objects_as_one(tmp_path: Path) -> None:
    fixed = TWO + "[camera]\nposition = [0, 0, 6]\ntarget = [0, 0, 0]\n[light]\nposition = [1, 4, 4]\n"
    (tmp_path / "moves.toml").write_text(fixed + "[motion]\ntranslate = [0.5, -0.5, 0]\n")
    (tmp_path / "stands.toml").write_text(fixed.replace("-1.5, 0", "-1, -0.5").replace("1.5, 0", "2, -0.5"))
    request = RenderRequest(tmp_path / "moves.toml", "small", backend="model", size=(96, 72))
    first, last = render_frames(dataclasses.replace(request, frames=2))
    stands = render(dataclasses.replace(request, scene=tmp_path / "stands.toml"))
    np.testing.assert_array_equal(first.image, render(request).image)
    assert np.mean(last.hits().numbers() != stands.hits().numbers()) < 0.005
    assert np.mean(first.hits().numbers() != stands.hits().numbers()) > 0.05


def test_objects_turn_about_their_common_centre_if_asked(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(TWO)
    (tmp_path / "turns.toml").write_text(TWO + "[motion]\nturn = 90\n")
    still, turning = load_scene(tmp_path / "a.toml"), load_scene(tmp_path / "turns.toml")
    extent = joined_mesh(still, None).extent
    assert still.motion.is_still and not turning.motion.is_still
    points = extent.centre + np.array([[0.0, 0, 0], [0, 2, 0], [1, 0, 0]])
    np.testing.assert_allclose(Placed(still.at(1.0), extent).pose.to_world(points), points)
    turned = extent.centre + np.array([[0.0, 0, 0], [0, 2, 0], [0, 0, -1]])
    np.testing.assert_allclose(Placed(turning.at(1.0), extent).pose.to_world(points), turned, atol=1e-12)


def test_objects_without_a_place_stand_apart_on_level_surfaces(room: Environment) -> None:
    joined = joined_mesh(objects(*[SceneObject(mesh=MeshSource("cube"), size=0.2) for _ in range(3)]), room)
    cubes = joined.vertices.reshape(3, 8, 3)
    centres = cubes.mean(axis=1)
    apart = [np.linalg.norm(centres[a] - centres[b]) for a, b in ((0, 1), (0, 2), (1, 2))]
    assert min(apart) > 0.2
    for cube in cubes:
        seen = (cube - room.camera_to_world[:, 3]) @ room.camera_to_world[:, :3]
        u = seen[:, 0] / seen[:, 2] * room.fx + room.cx
        v = seen[:, 1] / seen[:, 2] * room.fy + room.cy
        assert (u > 0).all() and (u < 320).all() and (v > 0).all() and (v < 240).all()


def test_a_place_is_level_and_too_large_an_object_has_none(room: Environment) -> None:
    place = free_place(room, Footprint(0.2, 0.2))
    assert place is not None
    surface_point(place, room, "object.stand_at")
    assert free_place(room, Footprint(4.0, 0.2)) is None
    with pytest.raises(UserError, match="no level surface in view of room attic has room for an object"):
        joined_mesh(objects(SceneObject(mesh=MeshSource("cube"), size=9.0)), room)


@pytest.mark.parametrize("is_steep", ["wall", "ceiling"])
def test_walls_and_ceilings_are_refused(room: Environment, is_steep: str) -> None:
    upward = room.normals @ room.camera_to_world[1, :3]
    mask = np.abs(upward) < 0.2 if is_steep == "wall" else upward < -0.75
    kernel = np.lib.stride_tricks.sliding_window_view(mask, (7, 7)).all(axis=(2, 3))
    if not kernel.any():
        pytest.skip("the room has no such surface")
    y, x = np.argwhere(kernel)[0] + 3
    with pytest.raises(
        UserError,
        match=rf"stand_at is .* in the 320x240 pixels of room attic, on a {is_steep}.*choose a pixel of a floor",
    ):
        joined_mesh(objects(SceneObject((float(x), float(y)), mesh=MeshSource("cube"))), room)
