"""File locks between processes."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from colonnade.common.processes import signals_deferred
from colonnade.common.progress import QUIET, Progress

with signals_deferred():
    # The import tries links in a temporary folder
    from filelock import FileLock, Timeout


@contextlib.contextmanager
def locked(path: Path, what: str, progress: Progress = QUIET) -> Iterator[None]:
    """Hold the exclusive lock of the file ``path``; the kernel frees it if the holder dies.

    Args:
        path: The lock file; missing folders are made.
        what: The lock's purpose, for the progress display while another process holds it.
        progress: Shows that this process waits.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    lock = FileLock(path, mode=_mode(path.parent))
    try:
        lock.acquire(timeout=0)
    except Timeout:
        with progress.step(f"waiting for another process that makes the {what}"):
            lock.acquire()
    try:
        yield
    finally:
        lock.release()


def _mode(folder: Path) -> int:
    """Permission bits of a lock in a folder: who may write there may hold it, since a holder stops all others."""
    writers = folder.stat().st_mode & 0o222
    return 0o600 | writers | writers << 1
