"""What tools/release packs: archives that depend on their content alone, and all that a wheel needs."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from colonnade.cli.options import SCENE
from colonnade.common.errors import UserError
from colonnade.design import toolchain
from colonnade.scene.parser import load_scene

ROOT = Path(__file__).resolve().parents[3]


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
    presets = {path.stem for path in (ROOT / "configs").glob("*.json")}
    assert {path.stem for path in (data / "configs").iterdir()} == presets
    assert {path.parent.name for path in (data / "manifests").glob("*/manifest.json")} == presets
    assert {path.name for path in (data / "scenes").glob("*.toml")} == {
        path.name for path in (ROOT / "scenes").glob("*.toml")
    }
    for path in (data / "scenes").glob("*.toml"):
        room = load_scene(path).background.room
        assert room is None or (path.parent / room / "meta.json").is_file()
    for needed in (".jvmopts", "LICENSE", "tools/verilated-object"):
        assert (data / needed).read_bytes() == (ROOT / needed).read_bytes()


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
