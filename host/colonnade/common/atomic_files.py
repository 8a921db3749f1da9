"""Files that appear complete or not at all."""

from __future__ import annotations

import contextlib
import json
import os
import stat
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Any

from colonnade.common import ledger
from colonnade.common.errors import UserError, reason_of


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[IO[bytes]]:
    """Write ``path`` through a temporary neighbour, so that it never holds half of anything.

    Raises:
        UserError: ``path`` cannot be an output (see `check_writable`), is an input of this command, or the disk is
            full. What was there is unchanged.
    """
    check_writable(path)
    ledger.check_write(path)
    temporary: Path | None = None
    try:
        handle, name = tempfile.mkstemp(prefix=".colonnade.", dir=path.parent)
        temporary = Path(name)
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
    ledger.add_written(path)


def check_writable(path: Path) -> None:
    """Refuse an output path that cannot be written, before any work is done for it.

    An output replaces a regular file that may be written, or nothing: no link, folder, pipe, socket or device.
    """
    status = _status(path)
    if status is not None and not stat.S_ISREG(status.st_mode):
        raise UserError(f"{path} is {kind_of(status)}: name a file to write")
    if not path.parent.is_dir():
        raise UserError(f"{path.parent} is no folder: make it before writing {path.name} there")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise UserError(f"{path.parent} is not writable: name another place for {path.name}")
    if status is not None and not (status.st_mode & 0o222 and os.access(path, os.W_OK)):
        raise UserError(f"{path} is read-only: make it writable, or name another file")


def check_folder(path: Path) -> None:
    """Refuse an output folder that is there as something else."""
    status = _status(path)
    if status is not None and not stat.S_ISDIR(status.st_mode):
        raise UserError(f"{path} is {kind_of(status)}: name a folder to write")


def _status(path: Path) -> os.stat_result | None:
    """Of the path itself, not of what it links to; None if there is nothing."""
    try:
        return path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise UserError(f"cannot write {path}: {reason_of(error)}") from None
    except ValueError:
        raise UserError(f"{str(path)!r} is no file name: name another output") from None


def kind_of(status: os.stat_result) -> str:
    """What a path is, in words."""
    kinds = {
        stat.S_IFREG: "a file",
        stat.S_IFDIR: "a folder",
        stat.S_IFLNK: "a symbolic link",
        stat.S_IFIFO: "a pipe",
        stat.S_IFSOCK: "a socket",
        stat.S_IFCHR: "a device",
        stat.S_IFBLK: "a device",
    }
    return kinds.get(stat.S_IFMT(status.st_mode), "no regular file")


def make_folder(path: Path) -> list[Path]:
    """Make the folder ``path``, and those around it, unless it is there; returns those it made, outermost first."""
    missing: list[Path] = []
    try:
        place = path
        while not place.exists() and place != place.parent:
            missing.insert(0, place)
            place = place.parent
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"cannot make the folder {path}: {reason_of(error)}") from None
    except ValueError:
        raise UserError(f"{str(path)!r} is no file name: name another folder") from None
    return missing


@contextlib.contextmanager
def made_folder(path: Path) -> Iterator[None]:
    """Make the folder ``path`` unless it is there; after an error those that were made go, if they are empty."""
    made = make_folder(path)
    try:
        yield
    except BaseException:
        for folder in reversed(made):
            with contextlib.suppress(OSError):
                folder.rmdir()
        raise


def _mode(path: Path) -> int:
    """As the file has it that is replaced, or as a new one."""
    with contextlib.suppress(OSError):
        return path.lstat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write ``content`` as indented JSON; numbers of numpy become plain ones."""
    text = json.dumps(content, indent=2, default=_plain, allow_nan=False) + "\n"
    with replacing(path) as stream:
        stream.write(text.encode())


def _plain(value: Any) -> Any:
    """Numpy's numbers and arrays as Python's; a path as its text."""
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no form in JSON")
