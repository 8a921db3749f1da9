"""Writes the output folder of ``generate``, and replaces only folders that it wrote itself.

``.colonnade.sha256`` lists the SHA-256 of every other file, in the format of ``sha256sum --check``. A folder is
replaced only if it is empty, or if it contains exactly the listed files, unchanged. The generator
(`DesignMarker.scala`) follows the same rule.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import stat
from pathlib import Path

from colonnade.common.atomic_files import kind_of, make_folder
from colonnade.common.errors import UserError, reason_of
from colonnade.common.input_files import sha256_of
from colonnade.common.temporary import replace, temporary_folder

#: Name of the file list.
MARKER = ".colonnade.sha256"
#: First line of the file list; ``sha256sum`` skips it.
TITLE = "# Written by colonnade generate, which replaces this folder only while its files are as listed here."

_MAX_MARKER_BYTES = 1 << 24


def check_replaceable(output: Path) -> None:
    """Refuse an existing output that is neither an empty folder nor an unchanged design.

    Raises:
        UserError: The output must not or cannot be replaced; the message says why.
    """
    try:
        status = output.lstat()
    except (FileNotFoundError, NotADirectoryError):
        check_parent(output)
        return
    except (OSError, ValueError) as error:
        reason = reason_of(error) if isinstance(error, OSError) else "this is not a file name"
        raise UserError(f"cannot write {str(output)!r}: {reason}") from None
    if not stat.S_ISDIR(status.st_mode):
        raise UserError(f"{output} is {kind_of(status)}: --output names a folder")
    with contextlib.suppress(OSError):
        if output.samefile(Path.cwd()):
            raise UserError(f"{output} is the working directory, which cannot be replaced: name a folder in it")
    check_parent(output)
    try:
        refusal = _why_not_ours(output)
    except OSError as error:
        raise UserError(f"cannot read {output}: {reason_of(error)}") from None
    if refusal is not None:
        raise UserError(f"{output} {refusal}, so it is not replaced: name another --output, or delete it first")


def holds(folder: Path, file: Path) -> bool:
    """Whether the path of the file is below the folder; neither needs to exist."""
    return folder.resolve() in file.resolve().parents


def listed(folder: Path) -> list[str]:
    """Relative names of a folder's files except the marker, sorted."""
    return sorted(
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and path.relative_to(folder).as_posix() != MARKER
    )


def write_marker(folder: Path) -> None:
    """Write the marker of a complete folder."""
    lines = [f"{sha256_of(folder / name)}  {name}" for name in listed(folder)]
    (folder / MARKER).write_text("\n".join([TITLE, *lines]) + "\n", encoding="utf-8")


def replace_folder(source: Path, output: Path) -> None:
    """Replace ``output`` by a copy of the design in ``source``; an error changes nothing.

    Raises:
        UserError: ``output`` must not be replaced, or cannot be written.
    """
    check_replaceable(output)
    make_folder(output.parent)
    try:
        with temporary_folder(".colonnade.", output.parent) as fresh:
            _copy(source, fresh)
            write_marker(fresh)
            # The output may have changed during the copy
            check_replaceable(output)
            replace(fresh, output)
    except OSError as error:
        raise UserError(f"cannot write {output}: {reason_of(error)}") from None


def check_parent(output: Path) -> None:
    """The nearest existing parent of the output must be a writable folder."""
    parent = output.absolute().parent
    while not parent.exists() and parent != parent.parent:
        parent = parent.parent
    if not parent.is_dir():
        raise UserError(f"{parent} is not a folder: name another --output than {output}")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise UserError(f"{parent} is not writable: name another folder for {output.name}")


def _why_not_ours(folder: Path) -> str | None:
    """The reason why a folder is not an unchanged design; None for such a design or an empty folder."""
    # Check the marker first: walking a folder such as / takes minutes
    if not any(folder.iterdir()):
        return None
    if not (folder / MARKER).is_file() or (folder / MARKER).is_symlink():
        return f"holds files, but no {MARKER} of colonnade generate"
    found: set[str] = set()
    folders: set[str] = set()
    for parent, subfolders, files in os.walk(folder):
        for name in subfolders + files:
            path = Path(parent, name)
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
        if sha256_of(folder / name) != digest:
            return f"holds {name}, which was changed after colonnade generate wrote it"
    return None


def _read_marker(file: Path) -> dict[str, str] | None:
    """Parse a marker into SHA-256 by file name; None if it is invalid."""
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


def _copy(source: Path, target: Path) -> None:
    """Copy the files that the generator's marker lists into an empty folder; without a marker, copy all."""
    marker = _read_marker(source / MARKER) if (source / MARKER).is_file() else None
    for name in sorted(marker) if marker is not None else listed(source):
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source / name, target / name)
