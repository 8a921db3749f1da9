"""A mesh file in place of a scene: it has the materials of its file, a camera frames it, and one line says so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

from colonnade.cli.main import cli
from colonnade.common.errors import UserError
from colonnade.design.toolchain import project_root
from colonnade.scene.parser import load_scene, room_folder
from colonnade.viewer.session import Session, ViewCamera

OBJ = "mtllib m.mtl\nusemtl red\nv 0 0 0\nv 9 0 0\nv 0 9 0\nv 0 0 9\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
ASCII_PLY = "ply\nformat ascii 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n"
FILES = {
    "own.obj": OBJ,
    "m.mtl": "newmtl red\nKd 0.9 0.05 0.05\n",
    "own.stl": "solid s\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1 0 0\n   vertex 0 1 0\n"
    "  endloop\n endfacet\nendsolid s\n",
    "own.ply": f"{ASCII_PLY.format(vertices=3)}element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
    "empty.ply": f"{ASCII_PLY.format(vertices=0)}end_header\n",
    "own.xyz": "0 0 0\n",
    "torn.glb": "torn",
}
CHARACTER = project_root() / "scenes" / "character.gltf"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def render(mesh: object, *more: object, config: str = "tiny") -> Result:
    common = ("--config", config, "--backend", "model", "--size", "48x36", "--output", "own.png")
    return CliRunner().invoke(cli, [str(word) for word in ("render", mesh, *common, *more)])


@pytest.mark.parametrize("name", ["own.obj", "own.stl", "own.ply"])
def test_a_mesh_is_framed_and_one_line_says_what_was_assumed(name: str) -> None:
    result = render(name)
    assert result.exit_code == 0, result.output
    notes = [line for line in result.stderr.splitlines() if "materials of its file" in line]
    assert len(notes) == 1 and notes[0].startswith(f"colonnade: note: {name} ") and "as-authored.toml" in notes[0]
    pixels = np.array(Image.open("own.png")).reshape(-1, 3)
    background = pixels[0]
    assert 0.05 < np.mean(np.any(pixels != background, axis=1)) < 0.8


def test_the_materials_are_those_of_the_file() -> None:
    render("own.obj")
    pixels = np.array(Image.open("own.png")).astype(int).reshape(-1, 3)
    assert np.any(pixels[:, 0] > 3 * pixels[:, 1])


def test_a_mesh_stands_in_a_room_of_the_project() -> None:
    scene = load_scene("own.obj", room_folder("living"))
    assert scene.background.room == project_root() / "scenes" / "rooms" / "living"
    assert not scene.names_light and "room" in scene.note
    assert room_folder("cellar") == Path("cellar")
    Path("living").mkdir()
    assert room_folder("living") == Path("living")
    result = render("own.obj", "--room", "cellar", config="small")
    assert result.exit_code == 2 and "there is no room cellar" in result.stderr


def test_an_animation_of_the_file_is_played() -> None:
    scene = load_scene(CHARACTER, animation="0")
    assert scene.has_animation and scene.motion.turn == 0.0
    result = render(CHARACTER, "--animation", "0", "--frames", "2")
    assert result.exit_code == 0 and result.stdout.startswith("model: 2 frames")
    with pytest.raises(UserError, match="an animation is of a single object"):
        load_scene(project_root() / "scenes" / "objects.toml", animation="0")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("own.xyz",), "own.xyz is neither a scene in TOML, nor a mesh, whose suffix is one of .ply, .obj"),
        (("none.glb",), "mesh file none.glb does not exist"),
        (("torn.glb",), "torn.glb cannot be read as a mesh"),
        (("empty.ply",), "mesh empty.ply has no faces"),
        ((CHARACTER, "--set", "columnBvhMemory.depth=64"), "columnBvhMemory.depth"),
        (("own.obj", "--animation", "0"), "animation"),
    ],
)
def test_what_is_no_mesh_is_refused_in_one_line(arguments: tuple[object, ...], message: str) -> None:
    result = render(*arguments)
    assert result.exit_code == 2 and result.stdout == ""
    assert result.stderr.count("\n") == 1 and message in result.stderr, result.stderr


def test_a_mesh_is_in_view_and_no_camera_is_written_into_it() -> None:
    before = Path("own.obj").read_bytes()
    session = Session(Path("own.obj"), "tiny", size=(24, 18))
    try:
        assert any("materials of its file" in line for line in session.state()["notes"])
        assert np.ptp(session.frame().pixels) > 0
        with pytest.raises(UserError, match=r"own\.obj is a mesh: a camera is saved into a scene file"):
            session.save(ViewCamera((0.0, 0.0, 30.0), (0.0, 0.0, 0.0)))
    finally:
        session.close()
    assert Path("own.obj").read_bytes() == before
