"""The output folder of a study: written file by file, and taken again only while it holds what a study wrote.

``.colonnade.sha256`` gets a line with the SHA-256 of each file before the file appears, so a killed study may continue.
"""

from __future__ import annotations

import errno
import hashlib
import os
import stat
from collections import defaultdict
from pathlib import Path

from colonnade.common import ledger
from colonnade.common.atomic_files import check_writable, kind_of, make_folder, replacing
from colonnade.common.errors import UserError, reason_of
from colonnade.design.design_folder import MARKER, check_parent

from colonnade_lab.common.file_names import MAX_NAME

#: The files of an output folder, and its folders.
STUDY, TABLE, REPORT, PICTURES, PLOTS = "study.json", "points.csv", "report.html", "pictures", "plots"

#: First line of the list of files.
TITLE = "# Written by colonnade explore, which replaces only files that are as listed here."

#: Begin of the names of unfinished files, which a killed command leaves.
_UNFINISHED = ".colonnade."

_MAX_MARKER_BYTES = 1 << 26


def check_output(folder: Path) -> None:
    """Refuse a folder that a study cannot fill, or that holds anything but an earlier study.

    Raises:
        UserError: The message says what is in the way.
    """
    try:
        status = folder.lstat()
    except (FileNotFoundError, NotADirectoryError):
        check_parent(folder)
    except (OSError, ValueError) as error:
        reason = reason_of(error) if isinstance(error, OSError) else "this is not a file name"
        raise UserError(f"cannot write {str(folder)!r}: {reason}") from None
    else:
        if not stat.S_ISDIR(status.st_mode):
            raise UserError(f"{folder} is {kind_of(status)}: --output names a folder")
        try:
            refusal = _why_not_ours(folder)
        except OSError as error:
            raise UserError(f"cannot read {folder}: {reason_of(error)}") from None
        if refusal is not None:
            raise UserError(f"{folder} {refusal}: name another --output, or delete it first")
        check_writable(folder / STUDY)
    # The longest name below it
    longest = folder / PICTURES / f"{MAX_NAME * 'x'}.1000.png"
    try:
        longest.lstat()
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise UserError(f"cannot write {folder}: {reason_of(error)}") from None


class Output:
    """Writes an output folder that `check_output` accepts. Each file appears whole."""

    def __init__(self, folder: Path) -> None:
        """Make the folder.

        Raises:
            UserError: It cannot be made, or holds a file that this command reads.
        """
        self._folder = folder
        make_folder(folder)
        listed = _listed(folder) or {}
        self._known = {(name, digest) for name, digests in listed.items() for digest in digests}
        for name in {STUDY, TABLE, REPORT, *listed}:
            ledger.check_write(folder / name)
        marker = folder / MARKER
        if not marker.exists():
            self._append(f"{TITLE}\n")
        elif not marker.read_bytes().endswith(b"\n"):
            # A killed study cut its last line off
            self._append("\n")

    def write(self, path: Path, data: bytes) -> None:
        """Replace a file of the folder, or make it with its folders."""
        entry = path.relative_to(self._folder).as_posix(), hashlib.sha256(data).hexdigest()
        if entry not in self._known:
            self._append(f"{entry[1]}  {entry[0]}\n")
            self._known.add(entry)
        make_folder(path.parent)
        with replacing(path) as stream:
            stream.write(data)

    def _append(self, line: str) -> None:
        """Add a line to the list, in one call: other studies may write the same folder."""
        try:
            handle = os.open(self._folder / MARKER, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW, 0o666)
            try:
                os.write(handle, line.encode())
            finally:
                os.close(handle)
        except OSError as error:
            raise UserError(f"cannot write {self._folder / MARKER}: {reason_of(error)}") from None


def _why_not_ours(folder: Path) -> str | None:
    """Why a study did not write the folder; None if it did, or if the folder is empty."""
    # Check the list first: walking a folder such as / takes minutes
    if not any(folder.iterdir()):
        return None
    listed = _listed(folder)
    if listed is None:
        return f"holds files, but no {MARKER} of colonnade explore"
    for parent, folders, files in os.walk(folder):
        for name in folders + files:
            path = Path(parent, name)
            relative = path.relative_to(folder).as_posix()
            mode = path.lstat().st_mode
            is_own_folder = stat.S_ISDIR(mode) and relative in (PICTURES, PLOTS)
            is_unfinished = stat.S_ISREG(mode) and name.startswith(_UNFINISHED)
            if is_own_folder or is_unfinished:
                continue
            if not stat.S_ISREG(mode) or relative not in listed:
                return f"holds {relative}, which colonnade explore did not write"
            if hashlib.sha256(path.read_bytes()).hexdigest() not in listed[relative]:
                return f"holds {relative}, which was changed after colonnade explore wrote it"
    return None


def _listed(folder: Path) -> dict[str, set[str]] | None:
    """The SHA-256 that each file of a study had; None if no study wrote the folder."""
    file = folder / MARKER
    if not file.is_file() or file.is_symlink():
        return None
    if file.stat().st_size > _MAX_MARKER_BYTES:
        return None
    title, *lines = file.read_bytes().decode("utf-8", "replace").split("\n")
    if title != TITLE:
        return None
    found: dict[str, set[str]] = defaultdict(set)
    # The last line may be cut off: its file did not appear
    for line in lines[:-1]:
        digest, _, name = line.partition("  ")
        found[name].add(digest)
    return found
