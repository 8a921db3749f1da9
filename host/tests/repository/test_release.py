"""What tools/release packs: archives that depend on their content alone, and all that a wheel needs."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
from click.testing import CliRunner

from colonnade.cli.main import cli
from colonnade.cli.options import SCENE
from colonnade.common.errors import UserError
from colonnade.design import toolchain
from colonnade.design.generator import manifest_for
from colonnade.scene.parser import load_scene
from colonnade.viewer import server

ROOT = Path(__file__).resolve().parents[3]
PRESETS = sorted(path.stem for path in (ROOT / "configs").glob("*.json"))


@pytest.fixture
def module(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], ModuleType]:
    monkeypatch.syspath_prepend(str(ROOT / "tools" / "distribution"))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    return lambda name: __import__(name)


LACKS = (
    "a commit of what git status lists, such as ?? bin/; python3.10 on PATH with its headers and ensurepip; "
    "python3.12 or python3.13 or python3.14 on PATH with its headers and ensurepip"
)
LACKS_OF_CHECK = (
    "root, for bare systems; the package qemu-user-static; the package binfmt-support; "
    "a mirror of Debian 12 (bookworm) in apt's sources"
)


@pytest.mark.parametrize(
    ("program", "line"),
    [
        ("release", f"a release needs: {LACKS}"),
        ("release-check", f"the check of a release needs: {LACKS_OF_CHECK}; {LACKS}"),
    ],
)
def test_all_that_a_release_lacks_is_one_line_before_its_work(program: str, line: str, tmp_path: Path) -> None:
    """In a checkout without the other programs of tools, and on a machine without most of what these would need."""
    for folder in ("tools", "bin"):
        (tmp_path / folder).mkdir()
    for name in ("programs.sh", program):
        shutil.copy(ROOT / "tools" / name, tmp_path / "tools")
    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    subprocess.run(["git", "add", "tools"], cwd=tmp_path, check=True)
    who = ("-c", "user.name=a", "-c", "user.email=a@b")
    subprocess.run(["git", *who, "commit", "-qm", "Tools"], cwd=tmp_path, check=True)
    for name in ("bash", "cut", "dirname", "env", "getent", "git", "head", "java", "realpath", "sed", "sort"):
        (tmp_path / "bin" / name).symlink_to(shutil.which(name) or "/bin/false")
    for name, text in (("id", "echo 1000"), ("mmdebstrap", ""), ("python3.10", "exit 1"), ("python3.11", "exit 0")):
        (tmp_path / "bin" / name).write_text(f"#!/bin/sh\n{text}\n")
        (tmp_path / "bin" / name).chmod(0o755)
    done = subprocess.run(
        [tmp_path / "tools" / program], env={"PATH": f"{tmp_path}/bin", "HOME": "/"}, capture_output=True, text=True
    )
    assert (done.returncode, done.stdout, done.stderr) == (2, "", f"colonnade: error: {line}\n")


def a_jar(file: Path) -> Path:
    with zipfile.ZipFile(file, "w") as jar:
        jar.writestr("colonnade/Generate.class", b"class")
        for platform in ("linux-x64", "macos-x64"):
            jar.writestr(f"org.chipsalliance/llvm-firtool/{platform}/bin/firtool", platform)
        jar.writestr("org.chipsalliance/llvm-firtool/project.version", "1.62.1")
    return file


def test_a_tar_depends_on_names_and_content_alone(module: Callable[[str], ModuleType], tmp_path: Path) -> None:
    for folder, names in (("a", "xy"), ("b", "yx")):
        (tmp_path / folder).mkdir()
        for name in names:
            (tmp_path / folder / name).write_text(name)
            os.utime(tmp_path / folder / name, (len(folder), ord(names[0])))
        module("archives").write_tar(tmp_path / folder, "inside", tmp_path / f"{folder}.tar.gz", time=86_400)
    assert (tmp_path / "a.tar.gz").read_bytes() == (tmp_path / "b.tar.gz").read_bytes()


@pytest.mark.parametrize(("platform", "kept"), [("linux-x64", ["linux-x64"]), ("linux-aarch64", [])])
def test_a_jar_keeps_the_firtool_of_its_platform(
    platform: str, kept: list[str], module: Callable[[str], ModuleType], tmp_path: Path
) -> None:
    module("archives").copy_jar(a_jar(tmp_path / "all.jar"), tmp_path / "one.jar", platform)
    names = zipfile.ZipFile(tmp_path / "one.jar").namelist()
    assert [name.split("/")[2] for name in names if name.endswith("/firtool")] == kept
    assert {"colonnade/Generate.class", "org.chipsalliance/llvm-firtool/project.version"} <= {*names}


@pytest.fixture
def data(module: Callable[[str], ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The data of a wheel, as it is installed."""
    wheels, folder = module("wheels"), tmp_path / "data"
    wheels.gather(folder, wheels.TARGETS[0], a_jar(tmp_path / "colonnade-generator.jar"))
    monkeypatch.delenv("COLONNADE_HOME", raising=False)
    monkeypatch.setattr(toolchain, "RELEASE", folder)
    return folder


def test_a_wheel_has_presets_scenes_and_tools(data: Path, tmp_path: Path) -> None:
    assert toolchain.project_root() == data
    assert {path.stem for path in (data / "configs").iterdir()} == {*PRESETS}
    assert {path.parent.name for path in (data / "manifests").glob("*/manifest.json")} == {*PRESETS}
    assert {path.name for path in (data / "scenes").glob("*.toml")} == {
        path.name for path in (ROOT / "scenes").glob("*.toml")
    }
    for path in (data / "scenes").glob("*.toml"):
        room = load_scene(path).background.room
        assert room is None or (path.parent / room / "meta.json").is_file()
    for needed in (".jvmopts", "LICENSE", "tools/verilated-object"):
        assert (data / needed).read_bytes() == (ROOT / needed).read_bytes()

    assert {name for name, _ in server.FILES.values()} == {path.name for path in (data / "site").iterdir()}


def test_a_wheel_has_the_package_its_data_and_three_modules(
    module: Callable[[str], ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The modules are empty here: compiling them takes minutes."""
    wheels, (work, output) = module("wheels"), (tmp_path / "work", tmp_path / "output")

    def compiled(target: object, python: str, toolchain: Path, folder: Path) -> Path:
        folder.mkdir()
        (folder / f"_core.{python}.so").touch()
        return folder / f"_core.{python}.so"

    monkeypatch.setattr(wheels, "_compile", compiled)
    output.mkdir()
    wheel = wheels.build(wheels.TARGETS[1], a_jar(tmp_path / "colonnade-generator.jar"), ["a", "b", "c"], work, output)
    assert re.fullmatch(r"colonnade-[\d.]+-cp310-abi3-manylinux_2_28_aarch64\.whl", wheel.name)
    names = {name for name in zipfile.ZipFile(wheel).namelist() if not name.endswith("/")}
    tracked = subprocess.check_output(["git", "ls-files", "colonnade"], cwd=ROOT / "host", text=True).splitlines()
    gathered = {
        f"colonnade/{path.relative_to(work / 'files')}" for path in (work / "files").rglob("*") if path.is_file()
    }
    assert {"colonnade/data/colonnade-generator.jar", "colonnade/data/configs/edge.json"} <= gathered
    assert {name for name in names if ".dist-info/" not in name} == {*tracked} | gathered
    assert {name.split("/", 1)[1] for name in names if ".dist-info/" in name} >= {"METADATA", "entry_points.txt"}


@pytest.mark.parametrize("preset", PRESETS)
def test_the_manifest_of_a_preset_needs_no_java(preset: str, data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    assert manifest_for(preset).manifest.config["array"]["rows"] >= 1


@pytest.mark.parametrize("preset", PRESETS)
def test_an_archive_has_the_designs_of_a_preset(
    preset: str, module: Callable[[str], ModuleType], tmp_path: Path
) -> None:
    """Of each its manifest: their Verilog takes minutes."""

    def run(command: str, *arguments: str) -> None:
        options = ["--manifest-only"] if command == "generate" else []
        done = CliRunner().invoke(cli, [command, *arguments, *options])
        assert done.exit_code == 0, done.output

    archive = tmp_path / "design.tar.gz"
    module("designs").write(preset, run, tmp_path, archive, time=0)
    with tarfile.open(archive) as tar:
        names = {name.removeprefix(f"colonnade-{preset}/") for name in tar.getnames()}
    assert {
        *("LICENSE", "device/manifest.json", "shell/manifest.json", "shell/shell.json", "registers/colonnade.rdl"),
        *("driver/include/colonnade.h", "driver/src/colonnade.c"),
    } <= names
    assert "device/shell.json" not in names
    shell = json.loads((tmp_path / preset / "shell" / "shell.json").read_text())
    assert shell["busBytes"] == (64 if preset == "traversal" else 16)


def test_a_scene_has_a_name(data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert SCENE.convert("room", None, None) == data / "scenes" / "room.toml"
    assert SCENE.convert("room.toml", None, None) == Path("room.toml")
    with pytest.raises(
        UserError, match=r"^no scene attic: name a TOML file, or a scene of .*data/scenes \(as-authored, "
    ):
        SCENE.convert("attic", None, None)
    (tmp_path / "room").write_text("")
    assert SCENE.convert("room", None, None) == Path("room")
