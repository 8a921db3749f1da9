"""Loading meshes: cleaned geometry, and one line for bad files."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
from gltf_documents import POINTS, READ
from gltf_documents import _arrays as with_arrays

from colonnade.common import published
from colonnade.common.errors import UserError
from colonnade.mesh.files import catalog, gltf
from colonnade.mesh.files.gltf_document import GltfDocument
from colonnade.mesh.geometry.topology import subdivide
from colonnade.mesh.load import clean_mesh, load_mesh

#: An ASCII file whose rows of faces have a value that its header does not state.
PLY = (
    b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n%s\nend_header\n"
    b"0 0 0 9\n1 0 0 9\n0 1 0 9\n3 0 1 2 0.5\n3 0 1 2 0.5\n"
)
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def test_vertices_merge_by_position_and_bad_faces_are_removed() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0], [2, 0, 0], [9, 9, 9], [-0.0, 0, 0]])
    faces = np.array([[0, 1, 4], [0, 1, 2], [3, 0, 1], [2, 3, 0], [2, 1, 6]], dtype=np.int32)
    mesh = clean_mesh(vertices, faces, "test")
    # No area, valid, duplicate, two coincident vertices, the back of the second face.
    assert mesh.source_faces.tolist() == [1]
    assert mesh.source_count == 5
    assert len(mesh.vertices) == 3


def test_copies_of_a_mesh_have_a_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.gltf").write_bytes(READ["copies.gltf"])
    assert len(load_mesh(tmp_path / "a.gltf").faces) == 3
    monkeypatch.setattr(gltf, "MAX_TRIANGLES", 2)
    with pytest.raises(UserError, match="it has more than 2 triangles: leave some out"):
        load_mesh(tmp_path / "a.gltf")


def test_copies_of_a_mesh_are_those_of_nodes_and_its_arrays_are_read_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    turned, moved = np.float32([[0, 0, 0.6, 0.8], [0.6, 0, 0, 0.8]]), np.float32([[1, 2, 3], [4, 5, 6]])
    scales = np.float32([[1, 2, 3], [-1, 1, 1]])
    names = {"ROTATION": turned, "TRANSLATION": moved, "SCALE": scales}
    normals = {"POSITION": POINTS, "NORMAL": np.float32([[0, 0.6, 0.8]] * 3)}
    document = json.loads(with_arrays(normals))
    nodes = [{"mesh": 0} | {name.lower(): array[k].tolist() for name, array in names.items()} for k in (0, 1)]
    (tmp_path / "nodes.gltf").write_text(json.dumps(document | {"nodes": nodes, "scenes": [{"nodes": [0, 1]}]}))
    attributes = {"POSITION": POINTS, "NORMAL": normals["NORMAL"]}
    copied = json.loads(with_arrays(attributes | names))
    primitive = copied["meshes"][0]["primitives"][0]["attributes"]
    given = {name: primitive.pop(name) for name in names}
    copied["nodes"] = [{"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": given}}}]
    (tmp_path / "copies.gltf").write_text(json.dumps(copied))
    read: list[object] = []
    array = GltfDocument.array
    monkeypatch.setattr(GltfDocument, "array", lambda self, index: (read.append(index), array(self, index))[1])
    own, others = load_mesh(tmp_path / "copies.gltf"), load_mesh(tmp_path / "nodes.gltf")
    np.testing.assert_allclose(own.vertices[own.faces], others.vertices[others.faces], rtol=1e-6)
    np.testing.assert_allclose(own.corner_normals, others.corner_normals, atol=1e-6)
    read.clear()
    (tmp_path / "a.gltf").write_bytes(READ["copies-100.gltf"])
    load_mesh(tmp_path / "a.gltf")
    assert len(read) == 2  # positions and indices, of which all copies are made


def test_normals_are_weighted_by_angle() -> None:
    """A smooth cube's corner normals are its diagonals for any triangulation of its faces."""
    mesh = load_mesh("cube", crease=90.0)
    np.testing.assert_allclose(mesh.corner_normals, mesh.vertices[mesh.faces] / np.sqrt(3), atol=1e-12)


@pytest.mark.parametrize(
    ("name", "triangles"),
    [
        ("cube", 12),
        ("tetrahedron", 4),
        ("octahedron", 8),
        ("triangle", 1),
        ("square", 2),
        ("cylinder:7", 28),
        ("cone:9", 18),
        ("torus:12", 144),
        ("sphere:2", 320),
        ("sphere:1000", 980),
        ("sphere", 5120),
        ("rock:1000", 980),
    ],
)
def test_solids(name: str, triangles: int) -> None:
    mesh = load_mesh(name)
    assert (len(mesh.faces), mesh.name) == (triangles, name)
    assert np.abs(mesh.vertices).max() <= 1.0
    if name not in ("triangle", "square"):
        corners = mesh.vertices[mesh.faces]
        volume = np.einsum("mx,mx->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
        edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        assert volume > 0 and (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()


def test_a_rock_is_rough() -> None:
    """Faces lie askew to the sphere's, those beside each other to different sides."""
    first, second = load_mesh("rock:20000"), load_mesh("rock:20000")
    np.testing.assert_array_equal(first.vertices, second.vertices)
    corners = first.vertices[first.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    assert np.mean((normals[1:] * normals[:-1]).sum(axis=1)) < 0.9


def test_midpoints_keep_the_surface() -> None:
    vertices, faces = subdivide(
        np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [4, 4, 0]]), np.array([[0, 1, 2], [1, 3, 2]])
    )
    assert (len(vertices), len(faces)) == (9, 8)
    corners = vertices[faces]
    np.testing.assert_allclose(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), [[0, 0, 4]] * 8)


@pytest.mark.parametrize(
    ("file", "content", "message"),
    [
        ("empty.obj", b"", "is empty"),
        ("noise.obj", bytes(range(128, 256)) * 9, "no faces|cannot be read"),
        ("noise.ply", bytes(range(256)) * 9, "cannot be read"),
        ("noise.stl", bytes(range(256)) * 9, "truncated: its header states"),
        ("noise.glb", bytes(range(256)) * 9, "cannot be read"),
        ("noise.off", bytes(range(256)) * 9, "cannot be read"),
        ("nan.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "vertex 1 is not a finite number"),
        ("inf.obj", b"v 0 0 0\nv inf 0 0\nv 0 1 0\nf 1 2 3\n", "vertex 2 is not a finite number"),
        ("line.obj", b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "only degenerate triangles"),
        ("point.obj", b"v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n", "only degenerate triangles"),
        ("points.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no faces"),
        ("index.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "cannot be read|but the file has"),
        ("huge.obj", b"v 0 0 0\nv 1e200 0 0\nv 0 1 0\nf 1 2 3\n", "scale it down"),
        ("picture.png", b"x", "suffix of a mesh file"),
        ("lfs.glb", b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "is a pointer of Git LFS"),
        ("old.glb", b"glTF" + struct.pack("<4I", 1, 24, 4, 0) + b"{}  ", "glTF of version 1: export it as glTF 2.0"),
        ("old.gltf", b'{"nodes": {"a": {}}}', "glTF of version 1: export it as glTF 2.0"),
        ("named.gltf", b'{"asset": {"version": "1.1"}}', "glTF of version 1: export it as glTF 2.0"),
        ("empty.stl", b"solid a\nendsolid a\n", "no faces: its solids hold no facets"),
        (
            "cloud.ply",
            PLY % b"property float w\nelement face 0\nproperty list uchar int vertex_indices",
            "no faces: 10 values",
        ),
        ("few.ply", PLY % b"element face 3\nproperty list uchar int vertex_indices", "truncated|than the header"),
    ],
)
def test_bad_files_are_refused_in_one_line(tmp_path: Path, file: str, content: bytes, message: str) -> None:
    path = tmp_path / file
    path.write_bytes(content)
    with pytest.raises(UserError, match=message) as caught:
        load_mesh(path)
    assert "\n" not in str(caught.value) and file in str(caught.value)


def test_a_missing_mesh_is_rejected(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("COLONNADE_MESHES", raising=False)
    for name, message in (
        (str(tmp_path / "no.obj"), "does not exist"),
        (str(tmp_path), "is a folder"),
        ("nothing", "no mesh nothing: name a file"),
        ("sphere:many", "must be from 0"),
        ("teapot:0", "must be from 1"),
        ("nothing:2", "no mesh nothing: name a file"),
    ):
        with pytest.raises(UserError, match=message):
            load_mesh(name)


def test_the_meshes_of_the_figures_are_fetched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each has an address and a digest; a file of another content is refused before it is read."""
    monkeypatch.delenv("COLONNADE_MESHES", raising=False)
    monkeypatch.setenv("COLONNADE_DOWNLOADS", str(tmp_path))
    assert catalog.KNOWN.keys() == published.MESHES.keys()
    for name, download in published.MESHES.items():
        (tmp_path / download.name).write_text(TRIANGLE)
        with pytest.raises(
            UserError, match=rf"{download.name}, from COLONNADE_DOWNLOADS, is another file than the mesh"
        ):
            load_mesh(name)


def test_names_are_found_in_the_users_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    second.mkdir()
    (second / "fandisk.obj").write_text(TRIANGLE)
    (second / "duck.obj").write_text(TRIANGLE)
    (second / "mine.obj").write_text(TRIANGLE)
    monkeypatch.setenv("COLONNADE_MESHES", f"{first}:{second}")
    assert len(load_mesh("fandisk").faces) == 1
    assert len(load_mesh("mine").faces) == 1
    duck = load_mesh("duck")
    assert (len(duck.faces), duck.name) == (16, "duck")
    cut = load_mesh("mine:2")
    assert (len(cut.faces), cut.name) == (16, "mine:2")
    with pytest.raises(UserError, match=r"mesh mine:6: the number after the colon must be from 0 to 5$"):
        load_mesh("mine:6")


def test_the_extents_outline_spans_the_box() -> None:
    extent = load_mesh("teapot").extent
    np.testing.assert_array_equal(extent.outline.min(axis=0), extent.low)
    assert extent.edge == pytest.approx(6.434, abs=5e-3)
    assert len(extent.outline) < 400
