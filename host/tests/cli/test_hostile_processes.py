"""Errors that need a separate process: full disks, missing permissions, closed outputs, unexpected exceptions."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import hostile
import pytest
from click.testing import CliRunner
from hostile import PACK, RENDER

from colonnade.cli.main import DEBUG, cli
from colonnade.common import atomic_files, image_io, processes
from colonnade.common.errors import UserError

LIVING = Path(__file__).resolve().parents[3] / "scenes" / "rooms" / "living"
IS_ROOT = os.geteuid() == 0


def colonnade(
    folder: Path, arguments: str, before: Sequence[str] = (), **more: Any
) -> subprocess.CompletedProcess[str]:
    command = [*before, sys.executable, "-m", "colonnade", *arguments.split()]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | more
    return subprocess.run(command, cwd=folder, stdin=subprocess.DEVNULL, text=True, check=False, **streams)


@contextlib.contextmanager
def tiny_disk(place: Path) -> Iterator[Path]:
    """A file system of 8 KiB; skips the test if it cannot be mounted."""
    place.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=8k", "tmpfs", place], capture_output=True, check=False
    )
    if mounted.returncode != 0:
        pytest.skip("no file system can be mounted here")
    try:
        yield place
    finally:
        subprocess.run(["umount", place], check=False)


FULL = {
    "render": f"{RENDER} --output disk/f.png --json disk/r.json",
    "hits": "render s.toml --config tiny --backend model --size 200x200 --hits disk/h.npz",
    "pack": f"{PACK} --mesh sphere:2000 --output disk/q",
    "generate": "generate --config tiny --manifest-only --output disk/d",
    "json": "inspect p --json disk/r.json",
    "light": f"light {LIVING} --lights 0 --output disk/d",
    "maps": "inspect --background room --no-dists --output disk/d",
}


@pytest.mark.skipif(not IS_ROOT, reason="only root can mount a small file system")
@pytest.mark.parametrize("arguments", FULL.values(), ids=list(FULL))
def test_full_disk_is_one_line_and_leaves_nothing(folder: Path, arguments: str) -> None:
    with tiny_disk(folder / "disk") as disk:
        (disk / "kept").write_bytes(b"k" * 4096)
        with contextlib.suppress(OSError):
            (disk / "filler").write_bytes(b"f" * 4096)
        before = hostile.snapshot(folder)
        done = colonnade(folder, arguments)
        assert done.returncode == 2
        notes, _, error = done.stderr.rstrip("\n").rpartition("\n")
        assert "error" not in notes
        hostile.one_error_line(f"{error}\n", "o space left on ")
        assert hostile.snapshot(folder) == before


@pytest.mark.parametrize("name", ["f.png", "r.json", "q"])
def test_disk_that_fills_while_writing_keeps_what_was_there(
    folder: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same without root: writing fails after some bytes."""
    whole = os.fdopen

    def full(handle: int, mode: str) -> Any:
        stream = whole(handle, mode)
        if mode != "wb":
            return stream
        stream.write(b"half")

        class Full:
            def __enter__(self) -> Full:
                return self

            def __exit__(self, *error: object) -> None:
                stream.close()

            def write(self, data: bytes) -> int:
                raise OSError(28, "No space left on device")

            def __getattr__(self, attribute: str) -> Any:
                return getattr(stream, attribute)

        return Full()

    (folder / "f.png").write_bytes(b"earlier")
    (folder / "r.json").write_bytes(b"earlier")
    arguments = {
        "f.png": f"{RENDER} --output f.png",
        "r.json": "inspect p --json r.json",
        "q": f"{PACK} --output q/r",
    }[name]
    monkeypatch.setattr(atomic_files.os, "fdopen", full)
    before = hostile.snapshot(folder)
    with hostile.inside(folder):
        done = CliRunner().invoke(cli, arguments.split())
    monkeypatch.undo()
    assert done.exit_code == 2, done.output
    hostile.one_error_line(done.stderr, "No space left on device")
    assert hostile.snapshot(folder) == before


@pytest.mark.parametrize(
    "arguments",
    [
        f"{RENDER} --output locked/f.png",
        "generate --config tiny --manifest-only --output locked/d",
        f"{PACK} --output locked/q",
        "render locked/s.toml --config tiny",
        "generate --config secret.json --print",
    ],
)
def test_no_permission_is_one_line(folder: Path, arguments: str) -> None:
    (folder / "secret.json").write_text("{}")
    (folder / "secret.json").chmod(0)
    (folder / "locked").mkdir(mode=0)
    if IS_ROOT and shutil.which("setpriv") is None:
        pytest.skip("root may do everything, and setpriv is not there to take that away")
    powerless = ["setpriv", "--bounding-set", "-all", "--inh-caps", "-all"] if IS_ROOT else []
    done = colonnade(folder, arguments, before=powerless)
    (folder / "locked").chmod(0o700)
    assert done.returncode == 2
    hostile.one_error_line(done.stderr, "")


def test_output_to_a_closed_pipe_is_one_line(folder: Path) -> None:
    with Path("/dev/full").open("w") as full:
        done = colonnade(folder, "inspect p", stdout=full)
    assert done.returncode == 2
    hostile.one_error_line(done.stderr, "No space left")


def test_arguments_may_be_invalid_utf_8(folder: Path) -> None:
    command = [sys.executable.encode(), b"-m", b"colonnade", b"render", b"\xff\x1b[31m.toml", b"--config", b"tiny"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    hostile.one_error_line(done.stderr, "\\xff\\x1b[31m.toml")


class PanicException(BaseException):
    """As packages in Rust raise it."""


ESCAPED = {
    "memory": (MemoryError(), 2, "out of memory"),
    "recursion": (RecursionError("maximum depth"), 2, "nested too deeply"),
    "system": (OSError(5, "Input/output error", "a\x1b[31m"), 2, "a\\x1b[31m: Input/output error"),
    "text": (UnicodeDecodeError("utf-8", b"\xff", 0, 1, "invalid"), 2, "UTF-8"),
    "loader": (ImportError("x.so: failed to map segment from shared object"), 2, "ulimit -v"),
    "rust": (PanicException("no file handle"), 1, f"PanicException: no file handle (internal error; {DEBUG}=1"),
    "bug": (KeyError("rows"), 1, f"{DEBUG}=1 prints the traceback"),
}


@pytest.mark.parametrize(("error", "status", "says"), ESCAPED.values(), ids=list(ESCAPED))
def test_an_unexpected_exception_is_one_line(
    folder: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException, status: int, says: str
) -> None:
    def broken(path: Path) -> None:
        raise error

    monkeypatch.setattr("colonnade.quality.compare.read_picture", broken)
    monkeypatch.setattr(image_io, "read_picture", broken)
    monkeypatch.delenv(DEBUG, raising=False)
    with hostile.inside(folder):
        done = CliRunner().invoke(cli, ["compare", "a.png", "b.png"])
    assert done.exit_code == status
    hostile.one_error_line(done.stderr, says)
    monkeypatch.setenv(DEBUG, "1")
    with hostile.inside(folder):
        assert "Traceback" in CliRunner().invoke(cli, ["compare", "a.png", "b.png"]).stderr


LIMITS = {
    "files": ("-n 16", "inspect p", "allows 16 open files, a command needs 64: raise ulimit -n"),
    "memory": ("-v 500000", "inspect p", "allows 488 MB of address space, colonnade inspect needs 2,048"),
    "explorer": ("-v 4000000", "explore s.toml --output o", "colonnade explore needs 16,384: raise ulimit -v"),
}


@pytest.mark.parametrize(("limit", "arguments", "says"), LIMITS.values(), ids=list(LIMITS))
def test_a_limit_of_the_machine_is_named(folder: Path, limit: str, arguments: str, says: str) -> None:
    done = colonnade(folder, arguments, before=["bash", "-c", f'ulimit {limit}; exec "$@"', "bash"])
    assert done.returncode == 2
    hostile.one_error_line(done.stderr, says)


@pytest.mark.parametrize(
    ("script", "says"),
    [
        ("echo 'There is insufficient memory for the Java Runtime'; exit 1", "memory or address space"),
        ("kill -XCPU $$", "processor time"),
    ],
)
def test_a_program_that_reaches_a_limit_is_no_internal_error(script: str, says: str) -> None:
    with pytest.raises(UserError, match=f"sh reached this machine's limit of {says}"):
        processes.run(["sh", "-c", script])


def test_a_mesh_needs_a_name_in_utf_8(folder: Path) -> None:
    with hostile.inside(folder):
        for name, says in (("", "name a mesh or a file"), ("\udcff.obj", "\\xff.obj is not UTF-8: rename the file")):
            done = CliRunner().invoke(cli, [*RENDER.split(), "--mesh", name])
            assert done.exit_code == 2, done.output
            hostile.one_error_line(done.stderr, says)


def test_a_name_with_a_line_end_starts_no_line(folder: Path) -> None:
    """Neither a note on a mesh nor the text that is meant for a scene file."""
    name = "a\nb.obj"
    (folder / name).write_text(hostile.TRIANGLE + "usemtl none\nl 1 2\n")
    shutil.copytree(LIVING, folder / "r\n[light]\nx")
    with hostile.inside(folder):
        done = CliRunner().invoke(cli, [*RENDER.split(), "--mesh", name])
        assert done.exit_code == 0, done.output
        assert all(line.startswith("colonnade: ") for line in done.stderr.splitlines()), done.stderr
        done = CliRunner().invoke(cli, ["light", "r\n[light]\nx", "--lights", "0"])
    assert done.exit_code == 0, done.output
    assert done.stdout.splitlines().count("[light]") == 1 and "\\n[light]\\nx" in done.stdout
