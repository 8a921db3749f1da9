"""Temporary folders, removed by a later run if their process was killed.

``PREFIX…/lock`` is locked while the folder is in use; the kernel frees the lock of a killed process. Callers work in
``PREFIX…/content``. A later run removes a folder whose lock is free, if it contains only the files named here.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

from colonnade.common import processes
from colonnade.common.errors import UserError

#: Name prefix of folders in the system's temporary folder.
PREFIX = "colonnade-"

#: The only entries of such a folder: its lock, the content, and what the content replaced.
LOCK, CONTENT, REPLACED = "lock", "content", "replaced"

_FULL = (errno.ENOSPC, errno.EDQUOT)

_in_use: set[Path] = set()


@contextlib.contextmanager
def temporary_folder(prefix: str = PREFIX, parent: Path | None = None) -> Iterator[Path]:
    """Make an empty folder and remove it after the block, unless it was renamed.

    Folders of killed processes with the same prefix and parent are removed too.

    Args:
        prefix: start of the folder's name; ``.NAME.`` if it will be renamed to NAME in the same parent.
        parent: by default the system's temporary folder.

    Raises:
        UserError: there is no disk space or no permission.
    """
    with processes.signals_deferred():
        # It writes a file to try the place
        base = parent or Path(tempfile.gettempdir())
    remove_abandoned(prefix, base)
    with processes.signals_deferred():
        try:
            folder, lock = _make_locked(prefix, base)
        except OSError as error:
            raise UserError(f"cannot make a temporary folder in {base}: {error.strerror}{_advice(parent)}") from None
        _in_use.add(folder)
    try:
        yield folder / CONTENT
    except OSError as error:
        if error.errno in _FULL:
            raise UserError(f"no space left on the disk of {base}: free some there{_advice(parent)}") from None
        raise
    finally:
        _in_use.discard(folder)
        with contextlib.suppress(OSError):
            _remove(folder)
        os.close(lock)


def replace(content: Path, target: Path) -> None:
    """Rename a folder of `temporary_folder` to `target`, replacing an existing file or folder."""
    replaced = content.with_name(REPLACED)
    with contextlib.suppress(FileNotFoundError):
        target.rename(replaced)
    try:
        content.rename(target)
    except OSError:
        if os.path.lexists(replaced):
            replaced.rename(target)
        raise


def remove_abandoned(prefix: str, parent: Path) -> None:
    """Remove the folders of processes that were killed."""
    try:
        with os.scandir(parent) as entries:
            found = [entry.path for entry in entries if entry.name.startswith(prefix)]
    except OSError:
        return
    for path in found:
        # Another process may have removed it, or owns it
        with contextlib.suppress(OSError):
            _remove_if_abandoned(Path(path))


def _make_locked(prefix: str, parent: Path) -> tuple[Path, int]:
    while True:
        folder = Path(tempfile.mkdtemp(prefix=prefix, dir=parent))
        try:
            lock = os.open(folder / LOCK, os.O_CREAT | os.O_EXCL | os.O_RDWR | os.O_NOFOLLOW, 0o600)
        except OSError:
            folder.rmdir()
            raise
        # On a file system without locks, folders of killed processes remain
        with contextlib.suppress(OSError):
            fcntl.flock(lock, fcntl.LOCK_EX)
        # Another process may have taken the lock first and removed the folder
        if os.fstat(lock).st_nlink:
            try:
                (folder / CONTENT).mkdir()
            except OSError:
                _remove(folder)
                os.close(lock)
                raise
            return folder, lock
        os.close(lock)


def _remove_if_abandoned(folder: Path) -> None:
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.geteuid():
        return
    if not {path.name for path in folder.iterdir()} <= {LOCK, CONTENT, REPLACED}:
        return
    lock = os.open(folder / LOCK, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK)
    try:
        status = os.fstat(lock)
        if stat.S_ISREG(status.st_mode) and status.st_uid == os.geteuid():
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            _remove(folder)
    finally:
        os.close(lock)


def _remove(folder: Path) -> None:
    """Remove the folder, its lock last: a later run can finish an interrupted removal."""
    for name in (CONTENT, REPLACED):
        path = folder / name
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)
    (folder / LOCK).unlink(missing_ok=True)
    folder.rmdir()


def _remove_all() -> None:
    for folder in list(_in_use):
        with contextlib.suppress(OSError):
            _remove(folder)


def _advice(parent: Path | None) -> str:
    return "" if parent else ", or name another folder with TMPDIR"


processes.when_leaving(_remove_all)
