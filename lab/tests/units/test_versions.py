"""The Verilog of a folder or of a commit."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from colonnade.common.errors import UserError

from colonnade_lab.units import versions


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A repository of two commits, whose generator is a stand-in that copies a file."""
    root = tmp_path / "repository"
    root.mkdir()

    def git(*arguments: str) -> None:
        identity = ("-c", "user.name=a", "-c", "user.email=a@b")
        subprocess.run(["git", "-C", str(root), *identity, *arguments], check=True, capture_output=True)

    git("init", "-q")
    for text in ("first", "second"):
        (root / "Unit.sv").write_text(text)
        git("add", "Unit.sv")
        git("commit", "-qm", text)

    def generate(of: Path, checkout: Path, config: str, output: Path, log: Path) -> None:
        assert of == root
        output.mkdir()
        (output / "Unit.sv").write_text((checkout / "Unit.sv").read_text() + config)

    monkeypatch.setattr(versions, "project_root", lambda: root)
    monkeypatch.setattr(versions, "cache_directory", lambda _: tmp_path / "cache")
    monkeypatch.setattr(versions, "_generate", generate)
    return root


def test_a_commit_is_generated_once_in_a_checkout_that_goes_away(
    repository: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = versions.verilog_of("HEAD~1", {"array": 1})
    assert (folder / "Unit.sv").read_text() == 'first{"array": 1}'
    assert (versions.verilog_of("HEAD", {"array": 1}) / "Unit.sv").read_text() == 'second{"array": 1}'
    listed = subprocess.run(["git", "-C", str(repository), "worktree", "list"], capture_output=True, text=True)
    assert len(listed.stdout.splitlines()) == 1
    monkeypatch.setattr(versions, "_generate", None)
    assert versions.verilog_of("HEAD~1", {"array": 1}) == folder


def test_what_is_neither_folder_nor_commit_is_refused(repository: Path) -> None:
    assert versions.verilog_of(str(repository), {}) == repository
    with pytest.raises(UserError, match="nowhere is neither a folder nor a commit"):
        versions.verilog_of("nowhere", {})
