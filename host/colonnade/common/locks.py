"""File locks between processes."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from filelock import FileLock, Timeout

from colonnade.common.progress import QUIET, Progress


@contextlib.contextmanager
def locked(path: Path, what: str, progress: Progress = QUIET) -> Iterator[None]:
    """Hold the exclusive lock of the file ``path``; the kernel frees it if the holder dies.

    Args:
        path: The lock file; missing folders are made.
        what: The lock's purpose, for the progress display while another process holds it.
        progress: Shows that this process waits.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    lock = FileLock(path, mode=0o666)
    try:
        lock.acquire(timeout=0)
    except Timeout:
        with progress.step(f"waiting for another process that makes the {what}"):
            lock.acquire()
    try:
        yield
    finally:
        lock.release()
