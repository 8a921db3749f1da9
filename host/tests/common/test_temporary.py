"""Temporary folders are removed after use; the next use removes killed processes' folders."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from colonnade.common import temporary
from colonnade.common.errors import UserError
from colonnade.common.temporary import remove_abandoned, replace, temporary_folder

HOLDER = """
import sys, time
from pathlib import Path
from colonnade.common.temporary import temporary_folder
with temporary_folder(".entry.", Path(sys.argv[1])) as place:
    (place / "inner").mkdir()
    (place / "inner" / "file").write_text("something")
    print("ready", flush=True)
    time.sleep(100_000)
"""


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_is_gone_after_use(tmp_path: Path) -> None:
    with temporary_folder(".entry.", tmp_path) as place:
        (place / "file").write_text("something")
        assert len(names(tmp_path)) == 1
    assert names(tmp_path) == set()
    with pytest.raises(ValueError), temporary_folder(".entry.", tmp_path):
        raise ValueError
    assert names(tmp_path) == set()


def test_a_folder_may_be_renamed_over_an_existing_one(tmp_path: Path) -> None:
    target = tmp_path / "out"
    target.mkdir()
    (target / "old").write_text("")
    with temporary_folder(".out.", tmp_path) as place:
        (place / "new").write_text("")
        replace(place, target)
    assert names(tmp_path) == {"out"}
    assert names(target) == {"new"}


def test_an_existing_folder_stays_if_it_cannot_be_replaced(tmp_path: Path) -> None:
    target = tmp_path / "out"
    target.mkdir()
    (target / "old").write_text("")
    with temporary_folder(".out.", tmp_path) as place:
        with pytest.raises(OSError):
            replace(place / "missing", target)
        assert names(target) == {"old"}


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_killed_process_leaves_nothing_for_long(number: int, tmp_path: Path) -> None:
    command = [sys.executable, "-c", HOLDER, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        holder.stdout.readline()
        remove_abandoned(".entry.", tmp_path)
        assert len(names(tmp_path)) == 1, "the folder of a process that runs"
        holder.send_signal(number)
    assert len(names(tmp_path)) == 1
    with temporary_folder(".other.", tmp_path):
        assert len(names(tmp_path)) == 2
    with temporary_folder(".entry.", tmp_path):
        assert len(names(tmp_path)) == 1
    assert names(tmp_path) == set()


def test_folders_of_running_processes_stay(tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    for folder in (outside, tmp_path / ".entry.more", tmp_path / ".entry.none", tmp_path / ".entry.linked"):
        (folder / "content").mkdir(parents=True)
    for folder in (outside, tmp_path / ".entry.more"):
        (folder / "lock").write_text("")
    (tmp_path / ".entry.more" / "precious").write_text("")
    (tmp_path / ".entry.linked" / "lock").symlink_to(outside / "lock")
    (tmp_path / ".entry.link").symlink_to(outside)
    (tmp_path / ".entry.file").write_text("")
    before = names(tmp_path)
    remove_abandoned(".entry.", tmp_path)
    assert names(tmp_path) == before
    assert names(outside) == {"lock", "content"}
    (tmp_path / ".entry.more" / "precious").unlink()
    remove_abandoned(".entry.", tmp_path)
    assert names(tmp_path) == before - {".entry.more"}


def test_links_inside_a_removed_folder_are_not_followed(tmp_path: Path) -> None:
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "precious").write_text("")
    folder = tmp_path / ".entry.x"
    folder.mkdir()
    (folder / "lock").write_text("")
    (folder / "content").symlink_to(tmp_path / "outside")
    remove_abandoned(".entry.", tmp_path)
    assert names(tmp_path) == {"outside"}
    assert names(tmp_path / "outside") == {"precious"}


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can make another's folder")
def test_leaves_another_users_folder(tmp_path: Path) -> None:
    folder = tmp_path / ".entry.x"
    folder.mkdir()
    (folder / "lock").write_text("")
    os.chown(folder, 12345, -1)
    remove_abandoned(".entry.", tmp_path)
    assert names(tmp_path) == {".entry.x"}


def test_a_full_or_missing_folder_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(temporary.tempfile, "gettempdir", lambda: str(tmp_path / "none"))
    with pytest.raises(UserError, match="TMPDIR"), temporary_folder():
        pass
    full = OSError(28, "No space left on device")
    with pytest.raises(UserError, match="no space left on the disk of"), temporary_folder(".x.", tmp_path):
        raise full
    assert names(tmp_path) == set()
