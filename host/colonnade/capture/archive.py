"""Reads single files of a ZIP archive of unknown origin; nothing is unpacked to disk.

A member's size is limited, and so is the list of members, which the library reads whole.
"""

from __future__ import annotations

import os
import struct
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from colonnade.common import ledger
from colonnade.common.errors import UserError
from colonnade.common.input_files import require_regular

#: Bytes of an archive, and of its list of members.
MAX_ARCHIVE, MAX_LIST = 1 << 34, 1 << 24
#: The end of the list: mark, bytes of the record, bytes that a comment may add. The mark of the record for large files.
_END, _END_BYTES, _COMMENT = b"PK\x05\x06", 22, 1 << 16
_LARGE, _LARGE_BYTES = b"PK\x06\x07", 20


class Archive:
    """An open archive."""

    def __init__(self, path: Path, file: zipfile.ZipFile) -> None:
        self.path, self._file = path, file

    def has(self, name: str) -> bool:
        """Whether there is a member of that name."""
        return name in self._file.NameToInfo

    def names(self) -> list[str]:
        """The names of all members."""
        return self._file.namelist()

    def read(self, name: str, maximum: int) -> bytes:
        """Unpack one member of at most ``maximum`` bytes."""
        if not self.has(name):
            raise UserError(f"{self.path} lacks {name}: the capture is not whole, export it again")
        if self._file.getinfo(name).file_size > maximum:
            raise UserError(f"{name} in {self.path} is too large: it may have {maximum:,} bytes")
        try:
            # The library stops at the size that the archive claims
            return self._file.read(name)
        except Exception as error:  # a damaged or encrypted member raises many types
            raise UserError(f"{name} in {self.path} is damaged: {type(error).__name__}: {error}") from None


@contextmanager
def opened(path: Path) -> Iterator[Archive]:
    """Open an archive.

    Raises:
        UserError: It is no regular file, too large, or damaged.
    """
    refused = require_regular(path, "the capture")
    with path.open("rb") as stream:
        status = os.fstat(stream.fileno())
        if not os.path.samestat(status, path.stat()):
            raise refused
        if status.st_size > MAX_ARCHIVE:
            raise UserError(f"the capture {path} is too large: it may have {MAX_ARCHIVE:,} bytes")
        ledger.add_input(path, status)
        stream.seek(max(0, status.st_size - _END_BYTES - _COMMENT - _LARGE_BYTES))
        tail = stream.read()
        at = tail.rfind(_END)
        if at < 0 or len(tail) - at < _END_BYTES:
            raise UserError(f"{path} is not a whole ZIP archive: it has no list of members, copy it again")
        (size,) = struct.unpack_from("<I", tail, at + 12)
        if size > MAX_LIST or tail[max(0, at - _LARGE_BYTES) : at].startswith(_LARGE):
            raise UserError(f"{path} has too many members: their list may have {MAX_LIST:,} bytes")
        try:
            file = zipfile.ZipFile(stream)
        except Exception as error:  # a damaged list raises many types
            raise UserError(f"{path} is not a whole ZIP archive: {error}") from None
        with file:
            yield Archive(path, file)
