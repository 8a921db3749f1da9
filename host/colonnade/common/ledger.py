"""Tracks a command's input and output files: an output never replaces an input or another output.

The command line opens a ledger for each run and declares the outputs before the work starts. Files are compared by
device and inode, so links and other spellings of a path are recognised. A ledger also knows every path that was looked
up, found or not: the result depends on these files.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from colonnade.common.errors import UserError

#: Device and inode.
Identity = tuple[int, int]
#: Time of change, nanoseconds, and size of a file; None: it is not there.
Stamp = tuple[int, int] | None


@dataclass
class Ledger:
    """Files of one command.

    Attributes:
        outputs: Declared outputs by resolved path.
        existing: Declared outputs that exist, by identity.
        inputs: Files read so far, by identity.
        written: Resolved paths of the outputs written so far.
        lookups: Paths that were looked up so far, with their stamps at the first time.
    """

    outputs: dict[Path, Path] = field(default_factory=dict)
    existing: dict[Identity, Path] = field(default_factory=dict)
    inputs: dict[Identity, Path] = field(default_factory=dict)
    written: set[Path] = field(default_factory=set)
    lookups: dict[Path, Stamp] = field(default_factory=dict)


_current: Ledger | None = None


@contextlib.contextmanager
def opened() -> Iterator[Ledger]:
    """Use a new ledger in the block, in all threads."""
    global _current
    before, _current = _current, Ledger()
    try:
        yield _current
    finally:
        _current = before


def declare_output(path: Path) -> None:
    """Declare an output; refuse one that is already declared under any name, or that is an input."""
    if _current is None:
        return
    target, identity = resolved(path), _identity(path)
    other = _current.outputs.get(target) or (_current.existing.get(identity) if identity else None)
    if other is not None:
        raise UserError(f"two outputs name the same file, {other} and {path}: name another file for one of them")
    if identity is not None and identity in _current.inputs:
        raise _replaces_input(path, _current.inputs[identity])
    _current.outputs[target] = path
    if identity is not None:
        _current.existing[identity] = path


def add_input(path: Path, status: os.stat_result) -> None:
    """Record an input; refuse one that a declared output would replace."""
    if _current is None:
        return
    identity = status.st_dev, status.st_ino
    if identity in _current.existing:
        raise _replaces_input(_current.existing[identity], path)
    _current.inputs[identity] = path


def add_lookup(path: Path) -> None:
    """Record a path before it is opened, or found missing."""
    if _current is not None:
        _current.lookups.setdefault(path, stamp_of(path))


def stamp_of(path: Path) -> Stamp:
    """The stamp of a path, which may be no file name."""
    try:
        status = path.stat()
    except (OSError, ValueError):
        return None
    return status.st_mtime_ns, status.st_size


def check_write(path: Path) -> None:
    """Refuse to replace an input, or to write a declared output twice."""
    if _current is None:
        return
    identity = _identity(path)
    if identity is not None and identity in _current.inputs:
        raise _replaces_input(path, _current.inputs[identity])
    target = resolved(path)
    if target in _current.outputs and target in _current.written:
        raise UserError(f"two outputs name the same file, {path}: name another file for one of them")


def add_written(path: Path) -> None:
    """Record that an output is complete."""
    if _current is not None:
        _current.written.add(resolved(path))


def resolved(path: Path) -> Path:
    """The absolute path with links resolved in its folders, but not in its last part."""
    try:
        return path.parent.resolve() / path.name
    except (OSError, RuntimeError, ValueError):
        return path.absolute()


def _identity(path: Path) -> Identity | None:
    try:
        status = path.lstat()
    except (OSError, ValueError):
        return None
    return status.st_dev, status.st_ino


def _replaces_input(output: Path, source: Path) -> UserError:
    return UserError(f"the output {output} would replace {source}, which this command reads: name another output")
