"""The command line: help, output files, and one clear line for each wrong input."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

from colonnade.cli.main import cli
from colonnade.common.frame_size import parse_size
from colonnade.design import toolchain

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
COMMANDS = ("generate", "pack", "inspect", "render", "compare", "study", "verify", "bench", "explore", "ppa")


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, [str(argument) for argument in arguments])


def refused(result: Result) -> str:
    """The error line of a command; fails if the command did not report exactly one error."""
    assert result.exit_code == 2, f"exit {result.exit_code}: {result.output} {result.exception!r}"
    lines = result.stderr.splitlines()
    assert len(lines) == 1, result.stderr
    assert lines[0].startswith("colonnade: error: ")
    return lines[0]


@pytest.fixture(scope="module")
def object_scene() -> Path:
    return toolchain.project_root() / "scenes" / "object.toml"


def render_mesh(scene: Path, mesh: object, folder: Path, *more: object) -> Result:
    common = ("--config", "tiny", "--backend", "model", "--size", "24x16", "--mesh", mesh)
    return run("render", scene, *common, "--output", folder / "f.png", *more)


def test_help_is_readable_and_names_every_command() -> None:
    result = run("--help")
    assert result.exit_code == 0
    for command in COMMANDS:
        assert command in result.stdout
        assert run(command, "--help").exit_code == 0
    assert run().stdout == result.stdout


def test_help_imports_nothing_heavy() -> None:
    heavy = "{'numpy', 'trimesh', 'skimage', 'scipy', 'matplotlib', 'PIL', 'embreex', 'rich'}"
    code = f"import sys, colonnade.cli; print(sorted({heavy} & set(sys.modules)))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()
    assert loaded == "[]"


def test_module_and_script_are_the_same_command() -> None:
    done = subprocess.run([sys.executable, "-m", "colonnade", "nonsense"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == "colonnade: error: No such command 'nonsense'; see colonnade --help\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("rendre",), "No such command"),
        (("sweep", "--vary", "array.rows=1,2"), "use colonnade explore"),
        (("render",), "Missing argument"),
        (("render", "s.toml", "--colour", "red"), "No such option"),
        (("render", "s.toml", "--backend", "gpu"), "gpu"),
        (("render", "--denoise", "odin", "s.toml"), "'odin' is not one of 'atrous', 'oidn'"),
        (("generate", "--config", "tiny"), "--output DIR or --print"),
        (("compare", "a.png"), "Missing argument"),
    ],
)
def test_wrong_usage_is_one_line_with_a_hint(arguments: tuple[str, ...], message: str) -> None:
    line = refused(run(*arguments))
    assert message in line
    assert line.endswith("--help")


@pytest.mark.parametrize("size", ["0x480", "640x0", "0x0"])
def test_empty_frames_are_refused(size: str) -> None:
    assert "no pixel" in refused(run("render", "s.toml", "--size", size))


@pytest.mark.parametrize("size", ["640", "640x", "x480", "-1x480", "640x480x3", "6e2x480", "640.5x480", "wide", ""])
def test_malformed_sizes_are_refused(size: str) -> None:
    assert "WIDTHxHEIGHT" in refused(run("render", "s.toml", "--size", size))


def test_sizes_are_read() -> None:
    assert parse_size("640x480") == (640, 480)
    assert parse_size("1X1") == (1, 1)


@pytest.mark.parametrize("size", ["100000x16", "16x100000"])
def test_frame_too_large_names_the_limit(object_scene: Path, size: str) -> None:
    line = refused(run("render", object_scene, "--config", "tiny", "--backend", "model", "--size", size))
    assert "frame.max" in line


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--backend", "model"), "the model backend has no signals"),
        (("--frames", 2), "a waveform shows one frame"),
        (("--size", "64x65"), "of at most 4,096 pixels"),
    ],
)
def test_waveform_of_anything_but_a_small_hardware_frame_is_refused(
    object_scene: Path, tmp_path: Path, arguments: tuple[object, ...], words: str
) -> None:
    size = () if "--size" in arguments else ("--size", "8x8")
    waveform = (*size, "--waveform", tmp_path / "w.vcd")
    assert words in refused(run("render", object_scene, "--config", "tiny", *waveform, *arguments))
    assert not (tmp_path / "w.vcd").exists()


@pytest.mark.parametrize("output", ["", "none/f.png"])
def test_output_that_cannot_be_written_is_refused_before_rendering(tmp_path: Path, output: str) -> None:
    refused(run("render", "s.toml", "--output", tmp_path / output))
    refused(run("compare", "a.png", "b.png", "--json", tmp_path / output))


def test_missing_scene_is_named(tmp_path: Path) -> None:
    assert "none.toml" in refused(run("render", tmp_path / "none.toml", "--config", "tiny", "--backend", "model"))


@pytest.mark.parametrize("options", [(), ("oidn",)], ids=["alone", "with its value"])
@pytest.mark.parametrize("scene", ["none.toml", "first-light"])
def test_denoise_before_the_scene_has_a_value_or_none(scene: str, options: tuple[str, ...]) -> None:
    line = refused(run("render", "--denoise", *options, scene, "--backend", "reference"))
    assert "none.toml" in line if scene == "none.toml" else "--denoise is for the rtl" in line


BAD_MESHES = {
    "empty.obj": b"",
    "points.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\n",
    "nan.obj": b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "infinite.obj": b"v inf 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "degenerate.obj": b"v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\nf 1 1 2\n",
    "onepoint.obj": b"v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n",
    "noise.ply": np.random.default_rng(1).bytes(2000),
    "noise.stl": np.random.default_rng(2).bytes(50),
    "noise.glb": np.random.default_rng(3).bytes(2000),
    "noise.obj": np.random.default_rng(4).bytes(2000),
    "noise.xyzzy": np.random.default_rng(5).bytes(2000),
}


@pytest.mark.parametrize("name", BAD_MESHES)
def test_bad_mesh_is_refused_and_nothing_is_written(object_scene: Path, tmp_path: Path, name: str) -> None:
    mesh = tmp_path / "in" / name
    mesh.parent.mkdir()
    mesh.write_bytes(BAD_MESHES[name])
    out = tmp_path / "out"
    out.mkdir()
    result = render_mesh(object_scene, mesh, out, "--json", out / "r.json", "--hits", out / "h.npz")
    assert name in refused(result)
    assert list(out.iterdir()) == []


@pytest.mark.parametrize("mesh", ["none.obj", "no-such-mesh"])
def test_missing_mesh_is_named(object_scene: Path, tmp_path: Path, mesh: str) -> None:
    assert mesh in refused(render_mesh(object_scene, mesh, tmp_path))


def test_mesh_too_large_names_the_setting(object_scene: Path, tmp_path: Path) -> None:
    result = render_mesh(object_scene, "sphere:4", tmp_path, "--set", "columnBvhMemory.depth=64")
    line = refused(result)
    assert "columnBvhMemory.depth" in line
    assert "64" in line


def test_a_mesh_is_simplified_by_the_option_or_the_scene(object_scene: Path, tmp_path: Path) -> None:
    scene, report = tmp_path / "scene.toml", tmp_path / "r.json"
    scene.write_text(object_scene.read_text().replace('name = "teapot"', 'name = "teapot"\nsimplify = 500'))
    packed = ("--config", "tiny", "--strict", "--output", tmp_path / "packed", "--json", report)
    for options, after in (((), 500), (("--simplify", 200), 200), (("--mesh", "torus"), 500)):
        result = run("pack", scene, *packed, *options)
        name, before = ("torus", "2,304") if "torus" in options else ("teapot", "6,320")
        assert result.exit_code == 0, result.output
        count = json.loads(report.read_text())["mesh"]["triangles"]
        assert 0.9 * after < count <= after
        assert f"mesh {name}: {before} triangles are simplified to {count}\n" in result.stderr
    result = render_mesh(object_scene, "torus", tmp_path, "--simplify", 100)
    assert result.exit_code == 0 and "2,304 triangles are simplified to 100" in result.stderr
    assert "--simplify" in refused(run("pack", object_scene.parent / "objects.toml", *packed, "--simplify", 100))


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("array.rwos=2", "array.rwos"),
        ("nonsense=1", "nonsense"),
        ("precision=8b32s64d", "8"),
        ("precision.mac=8", "precision.mac"),
        ("precision.div=65", "precision.div"),
        ("precision=32b65s64d", "65"),
        ("array.rows=0", "array.rows"),
        ("array.rows=many", "array.rows"),
        ("array.contexts=17", "array.contexts"),
        ("array.rows", "key.path=value"),
    ],
)
def test_bad_configuration_is_refused(tmp_path: Path, override: str, words: str) -> None:
    output = tmp_path / "design"
    arguments = ("generate", "--config", "tiny", "--manifest-only", "--output", output)
    assert words in refused(run(*arguments, "--set", override))
    assert not output.exists()


def test_unknown_key_in_a_file_and_broken_json_are_refused(tmp_path: Path) -> None:
    preset = json.loads((toolchain.project_root() / "configs" / "tiny.json").read_text())
    preset["array"]["rwos"] = 2
    unknown = tmp_path / "unknown.json"
    unknown.write_text(json.dumps(preset))
    broken = tmp_path / "broken.json"
    broken.write_text('{"array": ')
    assert "rwos" in refused(run("generate", "--config", unknown, "--manifest-only", "--print"))
    refused(run("generate", "--config", broken, "--manifest-only", "--print"))


def test_generate_writes_a_manifest(tmp_path: Path) -> None:
    output, report = tmp_path / "design", tmp_path / "r.json"
    result = run("generate", "--config", "tiny", "--manifest-only", "--output", output, "--json", report)
    assert result.exit_code == 0, result.output
    manifest = json.loads((output / "manifest.json").read_text())
    assert json.loads(report.read_text())["config_hash"] == manifest["configHash"]


def test_pack_and_inspect_a_scene_image(object_scene: Path, tmp_path: Path) -> None:
    packed, report = tmp_path / "packed", tmp_path / "r.json"
    result = run("pack", object_scene, "--config", "tiny", "--mesh", "cube", "--output", packed, "--json", report)
    assert result.exit_code == 0, result.output
    assert json.loads(report.read_text())["mesh"]["triangles"] == 12
    assert run("inspect", packed, "--config", "tiny").exit_code == 0
    other = run("inspect", packed, "--config", "tiny", "--set", "geometry.boxBits=6")
    assert "another" in refused(other) or "format" in refused(other)

    (image,) = packed.glob("*.image")
    good = image.read_bytes()
    image.write_bytes(good[: len(good) // 2])
    assert "truncated" in refused(run("inspect", packed))
    image.write_bytes(good[:-40] + bytes([good[-40] ^ 1]) + good[-39:])
    assert "corrupt" in refused(run("inspect", packed))
    image.write_bytes(b"")
    refused(run("inspect", packed))
    assert "none" in refused(run("inspect", tmp_path / "none"))


def test_no_verilator_is_one_line(object_scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    result = run("render", object_scene, "--config", "tiny", "--mesh", "cube", "--size", "8x8", "--backend", "rtl")
    line = refused(result)
    assert "apt-get install" in line


def test_model_renders_a_frame_with_all_its_files(object_scene: Path, tmp_path: Path) -> None:
    files = ("--hits", tmp_path / "h.npz", "--json", tmp_path / "r.json")
    result = render_mesh(object_scene, "sphere:2", tmp_path, *files)
    assert result.exit_code == 0, result.output
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["backend"] == "model"
    assert report["rays"]["primary"] == 24 * 16
    with Image.open(tmp_path / "f.png") as picture:
        assert picture.size == (24, 16)
        assert len(np.unique(np.asarray(picture.convert("RGB")).reshape(-1, 3), axis=0)) > 4
    with np.load(tmp_path / "h.npz") as hits:
        assert hits["triangle"].shape == hits["t"].shape == (16, 24)
        assert 0.1 < np.mean(hits["triangle"] >= 0) < 0.9


def test_single_triangle_renders(object_scene: Path, tmp_path: Path) -> None:
    mesh = tmp_path / "one.obj"
    mesh.write_text(TRIANGLE)
    assert render_mesh(object_scene, mesh, tmp_path).exit_code == 0


def test_camera_inside_the_object_sees_nothing_else(tmp_path: Path) -> None:
    scene = tmp_path / "inside.toml"
    scene.write_text('[mesh]\nname = "sphere:2"\n[camera]\nposition = [0.1, 0.0, 0.05]\ntarget = [1.0, 0.2, 0.3]\n')
    common = ("--config", "tiny", "--backend", "model", "--size", "16x16", "--hits", tmp_path / "h.npz")
    result = run("render", scene, *common)
    assert result.exit_code == 0, result.output
    with np.load(tmp_path / "h.npz") as hits:
        assert (hits["triangle"] >= 0).all()
