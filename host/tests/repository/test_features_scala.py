"""The guard that few files of the hardware read a feature."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from colonnade.design.toolchain import project_root


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """A folder with the configuration of the hardware alone."""
    shutil.copytree(project_root() / "src/main/scala/colonnade/config", tmp_path / "config")
    return tmp_path


def features(source: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [project_root() / "tools/features-scala", source], capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize(
    ("key", "read"),
    [
        ("frame.materials", "config.frame.materials"),
        ("geometry.triangleBits", "config.geometry.triangleBits.get"),
        ("frame.maxBounces", "config.frame.hasBounces"),
        ("columnBvhMemory.cache.lines", "cache.lines"),
        ("frame.gather", "config.gathersInRoom"),
    ],
)
def test_ten_files_may_read_a_key_of_any_type(source: Path, key: str, read: str) -> None:
    for number in range(10):
        (source / f"Unit{number}.scala").write_text(f"// config.frame.hits\nobject Unit{number} {{ {read} }}\n")
    found = features(source)
    assert found.returncode == 0 and found.stderr == ""
    assert f"{key}: 10 reads in 10 files\n" in found.stdout and "frame.hits: 0 reads in 0 files\n" in found.stdout
    (source / "Last.scala").write_text(f"object Last {{ {read} }}\n")
    found = features(source)
    assert found.returncode == 1
    assert f"{key} is read in 11 files, more than 10: Last.scala Unit0.scala" in found.stderr
