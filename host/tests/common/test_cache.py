"""Cache entries and measurements: damaged ones are rebuilt once, with one line."""

from __future__ import annotations

import errno
import io
import json
import os
import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from colonnade.common import cache
from colonnade.common.errors import UserError
from colonnade.common.locks import locked

KEY = {"design": "d0", "registers": {"frame.width": 8}}
CONTENT = {"cycles": 1234, "counters": {"hits": 5}}

Damage = Callable[[Path], object]


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Folders of built entries; starts without verified entries."""
    monkeypatch.setattr(cache, "_verified", set())
    return []


def get(folder: Path, made: list[Path]) -> Path:
    """The entry, as in a new process."""
    cache._verified.clear()
    with cache.entry(folder, "simulator") as empty:
        if empty is not None:
            made.append(empty)
            (empty / "deep").mkdir()
            (empty / "program").write_bytes(b"\x7fELF" * 100)
            (empty / "deep" / "a.sv").write_text("module a; endmodule\n")
    return folder


def fail(folder: Path, error: Exception) -> None:
    """Fail after half of an entry."""
    with cache.entry(folder, "simulator") as empty:
        assert empty is not None
        (empty / "half").write_text("")
        raise error


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def alter(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def truncate(path: Path) -> None:
    os.truncate(path, path.stat().st_size // 2)


def test_makes_an_entry_once(tmp_path: Path, made: list[Path], capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "k0"
    for _ in range(3):
        assert get(folder, made) == folder
    assert len(made) == 1
    assert cache.is_intact(folder)
    assert names(tmp_path) == {"k0", "k0.lock"}
    assert capsys.readouterr().err == ""


DAMAGES: dict[str, Damage] = {
    "truncated": lambda folder: truncate(folder / "program"),
    "empty": lambda folder: (folder / "program").write_bytes(b""),
    "altered": lambda folder: alter(folder / "deep" / "a.sv"),
    "missing": lambda folder: (folder / "program").unlink(),
    "additional": lambda folder: (folder / "deep" / "b.sv").write_text("module b; endmodule\n"),
    "linked": lambda folder: (folder / "link").symlink_to("program"),
    "seal truncated": lambda folder: truncate(folder / cache.CONTENTS),
    "seal missing": lambda folder: (folder / cache.CONTENTS).unlink(),
    "seal nested": lambda folder: (folder / cache.CONTENTS).write_text("[" * 100_000),
    "seal of nothing": lambda folder: (folder / cache.CONTENTS).write_text("[]"),
    "a file": lambda folder: (folder.rename(folder.with_name("away")), folder.write_text("")),
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES.keys())
def test_makes_a_damaged_entry_again(
    damage: Damage, tmp_path: Path, made: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "k0"
    get(folder, made)
    damage(folder)
    for _ in range(2):
        get(folder, made)
    assert len(made) == 2
    assert cache.is_intact(folder)
    assert capsys.readouterr().err == "colonnade: the cached simulator was damaged and is built again\n"


def test_an_entry_of_another_key_is_not_used(tmp_path: Path, made: list[Path]) -> None:
    get(tmp_path / "k0", made).rename(tmp_path / "k1")
    get(tmp_path / "k1", made)
    assert len(made) == 2


def test_a_failed_build_leaves_nothing(tmp_path: Path, made: list[Path]) -> None:
    with pytest.raises(RuntimeError, match="no"):
        fail(tmp_path / "k0", RuntimeError("no"))
    assert names(tmp_path) == {"k0.lock"}


def test_a_full_or_unwritable_cache_is_reported(tmp_path: Path, made: list[Path]) -> None:
    with pytest.raises(UserError, match="no space left on the disk of"):
        fail(tmp_path / "k0", OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="cannot be written: "):
        get(tmp_path / "file" / "k0", made)
    with pytest.raises(UserError, match="cannot be written: "):
        get(tmp_path / "file" / "deep" / "deeper" / "k0", made)


def test_a_lack_of_space_is_reported(tmp_path: Path, made: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache, "MIN_FREE_BYTES", 1 << 80)
    for error in (RuntimeError("g++ failed"), shutil.Error([("from", "to", "No space left")])):
        with pytest.raises(UserError, match="no space left on the disk of the cache"):
            fail(tmp_path / "k0", error)
    assert names(tmp_path) == {"k0.lock"}


def test_threads_share_one_build(tmp_path: Path, made: list[Path]) -> None:
    def make() -> None:
        with cache.entry(tmp_path / "k0", "simulator") as empty:
            if empty is not None:
                made.append(empty)
                time.sleep(0.05)

    threads = [threading.Thread(target=make) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(made) == 1


def test_reads_each_file_once_to_verify_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for number in range(15):
        (tmp_path / f"{number}.sv").write_bytes(os.urandom(20_000))
    cache.seal(tmp_path)
    opened: list[str] = []
    own = io.open
    monkeypatch.setattr(io, "open", lambda file, *others: (opened.append(str(file)), own(file, *others))[1])
    assert cache.is_intact(tmp_path)
    assert sorted(name for name in opened if name.endswith(".sv")) == sorted(map(str, tmp_path.glob("*.sv")))


def test_stores_a_measurement(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "m" / "k.json"
    assert cache.stored(file, KEY) is None
    cache.store(file, KEY, CONTENT)
    assert cache.stored(file, KEY) == CONTENT
    assert capsys.readouterr().err == ""


def edited(change: Callable[[dict[str, object]], object]) -> Damage:
    def edit(file: Path) -> None:
        kept = json.loads(file.read_text())
        change(kept)
        file.write_text(json.dumps(kept))

    return edit


@pytest.mark.parametrize(
    "damage",
    [
        truncate,
        edited(lambda kept: kept["content"].update(cycles=1233)),  # type: ignore[attr-defined]
        edited(lambda kept: kept["key"]["registers"].update({"frame.width": 9})),  # type: ignore[index]
        edited(lambda kept: kept.pop("sha256")),
        lambda file: file.write_text(json.dumps(CONTENT)),
        lambda file: file.write_text("[" * 100_000),
        lambda file: (file.unlink(), file.mkdir()),
    ],
    ids=["truncated", "other cycles", "other registers", "no checksum", "plain", "nested", "a folder"],
)
def test_an_altered_measurement_is_not_used(damage: Damage, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "k.json"
    cache.store(file, KEY, CONTENT)
    damage(file)
    assert cache.stored(file, KEY) is None
    assert capsys.readouterr().err == "colonnade: the cached measurement k.json was damaged and is made again\n"


def test_a_measurement_of_another_key_is_not_used(tmp_path: Path) -> None:
    cache.store(tmp_path / "k.json", KEY, CONTENT)
    assert cache.stored(tmp_path / "k.json", {**KEY, "design": "d1"}) is None


def test_a_measurement_that_cannot_be_stored_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    cache.store(tmp_path / "file" / "k.json", KEY, CONTENT)
    assert capsys.readouterr().err.count("\n") == 1


def test_leftovers_of_killed_processes_go_whatever_their_key(tmp_path: Path, made: list[Path]) -> None:
    left = tmp_path / ".k9.abc"
    (left / "content").mkdir(parents=True)
    (left / "lock").touch()
    foreign = tmp_path / ".other"
    foreign.mkdir()
    (foreign / "file").touch()
    get(tmp_path / "k0", made)
    assert not left.exists() and foreign.exists()


@pytest.mark.parametrize(("folder_mode", "lock_mode"), [(0o755, 0o600), (0o775, 0o660), (0o777, 0o666)])
def test_only_who_may_write_a_cache_may_hold_its_locks(tmp_path: Path, folder_mode: int, lock_mode: int) -> None:
    tmp_path.chmod(folder_mode)
    with locked(tmp_path / "lock", "entry"):
        assert (tmp_path / "lock").stat().st_mode & 0o777 == lock_mode
