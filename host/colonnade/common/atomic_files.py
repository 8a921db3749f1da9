"""Atomic file output: a file appears complete or not at all."""

from __future__ import annotations

import contextlib
import json
import os
import stat
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Any

from colonnade.common import ledger, processes
from colonnade.common.errors import UserError, reason_of

#: Temporary files, which go when a signal ends the process while the main thread is in a call of a library.
_unfinished: set[Path] = set()


@contextlib.contextmanager
def replacing(path: Path, is_edited: bool = False) -> Iterator[IO[bytes]]:
    """Write ``path`` through a temporary file in the same folder, so that it is never partly written.

    Args:
        path: The file.
        is_edited: It is an input that the command edits.

    Raises:
        UserError: ``path`` cannot be an output (see `check_writable`), is an input that is not edited, or the disk is
            full. An existing file is then unchanged.
    """
    check_writable(path)
    if not is_edited:
        ledger.check_write(path)
    temporary: Path | None = None
    try:
        handle, name = tempfile.mkstemp(prefix=".colonnade.", dir=path.parent)
        temporary = Path(name)
        _unfinished.add(temporary)
        with os.fdopen(handle, "wb") as stream:
            yield stream
        temporary.chmod(_mode(path))
        temporary.replace(path)
    except BaseException as error:
        if temporary is not None:
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise UserError(f"cannot write {path}: {reason_of(error)}") from None
        raise
    finally:
        _unfinished.discard(temporary or path)
    ledger.add_written(path)


def check_writable(path: Path) -> None:
    """Refuse an output path that cannot be written, before the work starts.

    An output may replace a writable regular file, but no link, folder, pipe, socket or device.
    """
    status = _status(path)
    if status is not None and not stat.S_ISREG(status.st_mode):
        raise UserError(f"{path} is {kind_of(status)}: name a file to write")
    if not path.parent.is_dir():
        raise UserError(f"{path.parent} is not a folder: make it before writing {path.name} there")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise UserError(f"{path.parent} is not writable: name another folder for {path.name}")
    if status is not None and not (status.st_mode & 0o222 and os.access(path, os.W_OK)):
        raise UserError(f"{path} is read-only: make it writable, or name another file")


def check_folder(path: Path) -> None:
    """Refuse an output folder whose path exists and is not a folder."""
    status = _status(path)
    if status is not None and not stat.S_ISDIR(status.st_mode):
        raise UserError(f"{path} is {kind_of(status)}: name a folder to write")


def _status(path: Path) -> os.stat_result | None:
    """Status of the path itself, not of a link's target; None if it does not exist."""
    try:
        return path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise UserError(f"cannot write {path}: {reason_of(error)}") from None
    except ValueError:
        raise UserError(f"{str(path)!r} is not a file name: name another output") from None


def kind_of(status: os.stat_result) -> str:
    """Name the type of a file, e.g. ``"a folder"``, for messages."""
    kinds = {
        stat.S_IFREG: "a file",
        stat.S_IFDIR: "a folder",
        stat.S_IFLNK: "a symbolic link",
        stat.S_IFIFO: "a pipe",
        stat.S_IFSOCK: "a socket",
        stat.S_IFCHR: "a device",
        stat.S_IFBLK: "a device",
    }
    return kinds.get(stat.S_IFMT(status.st_mode), "not a regular file")


def make_folder(path: Path) -> list[Path]:
    """Make the folder ``path`` and its parents where missing; returns the new folders, outermost first."""
    missing: list[Path] = []
    try:
        folder = path
        while not folder.exists() and folder != folder.parent:
            missing.insert(0, folder)
            folder = folder.parent
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"cannot make the folder {path}: {reason_of(error)}") from None
    except ValueError:
        raise UserError(f"{str(path)!r} is not a file name: name another folder") from None
    return missing


@contextlib.contextmanager
def made_folder(path: Path) -> Iterator[None]:
    """Make the folder ``path`` and its parents; an error in the block removes the new ones that are empty."""
    made = make_folder(path)
    try:
        yield
    except BaseException:
        for folder in reversed(made):
            with contextlib.suppress(OSError):
                folder.rmdir()
        raise


def _mode(path: Path) -> int:
    """Permission bits of the file that is replaced, or of a new file."""
    with contextlib.suppress(OSError):
        return path.lstat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write ``content`` as `json_bytes`."""
    data = json_bytes(content)
    with replacing(path) as stream:
        stream.write(data)


def json_bytes(content: Mapping[str, Any]) -> bytes:
    """``content`` as indented JSON; numpy numbers become Python numbers."""
    return (json.dumps(content, indent=2, default=_plain, allow_nan=False) + "\n").encode()


def _plain(value: Any) -> Any:
    """Convert numpy numbers and arrays to Python's, and a path to text."""
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is not a JSON type")


def _remove_unfinished() -> None:
    for temporary in list(_unfinished):
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


processes.when_leaving(_remove_unfinished)
