"""The folder that ``generate`` writes for the user, and how it knows its own.

``.colonnade.sha256`` lists every other file with its SHA-256, as ``sha256sum --check`` reads it. A folder is replaced
only if it is empty, or if it holds exactly the files of that list, unchanged. The generator (`DesignMarker.scala`)
writes and obeys the same file.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import stat
from pathlib import Path

from colonnade.common.atomic_files import kind_of, make_folder
from colonnade.common.errors import UserError, reason_of
from colonnade.common.temporary import replace, temporary_folder

#: The list of a folder's files.
MARKER = ".colonnade.sha256"
#: Its first line; ``sha256sum`` skips it.
TITLE = "# Written by colonnade generate, which replaces this folder only while its files are as listed here."

_MAX_MARKER_BYTES = 1 << 24
_BLOCK = 1 << 20


def check_replaceable(output: Path) -> None:
    """Refuse an output that is there, unless it is empty or an unchanged design.

    Raises:
        UserError: What is wrong, and what to do.
    """
    try:
        status = output.lstat()
    except (FileNotFoundError, NotADirectoryError):
        _check_place(output)
        return
    except (OSError, ValueError) as error:
        reason = reason_of(error) if isinstance(error, OSError) else "this is no file name"
        raise UserError(f"cannot write {str(output)!r}: {reason}") from None
    if not stat.S_ISDIR(status.st_mode):
        raise UserError(f"{output} is {kind_of(status)}: --output names a folder")
    with contextlib.suppress(OSError):
        if output.samefile(Path.cwd()):
            raise UserError(f"{output} is the working directory, which cannot be replaced: name a folder in it")
    _check_place(output)
    try:
        foreign = _foreign(output)
    except OSError as error:
        raise UserError(f"cannot read {output}: {reason_of(error)}") from None
    if foreign is not None:
        raise UserError(f"{output} {foreign}, so it is not replaced: name another --output, or delete it first")


def holds(folder: Path, file: Path) -> bool:
    """The file is, or would be, in the folder."""
    return folder.resolve() in file.resolve().parents


def listed(folder: Path) -> list[str]:
    """Files of a folder but for the marker, relative, sorted."""
    return sorted(
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and path.relative_to(folder).as_posix() != MARKER
    )


def write_marker(folder: Path) -> None:
    """List the files of a complete folder."""
    lines = [f"{_digest(folder / name)}  {name}" for name in listed(folder)]
    (folder / MARKER).write_text("\n".join([TITLE, *lines]) + "\n", encoding="utf-8")


def replace_folder(source: Path, output: Path) -> None:
    """Put a copy of the design in ``source`` in the place of ``output``; an error changes nothing.

    Raises:
        UserError: ``output`` must not be replaced, or cannot be written.
    """
    check_replaceable(output)
    make_folder(output.parent)
    try:
        with temporary_folder(".colonnade.", output.parent) as fresh:
            _copy(source, fresh)
            write_marker(fresh)
            # Once more: copying took its time
            check_replaceable(output)
            replace(fresh, output)
    except OSError as error:
        raise UserError(f"cannot write {output}: {reason_of(error)}") from None


def _check_place(output: Path) -> None:
    """The nearest folder around the output that exists must take new entries."""
    place = output.absolute().parent
    while not place.exists() and place != place.parent:
        place = place.parent
    if not place.is_dir():
        raise UserError(f"{place} is no folder: name another --output than {output}")
    if not os.access(place, os.W_OK | os.X_OK):
        raise UserError(f"{place} is not writable: name another place for {output.name}")


def _foreign(folder: Path) -> str | None:
    """Why the folder is not an unchanged design of ours; None for one that is, or that is empty."""
    # First of all, because a folder such as / takes minutes to walk
    if not any(folder.iterdir()):
        return None
    if not (folder / MARKER).is_file() or (folder / MARKER).is_symlink():
        return f"holds files, but no {MARKER} of colonnade generate"
    found: set[str] = set()
    folders: set[str] = set()
    for place, inside, files in os.walk(folder):
        for name in inside + files:
            path = Path(place, name)
            relative = path.relative_to(folder).as_posix()
            mode = path.lstat().st_mode
            if stat.S_ISDIR(mode):
                folders.add(relative)
            elif stat.S_ISREG(mode):
                found.add(relative)
            else:
                return f"holds {relative}, which colonnade generate did not write"
    expected = _read_marker(folder / MARKER)
    if expected is None:
        return f"has a {MARKER} that cannot be read"
    needed = {parent.as_posix() for name in expected for parent in Path(name).parents} - {"."}
    extra = sorted((found - {MARKER} - expected.keys()) | (folders - needed))
    if extra:
        return f"holds {extra[0]}, which colonnade generate did not write"
    for name, digest in expected.items():
        if name not in found:
            return f"lacks {name}, which colonnade generate wrote"
        if _digest(folder / name) != digest:
            return f"holds {name}, which was changed after colonnade generate wrote it"
    return None


def _read_marker(file: Path) -> dict[str, str] | None:
    """SHA-256 by name; None for a file that is no list of ours."""
    if file.stat().st_size > _MAX_MARKER_BYTES:
        return None
    try:
        title, *lines = file.read_text(encoding="utf-8").split("\n")
    except UnicodeDecodeError:
        return None
    if title != TITLE or not lines or lines.pop() != "":
        return None
    entries = [line.partition("  ") for line in lines]
    if any(len(digest) != 64 or not name for digest, _, name in entries):
        return None
    return {name: digest for digest, _, name in entries}


def _digest(file: Path) -> str:
    digest = hashlib.sha256()
    with file.open("rb") as stream:
        while block := stream.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()


def _copy(source: Path, target: Path) -> None:
    """The files of the generator's list, into an empty folder; all of them where there is none."""
    marker = _read_marker(source / MARKER) if (source / MARKER).is_file() else None
    for name in sorted(marker) if marker is not None else listed(source):
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source / name, target / name)
