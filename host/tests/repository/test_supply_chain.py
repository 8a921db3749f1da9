"""Supply chain: locks are up to date, altered packages are rejected, and old programs are reported in one line."""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
import sys
import venv
import zipfile
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from colonnade.common.errors import UserError
from colonnade.device import compiler

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def module(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], ModuleType]:
    monkeypatch.syspath_prepend(str(ROOT / "tools" / "supply_chain"))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    return lambda name: __import__(name)


def bash(script: str, *folders: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([*map(str, folders), os.environ["PATH"]])
    command = ["bash", "-euc", f". {ROOT}/tools/programs.sh; {script}"]
    environment = {**os.environ, "PATH": path, **variables}
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def program(folder: Path, name: str, says: str) -> None:
    file = folder / name
    file.write_text(f"#!/bin/sh\necho '{says}'\n")
    file.chmod(0o755)


def test_locks_are_up_to_date(module: Callable[[str], ModuleType]) -> None:
    assert module("python_locks").check() == []


def test_a_lock_older_than_pyproject_is_named(
    module: Callable[[str], ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    locks = module("python_locks")
    newer = tmp_path / "pyproject.toml"
    newer.write_text(locks.PROJECT.read_text().replace('"click>=8.1,<9"', '"click>=8.1,<10"'))
    monkeypatch.setattr(locks, "PROJECT", newer)
    assert locks.check() == [
        f"host/locks/{name}.txt is older than the dependencies in pyproject.toml; run: tools/lock"
        for name in ("render", "host")
    ]


def test_the_bill_of_materials_has_all_locks(module: Callable[[str], ModuleType]) -> None:
    parts = {part["purl"]: part for part in module("sbom").document()["components"]}
    locked = [
        pin
        for lock in module("python_locks").wanted_locks()
        for pin in module("python_locks").read(lock.path.read_text())
    ]
    for pin in locked:
        hashes = {one["content"] for one in parts[f"pkg:pypi/{pin.name}@{pin.version}"]["hashes"]}
        assert set(pin.hashes) <= hashes
    assert any(name.startswith("pkg:maven/org.chipsalliance/") for name in parts)
    assert any(name.startswith("pkg:npm/%40biomejs/biome@") for name in parts)
    assert parts["pkg:deb/debian/verilator"]["properties"][0]["value"] == "5.006"
    installed = next(name for name in parts if name.startswith("pkg:pypi/click@"))
    assert parts[installed]["licenses"] == [{"expression": "BSD-3-Clause"}]


@pytest.mark.parametrize(
    "file", ["project/dependencies.sha256", "tools/lint/package-lock.json", *(ROOT / "host/locks").glob("*.txt")]
)
def test_locks_contain_no_urls(file: str | Path) -> None:
    assert not re.search('(?<!"url": "https)://', (ROOT / file).read_text())


@pytest.mark.parametrize("installer", ["uv", pytest.param("pip", marks=pytest.mark.matrix)])
@pytest.mark.parametrize("altered", [False, True])
def test_only_the_locked_file_is_installed(tmp_path: Path, altered: bool, installer: str) -> None:
    wheel = tmp_path / "tiny-1.0-py3-none-any.whl"

    def write(source: str) -> None:
        with zipfile.ZipFile(wheel, "w") as archive:
            information = "tiny-1.0.dist-info"
            archive.writestr("tiny.py", source)
            archive.writestr(f"{information}/METADATA", "Metadata-Version: 2.1\nName: tiny\nVersion: 1.0\n")
            archive.writestr(f"{information}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
            archive.writestr(f"{information}/RECORD", "")

    write("")
    locked = hashlib.sha256(wheel.read_bytes()).hexdigest()
    if altered:
        write("import os")
    locks = tmp_path / "host" / "locks"
    locks.mkdir(parents=True)
    (locks / "tiny.txt").write_text(f"tiny==1.0 --hash=sha256:{locked}\n")
    venv.create(tmp_path / "environment", with_pip=installer == "pip")
    where = {"PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(tmp_path), "UV_CACHE_DIR": str(tmp_path / "cache")}
    script = "uv=none; " * (installer == "pip") + f"root='{tmp_path}'; install_locked '{tmp_path}/environment' tiny"
    done = bash(script, **where)
    site = next((tmp_path / "environment").glob("lib/python*/site-packages"))
    assert (site / "tiny.py").is_file() is not altered
    if altered:
        assert done.returncode == 2
        assert done.stderr.count("\n") == 1
        assert done.stderr.startswith("colonnade: error: the SHA-256 of tiny==1.0 is not in host/locks/tiny.txt")
    else:
        assert (done.returncode, done.stderr) == (0, "")


def test_uv_gets_the_index_and_the_certificates_of_pips_settings(tmp_path: Path) -> None:
    """Else it fails behind a mirror or a proxy, and pip, which is slow, installs all packages."""
    (tmp_path / "pip.conf").write_text("[global]\ncert = /etc/some.pem\nindex-url = https://mirror.invalid/simple\n")
    done = bash(
        "pip_setting cert; pip_setting index-url; pip_setting proxy", PIP_CONFIG_FILE=str(tmp_path / "pip.conf")
    )
    assert (done.returncode, done.stdout) == (0, "/etc/some.pem\nhttps://mirror.invalid/simple\n")


@pytest.mark.parametrize(
    ("name", "says", "line"),
    [
        ("verilator", "Verilator 4.038 2020-07-11 rev v4.036", "Verilator 4.038 is too old, 5.006 or newer"),
        ("g++", "9.4.0", "g++ 9.4.0 is too old, 10 or newer"),
        ("make", "GNU Make 3.81", "GNU Make 3.81 is too old, 4.0 or newer"),
    ],
)
def test_setup_names_a_program_that_is_too_old(tmp_path: Path, name: str, says: str, line: str) -> None:
    program(tmp_path, name, says)
    done = bash(f"exec {ROOT}/tools/system-packages", tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(f"colonnade: error: {line}") and done.stderr.count("\n") == 1


@pytest.mark.parametrize(("version", "fits"), [("5.006", True), ("5.048", True), ("5.005", False), ("4.228", False)])
def test_host_and_setup_agree_on_the_oldest_verilator(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, version: str, fits: bool
) -> None:
    program(tmp_path, "verilator", f"Verilator {version} 2023-01-22 rev x")
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    assert (bash("too_old", tmp_path).stdout == "") is fits
    if fits:
        assert compiler.require_verilator("rendering")[0] == tmp_path / "verilator"
    else:
        with pytest.raises(UserError, match=f"Verilator {version} .*: rendering needs Verilator 5.006 or newer"):
            compiler.require_verilator("rendering")
