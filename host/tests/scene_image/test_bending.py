"""Tests of scene images whose mesh bends: the records at rest and in every pose, and frames of the model."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from animated_documents import arm
from leaves import leaves_of

from colonnade.common.errors import UserError
from colonnade.common.progress import QUIET
from colonnade.design import toolchain
from colonnade.design.generator import manifest_for
from colonnade.design.manifest import Manifest
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.mesh import Mesh
from colonnade.render.device_frames import device_frames, render_model
from colonnade.render.request import RenderRequest
from colonnade.scene.model import Camera, FrameSize, MeshSource, Motion, ObjectKey, Scene, SceneObject, Transform
from colonnade.scene.object_mesh import object_mesh
from colonnade.scene.parser import load_scene
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene_image.bending import Bending
from colonnade.scene_image.clip_file import NO_VERTEX
from colonnade.scene_image.file import SceneImage
from colonnade.scene_image.grid_clip import GridClip, grid_clip
from colonnade.scene_image.packer import pack

SIZE = (96, 72)


@pytest.fixture(scope="module", params=["edge", "lean", "small"])
def manifest(request: pytest.FixtureRequest) -> Manifest:
    return Manifest.load(toolchain.project_root() / "configs" / "golden" / f"{request.param}.json")


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return arm().write(tmp_path_factory.mktemp("clips") / "arm.gltf")


@pytest.fixture(scope="module")
def mesh(path: Path) -> Mesh:
    return load_mesh(path, animation="bend")


@pytest.fixture(scope="module")
def image(mesh: Mesh, manifest: Manifest) -> SceneImage:
    return pack(mesh, manifest)


@pytest.fixture(scope="module")
def clip(mesh: Mesh, manifest: Manifest) -> GridClip:
    return grid_clip(mesh, int(manifest.config["geometry"]["vertexBits"]))


@pytest.mark.parametrize(
    ("override", "message"),
    [("geometry.vertexBits=20", "vertexBits 20 has 288"), ("geometry.bvh=false", "bvh is false")],
)
def test_hardware_whose_records_do_not_bend_is_refused(mesh: Mesh, override: str, message: str) -> None:
    with pytest.raises(UserError, match=message):
        pack(mesh, manifest_for("tiny", (override,)).manifest)


def test_the_rest_pose_has_the_records_of_the_packer(image: SceneImage, clip: GridClip) -> None:
    assert isinstance(image.moves, Bending)
    records = image.posed(0.5).records.copy()
    assert not np.array_equal(records, image.records)
    vertices = image.moves.vertices(clip.rest.astype(np.int32))
    image.moves._target.refit(*vertices, records.view(np.uint32), 0)
    np.testing.assert_array_equal(records, image.records)


def test_each_face_has_its_vertices_in_every_pose(
    image: SceneImage, mesh: Mesh, manifest: Manifest, clip: GridClip
) -> None:
    assert isinstance(image.moves, Bending)
    in_order = Bending.of(clip, manifest, 2, 1, np.array([[0, 0, 0, -1]]), False)
    for progress in (0.0, 0.3, 0.7, 1.0):
        pose = image.moves._target.pose(round(progress * image.moves.duration))
        positions, _ = in_order.vertices(pose)
        ids, leaves = leaves_of(image.posed(progress), manifest)
        faces = {int(source): face for face, source in enumerate(mesh.source_faces)}
        assert len(ids) == len(mesh.faces)
        for packed, triangle in zip(ids, leaves["vertices"], strict=True):
            expected = positions[clip.corners[faces[int(image.source_faces[packed])]]].tolist()
            assert triangle.tolist() in [expected[turn:] + expected[:turn] for turn in range(3)]
        low, high = leaves["vertices"].min(axis=(0, 1)), leaves["vertices"].max(axis=(0, 1))
        assert (low >= image.header.bounds_low).all() and (high <= image.header.bounds_high).all()


@pytest.mark.parametrize("others", [(), ((0.0, -1.5, 0.0), (-1.5, 0.0, 2.0))], ids=["one object", "three objects"])
def test_a_frame_shows_the_pose_of_its_moment(
    path: Path, manifest: Manifest, others: tuple[tuple[float, float, float], ...]
) -> None:
    camera = Camera(position=(2.5, 3.0, 4.5), target=(-0.5, 0.5, 1.0), fov=70.0)
    moving = MeshSource(path=path, animation="bend")
    sources = [SceneObject(mesh=moving), *(SceneObject(mesh=MeshSource("cube")) for _ in others)]
    places = [Transform(), *(Transform(translate=place, scale=0.4) for place in others)]
    objects = tuple(replace(one, transform=place) for one, place in zip(sources, places, strict=True)) if others else ()
    scene = Scene(moving, objects=objects, camera=camera, motion=Motion(turn=0.0))
    mesh, masks = object_mesh(scene), []
    for progress in (0.1, 0.8):
        found = render_model(scene.at(progress), mesh, manifest, SIZE).object_mask
        assert mesh.clip is not None and mesh.clip_corners is not None
        pose = mesh.clip.pose(progress * mesh.clip.duration)
        still = replace(mesh, vertices=mesh.clip.vertices(pose.matrices, pose.weights), clip=None)
        still = replace(still, faces=mesh.clip_corners.astype(np.int32))
        expected = render_model(scene, still, manifest, SIZE).object_mask
        assert expected.sum() > 300 and (found != expected).sum() <= 0.03 * expected.sum()
        masks.append(found)
    assert (masks[0] != masks[1]).sum() > 100


def test_frames_show_objects_where_their_motion_has_them(manifest: Manifest) -> None:
    camera = Camera(position=(0.5, 3.0, 6.0), target=(0.5, 0.5, 0.0))
    ball = SceneObject(mesh=MeshSource("sphere:80"), transform=Transform(translate=(-2.0, 0.0, 0.0)))
    moving = replace(ball, motion=(ObjectKey(translate=(4.0, 0.0, 0.0)),))
    cube = SceneObject(mesh=MeshSource("cube"))
    scene = Scene(ball.mesh, objects=(moving, cube), camera=camera, motion=Motion(turn=0.0))
    masks = [render_model(scene.at(at), object_mesh(scene), manifest, SIZE).object_mask for at in (0.0, 0.75)]
    for mask, x in zip(masks, (-2.0, 1.0), strict=True):
        placed = replace(scene, objects=(replace(ball, transform=Transform(translate=(x, 0.0, 0.0))), cube))
        expected = render_model(placed, object_mesh(placed), manifest, SIZE).object_mask
        assert expected.sum() > 300 and (mask != expected).sum() <= 0.03 * expected.sum()
    assert (masks[0] != masks[1]).sum() > 100


def test_the_frames_of_a_motion_play_the_clip(path: Path, mesh: Mesh, manifest: Manifest) -> None:
    scene = Scene(MeshSource(path=path, animation="bend"), motion=Motion(turn=0.0), frame=FrameSize(samples=1))
    request = RenderRequest(scene, config="edge", backend="model", frames=3)
    frames = [result.image for result in device_frames(request, scene, manifest, SIZE, None, QUIET)]
    for frame, progress in zip(frames, (0.0, 1 / 3, 2 / 3), strict=True):
        np.testing.assert_array_equal(frame, render_model(scene.at(progress), mesh, manifest, SIZE).image)
    assert not np.array_equal(frames[0], frames[1])


def test_a_clip_file_needs_an_animation(path: Path, mesh: Mesh, manifest: Manifest) -> None:
    moving = DeviceScene.of(Scene(MeshSource(path=path, animation="bend")), manifest, mesh)
    assert moving.clip_file().startswith(b"CLNDCLIP")
    still = DeviceScene.of(Scene(MeshSource("tetrahedron")), manifest)
    with pytest.raises(UserError, match="the scene has none"):
        still.clip_file()


def test_vertices_of_a_clip_file_are_in_the_order_in_which_leaves_need_them(
    path: Path, mesh: Mesh, manifest: Manifest
) -> None:
    words = np.frombuffer(
        DeviceScene.of(Scene(MeshSource(path=path, animation="bend")), manifest, mesh).clip_file(), "<u4"
    )
    vertices, leaves = int(words[19]), int(words[20])
    used = words[50 + 8 * vertices :][: 4 * leaves]
    used = used[used != NO_VERTEX]
    first = used[np.sort(np.unique(used, return_index=True)[1])]
    np.testing.assert_array_equal(first, np.arange(vertices))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('mesh = {path = "arm.gltf", animation = "bend", simplify = 100}', "leave out mesh.simplify"),
        ("mesh = {path = 'arm.gltf', animation = -1}", "mesh.animation"),
    ],
)
def test_scenes_refuse_what_an_animation_excludes(tmp_path: Path, text: str, message: str) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(text)
    with pytest.raises(UserError, match=message):
        load_scene(scene)


def test_a_mesh_that_bends_is_not_simplified(path: Path) -> None:
    with pytest.raises(UserError, match="leave out --simplify"):
        Scene(MeshSource(path=path, animation="bend")).with_simplified_mesh(100)


def test_an_animated_object_does_not_turn_unless_the_scene_says_so(path: Path) -> None:
    scene = path.parent / "scene.toml"
    scene.write_text('mesh = {path = "arm.gltf", animation = "bend"}')
    assert load_scene(scene).motion.degrees == 0.0
    scene.write_text('mesh = {path = "arm.gltf", animation = "bend"}\nmotion = {turn = 90.0}')
    assert load_scene(scene).motion.degrees == 90.0
