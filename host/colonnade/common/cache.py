"""A cache of folders and measurements, verified before use.

An entry is a folder whose ``contents.json`` states its key, and the size and SHA-256 of every other file. A measurement
is a JSON file with its key and the SHA-256 of its content. The cache rebuilds whatever does not match.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from colonnade.common import temporary
from colonnade.common.atomic_files import write_json
from colonnade.common.errors import UserError
from colonnade.common.locks import locked
from colonnade.common.progress import QUIET, Progress

#: The file list of an entry, written last.
CONTENTS = "contents.json"

#: Version of the cached formats, part of each seal.
VERSION = 1

#: Free bytes below which a failure counts as a full disk.
MIN_FREE_BYTES = 16 << 20

_BLOCK = 1 << 20

#: The entries that this process verified or made.
_verified: set[Path] = set()


def seal(folder: Path, key: str | None = None) -> None:
    """Write ``contents.json``, the digests of a folder's files under its key; the default key is the folder's name."""
    files = {name: [size, digest] for name, (size, digest) in _contents(folder).items()}
    write_json(folder / CONTENTS, {"version": VERSION, "key": key or folder.name, "files": files})


def is_intact(folder: Path, key: str | None = None) -> bool:
    """Whether a sealed folder is unchanged: the same files with the same content."""
    try:
        sealed = json.loads((folder / CONTENTS).read_bytes())
        if sealed["version"] != VERSION or sealed["key"] != (key or folder.name):
            return False
        expected = {name: (size, digest) for name, (size, digest) in sealed["files"].items()}
        # Sizes first: most damage shows without reading the files
        if {name: path.stat().st_size for name, path in _files(folder)} != {n: s for n, (s, _) in expected.items()}:
            return False
        return _contents(folder) == expected
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return False


def holds(folder: Path) -> bool:
    """Whether an entry is there and intact; each process verifies it once."""
    if folder not in _verified or not (folder / CONTENTS).is_file():
        _verified.discard(folder)
        if not is_intact(folder):
            return False
        _verified.add(folder)
    return True


@contextlib.contextmanager
def entry(
    folder: Path,
    what: str,
    progress: Progress = QUIET,
    is_usable: Callable[[Path], bool] = lambda folder: True,
) -> Iterator[Path | None]:
    """Make sure that the entry `folder` is intact after the block, which the first process that needs it fills.

    The block gets an empty folder to fill, which then becomes the entry; or None if there is nothing to do. Other
    processes wait for the end of the block.

    Args:
        folder: path of the entry; its name is the key, which identifies all inputs of the content.
        what: for messages, e.g. ``"simulator"``.
        progress: shows waiting for another process.
        is_usable: further check of a cached entry, e.g. that files outside it still exist.

    Raises:
        UserError: the cache is not writable.
    """
    if holds(folder) and is_usable(folder):
        yield None
        return
    try:
        with locked(folder.parent / f"{folder.name}.lock", what, progress):
            if holds(folder) and is_usable(folder):
                yield None
            else:
                if os.path.lexists(folder):
                    progress.note(f"the cached {what} was damaged and is built again")
                temporary.remove_abandoned(".", folder.parent)
                with temporary.temporary_folder(f".{folder.name}.", folder.parent) as content:
                    with _disk_watched(content, folder.parent):
                        yield content
                        seal(content, folder.name)
                    temporary.replace(content, folder)
                _verified.add(folder)
    except OSError as error:
        if (refusal := _unwritable(folder.parent, error)) is None:
            raise
        raise refusal from None


def discard(folder: Path) -> None:
    """Invalidate an entry, e.g. because its program gives wrong results. The next use rebuilds it."""
    with contextlib.suppress(OSError):
        (folder / CONTENTS).unlink()


def touch(path: Path) -> None:
    """Record that an entry was used; a read-only cache is not an error."""
    with contextlib.suppress(OSError):
        os.utime(path)


def store(file: Path, key: Mapping[str, Any], content: Mapping[str, Any], progress: Progress = QUIET) -> None:
    """Cache a measurement. A failure prints one note and is otherwise ignored."""
    plain = json.loads(json.dumps(content, default=_plain, allow_nan=False))
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_json(file, {"version": VERSION, "key": key, "sha256": _digest(key, plain), "content": plain})
    except (OSError, UserError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        progress.note(f"the measurement is not cached in {file.parent}: {reason}")


def stored(file: Path, key: Mapping[str, Any], progress: Progress = QUIET) -> dict[str, Any] | None:
    """Load the measurement with this key; None if there is none. A damaged file prints one note."""
    try:
        text = file.read_bytes()
    except FileNotFoundError:
        return None
    except OSError:
        text = b""
    try:
        document = json.loads(text)
        content: dict[str, Any] = document["content"]
        if (document["version"], document["key"], document["sha256"]) == (VERSION, key, _digest(key, content)):
            return content
    except (ValueError, KeyError, TypeError, RecursionError):
        pass
    progress.note(f"the cached measurement {file.name} was damaged and is made again")
    return None


@contextlib.contextmanager
def _disk_watched(content: Path, cache: Path) -> Iterator[None]:
    try:
        yield
    except (OSError, RuntimeError):
        # Programs and `shutil` report a full disk differently: measure it before the partial entry is removed
        if shutil.disk_usage(content).free < MIN_FREE_BYTES:
            raise _full(cache) from None
        raise


def _full(folder: Path) -> UserError:
    return UserError(f"no space left on the disk of the cache {folder}: free some there")


def _contents(folder: Path) -> dict[str, tuple[int, str]]:
    """Size and SHA-256 of each file but ``contents.json``."""
    return {name: _sized_digest(path) for name, path in _files(folder)}


def _files(folder: Path) -> Iterator[tuple[str, Path]]:
    """All files below a folder, with relative names; a link or a device raises ValueError."""
    if folder.is_symlink():
        raise ValueError(f"{folder} is a link")
    for path in sorted(folder.rglob("*")):
        if path.is_symlink() or not (path.is_file() or path.is_dir()):
            raise ValueError(f"{path} is not a plain file")
        if path.is_file() and path != folder / CONTENTS:
            yield path.relative_to(folder).as_posix(), path


def _sized_digest(path: Path) -> tuple[int, str]:
    digest, size = hashlib.sha256(), 0
    with path.open("rb") as stream:
        while block := stream.read(_BLOCK):
            digest.update(block)
            size += len(block)
    return size, digest.hexdigest()


def _digest(key: Mapping[str, Any], content: Any) -> str:
    return hashlib.sha256(json.dumps([key, content], sort_keys=True).encode()).hexdigest()


def _plain(value: Any) -> Any:
    return value.tolist() if hasattr(value, "tolist") else str(value)


def _unwritable(folder: Path, error: OSError) -> UserError | None:
    """The error for a full or read-only cache; None if the failure has another cause."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return _full(folder)
    path = Path(os.fsdecode(error.filename or ""))
    if not error.filename or not (path.is_relative_to(folder) or folder.is_relative_to(path)):
        return None
    return UserError(f"the cache {folder} cannot be written: {error.strerror}")
