"""Mesh files state how many triangles they have: scenes of too many for the design are refused before they are read."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import gltf_documents
import pytest
from gltf_documents import READ

from colonnade.common.errors import UserError
from colonnade.design import toolchain
from colonnade.design.manifest import Manifest
from colonnade.mesh import load
from colonnade.mesh.files import formats
from colonnade.mesh.load import load_mesh, stated_triangles
from colonnade.scene.model import MeshSource, Scene
from colonnade.scene.prepared.device_scene import DeviceScene

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
PLY = (
    "ply\nformat ascii 1.0\ncomment x\nelement vertex 4\nproperty float x\nelement face {}\n"
    "property list uchar int vertex_indices\nend_header\n"
)
STL = (
    "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid x\n"
)
FILES: dict[str, tuple[bytes | str, int]] = {
    "a.ply": (PLY.format(5_000_000), 5_000_000),
    "b.ply": ("ply\nformat ascii 1.0\nelement vertex 4\n", 0),
    "a.off": ("OFF\n# of 9 9\n4 5000000 0\n", 5_000_000),
    "b.off": ("COFF4 5000000 0\n", 5_000_000),
    "a.stl": (b"\0" * 80 + struct.pack("<I", 3) + b"\0" * 150, 3),
    "b.stl": (STL * 3, 3),
    "a.obj": (SQUARE + "f 1 2 3\nf\t1 3 4\n# f 1\n", 2),
    "a.dae": ("", 0),
    "none.gltf": ("[", 0),
    **{name: (READ[name], count) for name, count in (("copies.gltf", 3), ("copies-100.gltf", 100), ("strip.gltf", 2))},
}


@pytest.mark.parametrize("name", FILES)
def test_triangles_are_stated(name: str, tmp_path: Path) -> None:
    content, count = FILES[name]
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    assert stated_triangles(tmp_path / name) == count


@pytest.mark.parametrize("name", [name for name in READ if name.endswith(("gltf", "glb"))])
def test_gltf_states_the_triangles_that_it_has(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(READ[name])
    assert stated_triangles(tmp_path / name) == load_mesh(tmp_path / name).source_count


def test_binary_gltf_is_not_read_beyond_its_document(tmp_path: Path) -> None:
    text = json.dumps(gltf_documents.gltf()).encode()
    head = struct.pack("<4sIII4s", b"glTF", 2, 1 << 30, len(text), b"JSON")
    (tmp_path / "a.glb").write_bytes(head + text)
    assert stated_triangles(tmp_path / "a.glb") == 1


def test_names_state_those_of_their_files_and_of_their_cuts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine.ply").write_text(PLY.format(7))
    monkeypatch.setenv("COLONNADE_MESHES", str(tmp_path))
    assert [stated_triangles(name) for name in ("mine", "mine:2", "teapot", "cube", "sphere:2000")] == [7, 112, 0, 0, 0]


@pytest.mark.parametrize("name", ["a.ply", "a.off"])
def test_a_mesh_of_too_many_triangles_is_refused_before_it_is_read(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / name).write_text(str(FILES[name][0]))
    manifest = Manifest.load(toolchain.project_root() / "configs" / "golden" / "edge.json")
    monkeypatch.setattr(formats, "read_input", None)
    monkeypatch.setattr(load, "read_surface", None)
    told = r"has at least 5,000,000 triangles, the 2,097,152 records of columnBvhMemory.depth hold 3,145,728 at most"
    with pytest.raises(UserError, match=f"mesh .*{name} {told}: raise columnBvhMemory.depth to 4194304, simplify"):
        DeviceScene.of(Scene(MeshSource(path=tmp_path / name)), manifest)
    with pytest.raises(UserError, match="NoneType"):
        DeviceScene.of(Scene(MeshSource(path=tmp_path / name, simplify=1000)), manifest)
