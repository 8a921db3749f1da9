"""Tests of clips that glTF files hold: skins, morph targets and moving nodes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from animated_documents import HOSTILE, Evaluator, arm, changed

from colonnade import _core
from colonnade.common.errors import UserError
from colonnade.mesh.clips.clip import Pose
from colonnade.mesh.clips.keys import Keys, baked, keys_of
from colonnade.mesh.files.gltf_document import GltfDocument
from colonnade.mesh.files.resolver import References
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.mesh import Mesh

TIMES = (0.0, 0.1, 0.4, 0.62, 0.99, 1.5)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return arm().write(tmp_path_factory.mktemp("clips") / "arm.gltf")


@pytest.fixture(scope="module")
def mesh(path: Path) -> Mesh:
    return load_mesh(path, animation="bend")


def expected(path: Path, time: float) -> list[list[float]]:
    """All vertices of the default scene in their order."""
    document = GltfDocument(path.read_bytes(), path, References(path))
    evaluator, found = Evaluator(document.json, document.array), []
    for node in document.json["scenes"][0]["nodes"]:
        mesh = document.json["nodes"][node].get("mesh")
        for primitive in [] if mesh is None else document.json["meshes"][mesh]["primitives"]:
            count = len(document.array(primitive["attributes"]["POSITION"]))
            found += [evaluator.vertex(node, primitive, vertex, time) for vertex in range(count)]
    return found


@pytest.mark.parametrize("time", TIMES)
def test_vertices_are_where_gltf_has_them(path: Path, mesh: Mesh, time: float) -> None:
    assert mesh.clip is not None
    pose = mesh.clip.pose(time)
    np.testing.assert_allclose(mesh.clip.vertices(pose.matrices, pose.weights), expected(path, time), atol=2e-6)


def test_the_mesh_is_in_the_rest_pose_of_its_clip(mesh: Mesh) -> None:
    assert mesh.clip is not None and mesh.clip_corners is not None
    rest = mesh.clip.rest()
    vertices = mesh.clip.vertices(rest.matrices, rest.weights)
    np.testing.assert_array_equal(vertices[mesh.clip_corners], mesh.vertices[mesh.faces])


def test_rest_of_nodes_that_do_not_bend_is_the_mesh_without_its_clip(tmp_path: Path) -> None:
    document = arm()
    document.json["scenes"] = [{"nodes": [5]}]
    path = document.write(tmp_path / "box.gltf")
    still, moving = load_mesh(path), load_mesh(path, animation="bend")
    np.testing.assert_array_equal(still.vertices[still.faces], moving.vertices[moving.faces])
    np.testing.assert_allclose(still.corner_normals, moving.corner_normals, atol=1e-12)


def test_of_copies_of_a_mesh_one_is_animated(tmp_path: Path, mesh: Mesh) -> None:
    document = arm()
    shifts = document.add([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [0.0, 5.0, 0.0]])
    document.json["nodes"][5]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": shifts}}}
    file = document.write(tmp_path / "a.gltf")
    animated = load_mesh(file, animation="bend")
    np.testing.assert_array_equal(animated.vertices, mesh.vertices)
    assert [note for note in animated.notes if "2 copies of an animated mesh are not shown" in note]
    assert len(load_mesh(file).faces) == len(mesh.faces) + 4


def test_a_value_jumps_at_a_step(mesh: Mesh) -> None:
    assert mesh.clip is not None
    before, after = mesh.clip.pose(0.625, before=True), mesh.clip.pose(0.625)
    assert not before.is_equal(after)
    assert np.abs(before.matrices - mesh.clip.pose(0.625 - 1e-9).matrices).max() < 1e-6
    assert np.abs(after.matrices - mesh.clip.pose(0.625 + 1e-9).matrices).max() < 1e-6


def test_an_animation_has_a_name_or_a_number(path: Path, mesh: Mesh) -> None:
    assert mesh.clip is not None
    other = load_mesh(path, animation="0").clip
    assert other is not None and other.pose(0.3).is_equal(mesh.clip.pose(0.3))
    with pytest.raises(UserError, match="it has no animation jump: it has 1 animation, bend"):
        load_mesh(path, animation="jump")
    document = arm()
    unnamed = {key: value for key, value in document.json["animations"][0].items() if key != "name"}
    document.json["animations"] = [unnamed, unnamed]
    with pytest.raises(UserError, match="it has no animation Walk: it has 2 animations, 0, 1"):
        load_mesh(document.write(path.parent / "unnamed.gltf"), animation="Walk")


def test_meshes_without_animations_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    for source in ("teapot", tmp_path / "a.obj"):
        with pytest.raises(UserError, match=r"has no animations: leave out mesh\.animation"):
            load_mesh(source, animation="bend")


def test_an_animated_mesh_is_not_subdivided(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLONNADE_MESHES", str(path.parent))
    assert load_mesh("arm", animation="bend").clip is not None
    with pytest.raises(UserError, match="or the subdivisions"):
        load_mesh("arm:1", animation="bend")


@pytest.mark.parametrize(("places", "value", "message"), HOSTILE)
def test_hostile_animations_are_refused(tmp_path: Path, places: tuple[Any, ...], value: Any, message: str) -> None:
    path = changed(places, value).write(tmp_path / "hostile.gltf")
    with pytest.raises(UserError, match=message) as caught:
        load_mesh(path, animation="0")
    assert "\n" not in str(caught.value)


@pytest.fixture(scope="module")
def keys(mesh: Mesh) -> Keys:
    assert mesh.clip is not None
    return baked(mesh.clip).keys


def between(keys: Keys, time: float) -> Pose:
    """The pose between two keys."""
    last = len(keys.times) - 1
    place = min(int(np.searchsorted(keys.times, time, side="right")) - 1, last)
    after = min(place + 1, last)
    span = keys.times[after] - keys.times[place]
    part = (time - keys.times[place]) / span if span > 0 else 0.0
    return Pose(*((1 - part) * values[place] + part * values[after] for values in (keys.matrices, keys.weights)))


def test_keys_follow_the_clip_within_their_tolerance(mesh: Mesh, keys: Keys) -> None:
    assert mesh.clip is not None
    tolerance = float(np.ptp(mesh.vertices, axis=0).max()) * _core.CLIP_TOLERANCE
    for time in np.random.default_rng(5).uniform(0.0, mesh.clip.duration, 100):
        found, exact = (
            mesh.clip.vertices(*vars(pose).values()) for pose in (between(keys, time), mesh.clip.pose(time))
        )
        assert np.abs(found - exact).max() <= tolerance


def test_keys_are_denser_for_a_smaller_tolerance(mesh: Mesh, keys: Keys) -> None:
    assert mesh.clip is not None
    tolerance = float(np.ptp(mesh.vertices, axis=0).max()) * _core.CLIP_TOLERANCE
    same, denser = (keys_of(mesh.clip, share * tolerance) for share in (1, 0.25))
    np.testing.assert_array_equal(same.times, keys.times)
    assert len(denser.times) > len(keys.times)


def test_keys_jump_where_the_clip_jumps(mesh: Mesh, keys: Keys) -> None:
    assert mesh.clip is not None
    assert (keys.times == 0.625).sum() == 2
    assert between(keys, 0.625).is_equal(mesh.clip.pose(0.625))


def test_the_box_of_keys_holds_all_poses_between_them(mesh: Mesh, keys: Keys) -> None:
    assert mesh.clip is not None
    found = baked(mesh.clip)
    low, high = found.low, found.high
    assert (low <= mesh.vertices.min(axis=0)).all() and (mesh.vertices.max(axis=0) <= high).all()
    for time in np.linspace(0.0, mesh.clip.duration, 200):
        vertices = mesh.clip.vertices(*vars(between(keys, time)).values())
        assert (low - 1e-12 <= vertices).all() and (vertices <= high + 1e-12).all()
