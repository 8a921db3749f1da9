"""Tests of clips that glTF files hold: skins, morph targets and moving nodes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from animated_documents import HOSTILE, Document, Evaluator, arm, changed, painted

from colonnade import _core
from colonnade.common.errors import UserError
from colonnade.mesh.clips.clip import Pose
from colonnade.mesh.clips.keys import Keys, baked, keys_of
from colonnade.mesh.clips.tracks import Animation
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


@pytest.mark.parametrize("glows", [False, True])
def test_a_mesh_that_does_not_bend_has_the_pieces_and_materials_of_a_still_one(tmp_path: Path, glows: bool) -> None:
    """Alpha, panes, emission and normal maps, of a mirrored node."""
    document = painted(glows)
    document.json["scenes"] = [{"nodes": [5]}]
    path = document.write(tmp_path / "box.gltf")
    still, moving = (load_mesh(path, corner_colours=True, animation=name) for name in (None, "bend"))
    assert len(still.faces) > 500 and len({one.emission for one in still.materials}) == (4 if glows else 1)
    np.testing.assert_array_equal(still.vertices[still.faces], moving.vertices[moving.faces])
    np.testing.assert_array_equal(still.face_materials, moving.face_materials)
    np.testing.assert_array_equal(still.source_faces, moving.source_faces)
    np.testing.assert_allclose(still.corner_normals, moving.corner_normals, atol=1e-9)
    assert still.materials == moving.materials
    assert [note for note in still.notes if "not played" not in note] == list(moving.notes)


def corners_of(mesh: Mesh, time: float) -> np.ndarray:
    """The corners of the faces at a time, float64 [m, 3, 3]."""
    assert mesh.clip is not None and mesh.clip_corners is not None
    pose = mesh.clip.pose(time)
    return mesh.clip.vertices(pose.matrices, pose.weights)[mesh.clip_corners]


@pytest.mark.parametrize(("node", "tolerance"), [(4, 0.07), (5, 1e-9), (6, 1e-9)])
def test_pieces_of_faces_move_with_them(tmp_path: Path, node: int, tolerance: float) -> None:
    """Pieces by nodes and morph targets stay on their face; a skin's bend between its corners."""
    document = painted()
    document.json["scenes"] = [{"nodes": [0, node]}]
    path = document.write(tmp_path / "cut.gltf")
    document.json["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    pieces, whole = (
        load_mesh(file, corner_colours=True, animation="bend")
        for file in (path, document.write(tmp_path / "whole.gltf"))
    )
    assert len(pieces.faces) > 5 * len(whole.faces)
    assert pieces.corner_uvs is not None and whole.corner_uvs is not None
    face_of = {int(source): face for face, source in enumerate(whole.source_faces)}
    owners = np.array([face_of[int(source)] for source in pieces.source_faces])
    textured = [(uvs != 0).any(axis=(1, 2)) for uvs in (pieces.corner_uvs, whole.corner_uvs[owners])]
    seen = np.flatnonzero(np.all(textured, axis=0))
    assert len(seen) > 300
    own, at = whole.corner_uvs[owners][seen], pieces.corner_uvs[seen]
    flat = np.stack([own[:, 1] - own[:, 0], own[:, 2] - own[:, 0]], axis=2)
    shares = np.linalg.solve(flat[:, None], (at - own[:, :1])[..., None])[..., 0]
    weights = np.concatenate([1 - shares.sum(axis=2, keepdims=True), shares], axis=2)
    for time in TIMES:
        found, faces = corners_of(pieces, time)[seen], corners_of(whole, time)[owners][seen]
        assert np.abs(found - weights @ faces).max() <= tolerance, time
    rest = pieces.vertices[pieces.faces]
    assert np.abs(corners_of(pieces, 0.4) - rest).max() > 0.2


def open_edges(corners: np.ndarray) -> int:
    """Edges of faces, float64 [m, 3, 3], that no other one has."""
    keys = [tuple(corner) for corner in corners.reshape(-1, 3).round(9).tolist()]
    edges = [
        frozenset((keys[3 * face + i], keys[3 * face + (i + 1) % 3])) for face in range(len(corners)) for i in range(3)
    ]
    return sum(edges.count(edge) == 1 for edge in set(edges))


def test_a_skin_that_glows_stays_whole(tmp_path: Path) -> None:
    """Bisected faces and their neighbours share vertices in all poses."""
    document = painted()
    document.json["scenes"] = [{"nodes": [0, 4]}]
    surface = document.json["materials"][0]
    for name in ("alphaMode", "normalTexture"):
        del surface[name]
    mesh = load_mesh(document.write(tmp_path / "glow.gltf"), animation="bend")
    assert len(mesh.faces) > 100 and mesh.clip is not None
    assert len(mesh.clip.positions) < len(mesh.faces)
    counts = {open_edges(corners_of(mesh, time)) for time in (0.0, 0.4, 0.62)}
    assert len(counts) == 1


def test_a_material_that_blends_covers_an_animated_mesh_in_part(tmp_path: Path) -> None:
    document = painted()
    for mesh in document.json["meshes"]:
        mesh["primitives"][0]["material"] = 1
    mesh = load_mesh(document.write(tmp_path / "glass.gltf"), animation="bend")
    assert [one.coverage for one in mesh.materials if one.albedo == (1.0, 1.0, 1.0)] == [0.4]


def library(names: tuple[str | None, ...], clip: str = "wave") -> Document:
    """A file without a mesh: nodes of these names, of which all but the first turn and move, and an animation."""
    nodes = [{"name": name} if name else {} for name in names]
    document = Document(nodes=nodes)
    turns = [[0, 0, 0, 1], [0.6, 0, 0, 0.8]]
    document.animate(
        clip,
        *((node, "rotation", "LINEAR", [0.0, 1.0], turns) for node in range(1, len(names))),
        *(
            (node, "translation", "LINEAR", [0.0, 0.5], [[0, 0, 0], [0, 0.1 * node, 0]])
            for node in range(1, len(names))
        ),
    )
    return document


def named() -> Document:
    """`arm` whose joints have names, and other nodes' names."""
    document = arm()
    for node, name in zip(document.json["nodes"], ("root", "hip", "knee", "foot", "leg", "hip", "jelly"), strict=True):
        node["name"] = name
    return document


def test_a_clip_of_another_file_moves_joints_by_their_names(tmp_path: Path) -> None:
    """All channels, also where the order of joints is another one; the same as in one file."""
    path = named().write(tmp_path / "arm.gltf")
    other = library(("Armature", "foot", "hip", "tail", None, "root")).write(tmp_path / "wave.gltf")
    mesh = load_mesh(path, animation=Animation("wave", other))
    document = named()
    turns = [[0, 0, 0, 1], [0.6, 0, 0, 0.8]]
    channels = []
    for node, place in ((3, 1), (1, 2), (0, 5)):
        channels.append((node, "rotation", "LINEAR", [0.0, 1.0], turns))
        channels.append((node, "translation", "LINEAR", [0.0, 0.5], [[0, 0, 0], [0, 0.1 * place, 0]]))
    document.animate("own", *channels)
    own = load_mesh(document.write(tmp_path / "own.gltf"), animation="own")
    for time in (0.0, 0.3, 0.7, 1.0):
        np.testing.assert_array_equal(corners_of(mesh, time), corners_of(own, time))
    assert not np.array_equal(corners_of(mesh, 0.0), corners_of(mesh, 0.7))
    notes = [note for note in mesh.notes if "joint" in note]
    assert len(notes) == 1 and "2 joints of the animation are missing in the mesh (the first is tail)" in notes[0]
    assert not any("joint" in note for note in own.notes)


def test_a_clip_that_has_no_joint_of_the_mesh_is_refused(tmp_path: Path) -> None:
    path = named().write(tmp_path / "arm.gltf")
    other = library(("Armature", "Hips", "Spine")).write(tmp_path / "dance.gltf")
    with pytest.raises(UserError) as caught:
        load_mesh(path, animation=Animation("wave", other))
    message = str(caught.value)
    assert message.startswith(f"mesh {path}: animation file {other}: its animation wave moves Hips, Spine, and no node")
    assert "of the mesh, which has hip, knee, foot, root, leg, jelly" in message
    assert "\n" not in message
    with pytest.raises(UserError, match=r"dance\.gltf: it has no animation run: it has 1 animation, wave"):
        load_mesh(path, animation=Animation("run", other))
    with pytest.raises(UserError, match=r"animation file .* does not exist"):
        load_mesh(path, animation=Animation("wave", tmp_path / "none.gltf"))
    with pytest.raises(UserError, match=r"has animations and no faces: give it as mesh\.animation_file of a mesh"):
        load_mesh(other)


def test_weights_of_other_morph_targets_are_not_played(tmp_path: Path) -> None:
    path = named().write(tmp_path / "arm.gltf")
    document = named()
    document.json["meshes"][2]["primitives"][0]["targets"].pop()
    document.json["animations"] = []
    document.animate(
        "a",
        (2, "rotation", "LINEAR", [0.0, 1.0], [[0, 0, 0, 1], [1, 0, 0, 0]]),
        (6, "weights", "LINEAR", [0.0, 1.0], [0.0, 1.0]),
    )
    mesh = load_mesh(path, animation=Animation("a", document.write(tmp_path / "other.gltf")))
    assert any("1 channel of an animation is not played" in note for note in mesh.notes)


def test_a_wrong_clip_is_told_the_name_that_was_meant(tmp_path: Path) -> None:
    document = arm()
    (own,) = document.json["animations"]
    names = [
        f"{kind}_{letter}"
        for kind in ("Walking", "Running", "Jumping", "2H_Melee_Attack")
        for letter in "ABCDEFGHIJKLMNOPQRS"
    ]
    document.json["animations"] = [own | {"name": name} for name in names]
    path = document.write(tmp_path / "many.gltf")
    for wrong, right in (("walking_a", "Walking_A"), ("Walkin_B", "Walking_B"), ("Jump", "Jumping_A")):
        with pytest.raises(UserError) as caught:
            load_mesh(path, animation=wrong)
        message = str(caught.value)
        assert f"it has no animation {wrong}: did you mean {right}? It has 76 animations, Walking_A, " in message
        listed = message.rpartition("animations, ")[2].rpartition(" and ")
        assert set(listed[0].split(", ")) <= set(names) and listed[2] == f"{76 - listed[0].count(', ') - 1} more"
        assert "\n" not in message and len(message) < 600
    with pytest.raises(UserError, match="it has no animation idle: it has 76 animations, Walking_A"):
        load_mesh(path, animation="idle")


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
