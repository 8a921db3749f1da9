"""The limit of the lines of each part, and who may raise it."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    (tmp_path / "tools").mkdir()
    (tmp_path / "soc").mkdir()
    for name in ("lines", "usage.py"):
        shutil.copy(ROOT / "tools" / name, tmp_path / "tools")
    git(tmp_path, "init", "-q")
    grown(tmp_path, 50)
    assert lines(tmp_path, "--set").returncode == 0
    commit(tmp_path, "Begin")
    return tmp_path


def git(folder: Path, *arguments: str) -> None:
    identity = ("-c", "user.name=a", "-c", "user.email=a@b")
    subprocess.run(["git", "-C", folder, *identity, *arguments], check=True, capture_output=True)


def commit(folder: Path, message: str) -> None:
    git(folder, "add", "-A")
    git(folder, "commit", "-qm", message)


def grown(folder: Path, count: int) -> None:
    """A part of so many lines, with a file of data, which does not count."""
    (folder / "soc" / "a.py").write_text("pass\n" * count)
    (folder / "soc" / "a.json").write_text("\n" * 1000)
    git(folder, "add", "-A")


def lines(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, folder / "tools" / "lines", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_a_part_grows_to_its_limit_and_no_further(repository: Path) -> None:
    assert json.loads((repository / "tools" / "lines.json").read_text())["soc"] == 100
    grown(repository, 100)
    assert lines(repository).returncode == 0
    grown(repository, 101)
    done = lines(repository)
    assert done.returncode == 1 and done.stderr.startswith("lines: soc has 1 lines more than tools/lines.json allows")


def test_long_lines_become_fewer_only(repository: Path) -> None:
    (repository / "soc" / "a.py").write_text(f"{'é' * 120}\n{'é' * 121}\n")
    done = lines(repository)
    assert done.returncode == 1
    said = "lines: 1 lines are longer than 120 columns, and tools/lines.json allows 0: break those of the change\n"
    assert done.stderr == said
    lines(repository, "--set")
    assert lines(repository).returncode == 0
    (repository / "soc" / "a.py").write_text("pass\n")
    assert "fewer than tools/lines.json allows" in lines(repository).stderr


def test_a_limit_falls_with_its_part(repository: Path) -> None:
    grown(repository, 350)
    lines(repository, "--set")
    grown(repository, 200)
    assert "lines: soc has 200 lines fewer" in lines(repository).stderr


@pytest.mark.parametrize(
    ("message", "status"), [("Grow", 1), ("Grow\n\nLines: a second device", 0)], ids=["no reason", "a reason"]
)
def test_a_commit_that_raises_a_limit_says_why(repository: Path, message: str, status: int) -> None:
    grown(repository, 150)
    lines(repository, "--set")
    commit(repository, message)
    done = lines(repository)
    assert done.returncode == status and ("that raises soc" in done.stderr) == bool(status)
