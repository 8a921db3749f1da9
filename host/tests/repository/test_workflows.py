"""Continuous integration runs only actions and containers that are named by their content, with few permissions."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.y*ml"))

_USES = re.compile(r"^\s*-?\s*uses:\s*(\S+)(.*)$", re.MULTILINE)
_CONTAINER = re.compile(r"^\s*(?:container|image):\s*(\S+)", re.MULTILINE)
_PERMISSION = re.compile(r"^ +([a-z-]+): write$", re.MULTILINE)


def unpinned(workflow: str) -> list[str]:
    """The actions that name no commit and version, and the containers that name no digest."""
    actions = [
        action
        for action, comment in _USES.findall(workflow)
        if not (re.fullmatch(r"[\w./-]+@[0-9a-f]{40}", action) and re.fullmatch(r" # v\d+\.\d+\.\d+", comment))
    ]
    containers = _CONTAINER.findall(workflow)
    return actions + [image for image in containers if not re.fullmatch(r"[\w./:-]+@sha256:[0-9a-f]{64}", image)]


@pytest.mark.parametrize("file", WORKFLOWS, ids=lambda file: file.name)
def test_actions_and_containers_are_pinned(file: Path) -> None:
    assert unpinned(file.read_text()) == []


def test_an_unpinned_action_is_found() -> None:
    commit, digest = "0" * 40, "0" * 64
    assert unpinned(f"  - uses: a/b@{commit} # v1.2.3\n    container: debian:x@sha256:{digest}\n") == []
    assert unpinned(f"  - uses: a/b@v4\n  - uses: a/c@{commit}\n    container: debian:12\n") == [
        "a/b@v4",
        f"a/c@{commit}",
        "debian:12",
    ]


@pytest.mark.parametrize("file", WORKFLOWS, ids=lambda file: file.name)
def test_jobs_read_the_repository_and_write_only_pages(file: Path) -> None:
    text = file.read_text()
    assert re.search(r"^permissions:\n  contents: read\n(?=\S|\n)", text, re.MULTILINE)
    assert set(_PERMISSION.findall(text)) <= {"pages", "id-token"}
    assert text.count("persist-credentials: false") == text.count("uses: actions/checkout@")


def test_the_image_is_of_the_base_of_continuous_integration() -> None:
    """Also, the development container is a stage of its Dockerfile."""
    dockerfile = (ROOT / "Dockerfile").read_text()
    bases = re.findall(r"^ARG BASE=docker\.io/library/(\S+)$", dockerfile, re.MULTILINE)
    assert set(bases) == {image for file in WORKFLOWS for image in _CONTAINER.findall(file.read_text())}
    development = json.loads((ROOT / ".devcontainer" / "devcontainer.json").read_text())
    assert f"FROM ${{BASE}} AS {development['build']['target']}\n" in dockerfile


@pytest.mark.parametrize("failing", ["", "tools/check", "tools/paper", "tools/reader-fuzz", "make"])
def test_a_failed_check_or_test_fails_continuous_integration(failing: str, tmp_path: Path) -> None:
    """The same script with programs that only say their names; GitHub's workflow also runs the checks of minutes."""
    shutil.copytree(ROOT / ".ci", tmp_path / ".ci")
    for folder in ("tools", ".cache"):
        (tmp_path / folder).mkdir()
    programs = (
        "tools/system-packages tools/test-packages tools/driver-fuzz tools/reader-fuzz tools/check tools/paper make"
    )
    for name in programs.split():
        (tmp_path / name).write_text(f'#!/bin/sh\necho "{name} $*"\nexit {int(name == failing)}\n')
        (tmp_path / name).chmod(0o755)
    path = f"{tmp_path}:/usr/bin:/bin"
    done = subprocess.run([tmp_path / ".ci" / "run"], env={"PATH": path}, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (int(bool(failing)), "")
    assert {"make test", "tools/paper --quick", "tools/check --quick"} <= set(done.stdout.splitlines())
    assert any("run: make check\n" in file.read_text() for file in WORKFLOWS)
