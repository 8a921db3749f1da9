"""What can be made again: folders and measurements that are verified before they are used.

An entry is a folder whose ``contents.json`` tells its key, and the size and SHA-256 of every other file in it. A
measurement is a JSON file that tells its key and the SHA-256 of what it holds. What has changed since is made again.
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

#: The file that is written last.
CONTENTS = "contents.json"

#: Changes with the meaning of what is kept: part of each seal.
VERSION = 1

#: Bytes on the disk below which work that fails is taken to fail for want of them.
LEAST_SPACE = 16 << 20

_BLOCK = 1 << 20

#: SHA-256 of each file of the entries that this process has verified or made.
_verified: dict[Path, dict[str, str]] = {}


def seal(folder: Path, key: str | None = None) -> None:
    """Write ``contents.json``, which binds the files of a folder to its key, by default the folder's name."""
    files = {name: [size, digest] for name, (size, digest) in _contents(folder).items()}
    write_json(folder / CONTENTS, {"version": VERSION, "key": key or folder.name, "files": files})


def is_intact(folder: Path, key: str | None = None) -> bool:
    """The folder is sealed and holds what it held then: no file more, none less, no byte changed."""
    return _digests(folder, key or folder.name) is not None


def digests(folder: Path) -> dict[str, str] | None:
    """SHA-256 of each file of an entry, by its path in there; None for a folder that `entry` did not give."""
    return _verified.get(folder)


def entry(
    folder: Path,
    make: Callable[[Path], None],
    what: str,
    progress: Progress = QUIET,
    is_usable: Callable[[Path], bool] = lambda folder: True,
) -> Path:
    """The entry `folder`, intact: as it is kept, or made once by whichever process comes first.

    Args:
        folder: where it is kept; its name is the key, so it tells all that the content follows from.
        make: fills an empty folder, which becomes the entry when it is complete.
        what: for messages, e.g. ``"simulator"``.
        progress: shows that another process is waited for.
        is_usable: what else must hold of an entry that is kept, e.g. that files outside it are still there.

    Raises:
        UserError: the cache cannot be written.
    """
    if _is_known(folder) and is_usable(folder):
        return folder
    try:
        with locked(folder.parent / f"{folder.name}.lock", what, progress):
            if not (_is_known(folder) and is_usable(folder)):
                if os.path.lexists(folder):
                    progress.note(f"the cached {what} was damaged and is built again")
                with temporary.temporary_folder(f".{folder.name}.", folder.parent) as place:
                    _fill(place, make, folder)
                    temporary.replace(place, folder)
                _verified[folder] = _known(folder)
    except OSError as error:
        if (refusal := _unwritable(folder.parent, error)) is None:
            raise
        raise refusal from None
    return folder


def discard(folder: Path) -> None:
    """Keep an entry no longer: what came of it is wrong. The next one who asks for it makes it again."""
    with contextlib.suppress(OSError):
        (folder / CONTENTS).unlink()


def touch(path: Path) -> None:
    """Say that an entry was used; a cache that cannot be written is as good."""
    with contextlib.suppress(OSError):
        os.utime(path)


def store(file: Path, key: Mapping[str, Any], content: Mapping[str, Any], progress: Progress = QUIET) -> None:
    """Keep a measurement. What cannot be kept is told in one line and lost: the caller has it."""
    plain = json.loads(json.dumps(content, default=_plain, allow_nan=False))
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_json(file, {"version": VERSION, "key": key, "sha256": _digest(key, plain), "content": plain})
    except (OSError, UserError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        progress.note(f"the measurement is not kept in {file.parent}: {reason}")


def stored(file: Path, key: Mapping[str, Any], progress: Progress = QUIET) -> dict[str, Any] | None:
    """A measurement that was kept under this key; None, after one line if there is something else."""
    try:
        text = file.read_bytes()
    except FileNotFoundError:
        return None
    except OSError:
        text = b""
    try:
        kept = json.loads(text)
        if kept["version"] == VERSION and kept["key"] == key and kept["sha256"] == _digest(key, kept["content"]):
            content: dict[str, Any] = kept["content"]
            return content
    except (ValueError, KeyError, TypeError, RecursionError):
        pass
    progress.note(f"the cached measurement {file.name} was damaged and is made again")
    return None


def _fill(place: Path, make: Callable[[Path], None], folder: Path) -> None:
    try:
        make(place)
        seal(place, folder.name)
    except (OSError, RuntimeError):
        # Programs do not say in one way that the disk is full, nor does `shutil`; and soon the half-made entry is gone
        if shutil.disk_usage(place).free < LEAST_SPACE:
            raise _full(folder.parent) from None
        raise


def _full(folder: Path) -> UserError:
    return UserError(f"no space left on the disk of the cache {folder}: free some there")


def _is_known(folder: Path) -> bool:
    """The entry is intact; it is read once in a process."""
    if folder not in _verified or not (folder / CONTENTS).is_file():
        found = _digests(folder, folder.name)
        if found is None:
            _verified.pop(folder, None)
            return False
        _verified[folder] = found
    return True


def _known(folder: Path) -> dict[str, str]:
    """What was just sealed, without reading it again."""
    files = json.loads((folder / CONTENTS).read_text())["files"]
    return {name: digest for name, (_, digest) in files.items()}


def _digests(folder: Path, key: str) -> dict[str, str] | None:
    try:
        sealed = json.loads((folder / CONTENTS).read_bytes())
        if sealed["version"] != VERSION or sealed["key"] != key:
            return None
        expected = {name: (size, digest) for name, (size, digest) in sealed["files"].items()}
        # Sizes first: most damage shows without reading the files
        if {name: path.stat().st_size for name, path in _files(folder)} != {n: s for n, (s, _) in expected.items()}:
            return None
        return {name: digest for name, (_, digest) in expected.items()} if _contents(folder) == expected else None
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None


def _contents(folder: Path) -> dict[str, tuple[int, str]]:
    """Size and SHA-256 of each file but ``contents.json``."""
    return {name: _sized_digest(path) for name, path in _files(folder)}


def _files(folder: Path) -> Iterator[tuple[str, Path]]:
    """The files of a folder and of those in it; a link or a device is none, and raises a ValueError."""
    if folder.is_symlink():
        raise ValueError(f"{folder} is a link")
    for path in sorted(folder.rglob("*")):
        if path.is_symlink() or not (path.is_file() or path.is_dir()):
            raise ValueError(f"{path} is no plain file")
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
    """What to say of a cache that is full or cannot be written; None if the error is about something else."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return _full(folder)
    place = Path(os.fsdecode(error.filename or ""))
    if not error.filename or not (place.is_relative_to(folder) or folder.is_relative_to(place)):
        return None
    return UserError(f"the cache {folder} cannot be written: {error.strerror}")
