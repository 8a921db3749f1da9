"""Notes of meshes on the command line: lines on standard error, and ``--strict``."""

from __future__ import annotations

import shlex
from pathlib import Path

import hostile
import pytest
from click.testing import CliRunner, Result

from colonnade.cli.main import cli

OBJ = "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nv 1 1 0 0 1 0\nf 1 2 3\nf 2 4 3\nl 1 4\n"
LINE = "colonnade: note: mesh x.obj: 1 line primitive is not shown: only faces are rendered"
COLOURS = "colonnade: note: mesh x.obj: 2 colours of vertices or faces are the albedo of their faces"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a scene and a mesh."""
    (tmp_path / "s.toml").write_text(hostile.SCENE)
    (tmp_path / "x.obj").write_text(OBJ)
    return tmp_path


def invoked(folder: Path, arguments: str) -> Result:
    with hostile.inside(folder):
        return CliRunner().invoke(cli, shlex.split(arguments))


@pytest.mark.parametrize(
    "command", [hostile.RENDER, f"{hostile.RENDER_BY} reference", "pack s.toml --output p --config tiny"]
)
def test_a_note_is_a_line_and_with_strict_an_error(folder: Path, command: str) -> None:
    noted = invoked(folder, f"{command} --mesh x.obj")
    assert noted.exit_code == 0, noted.output
    lines = noted.stderr.splitlines()
    assert lines[0] == LINE and lines[1].startswith(COLOURS) and len(lines) == 2
    strict = invoked(folder, f"{command} --mesh x.obj --strict")
    assert strict.exit_code == 2 and "only faces are rendered; mesh x.obj: 2 colours" in strict.stderr
    assert invoked(folder, f"{command} --mesh cube --strict").exit_code == 0


def test_colours_beyond_the_material_table_are_merged_and_noted(folder: Path) -> None:
    for backend in ("model", "reference"):
        noted = invoked(folder, f"{hostile.RENDER_BY} {backend} --mesh x.obj --set frame.materials=1")
        assert noted.exit_code == 0, noted.output
        assert "2 materials become 1, their colours off by" in noted.stderr and "frame.materials is 1" in noted.stderr


@pytest.mark.parametrize("backend", ["model", "reference"])
def test_hardware_with_corner_colours_keeps_them_all(folder: Path, backend: str) -> None:
    command = f"{hostile.RENDER_BY} {backend} --mesh x.obj"
    noted = invoked(folder, f"{command} --set geometry.cornerColours=true --set frame.materials=1")
    assert noted.exit_code == 0, noted.output
    assert noted.stderr.splitlines() == [LINE]


def test_an_albedo_of_the_scene_replaces_all_colours(folder: Path) -> None:
    (folder / "s.toml").write_text(f"{hostile.SCENE}[material]\nalbedo = [0.5, 0.5, 0.5]\n")
    noted = invoked(folder, f"{hostile.RENDER} --mesh x.obj --set frame.materials=1")
    assert noted.exit_code == 0 and "become" not in noted.stderr, noted.output


def test_an_object_that_no_pixel_shows_is_noted(folder: Path) -> None:
    (folder / "s.toml").write_text(f"{hostile.SCENE}[camera]\nposition = [0.0, 0.0, 9.0]\ntarget = [0.0, 0.0, 18.0]\n")
    noted = invoked(folder, f"{hostile.RENDER} --mesh cube")
    assert noted.exit_code == 0 and "a frame has no pixel of the object" in noted.stderr, noted.output
