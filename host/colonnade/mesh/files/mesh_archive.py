"""Archives that hold a mesh: ZIP files whose directory is checked before anything is unpacked."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

from colonnade.common.errors import UserError
from colonnade.common.limits import MAX_MEMBER_BYTES
from colonnade.mesh.files.resolver import References
from colonnade.mesh.losses import Losses

#: Bytes to which an archive may unpack, and more for each of its own: text of meshes has some ten.
_UNPACKED, _UNPACKED_OF_A_BYTE = 1 << 26, 50
#: Elements and attributes of its text, and more for each byte of the archive: a triangle has four, in some five bytes.
_NODES, _NODES_OF_A_BYTE = 1 << 21, 2
#: How the names of members end that are text.
_TEXTS = (".dae", ".model", ".3dxml", ".3drep", ".xml", ".rels")


class MeshArchive:
    """A ZIP file in memory.

    Attributes:
        names: Of its members.
    """

    def __init__(self, data: bytes) -> None:
        """Read the directory.

        Raises:
            UserError: It unpacks to more than an archive of its size may.
            zipfile.BadZipFile: It is no archive.
        """
        self._file, self._bytes, self._nodes = zipfile.ZipFile(io.BytesIO(data)), len(data), 0
        self.names = self._file.namelist()
        size, limit = sum(one.file_size for one in self._file.infolist()), _UNPACKED + _UNPACKED_OF_A_BYTE * len(data)
        if size > limit:
            raise UserError(f"its archive unpacks to {size:,} bytes, one of its size to {limit:,} at most: repair it")

    def read(self, name: str) -> bytes:
        """A member, of which no more is unpacked than the directory states.

        Raises:
            UserError: It is no text and too large, or the text of the archive has too many elements.
            zipfile.BadZipFile: It is damaged.
        """
        size, is_text = self._file.getinfo(name).file_size, name.lower().endswith(_TEXTS)
        if size > MAX_MEMBER_BYTES and not is_text:
            raise UserError(f"{name} in its archive has {size:,} bytes: a picture may have {MAX_MEMBER_BYTES:,}")
        with self._file.open(name) as member:
            content = member.read(size)
        if is_text:
            self._nodes += content.count(b"<") + content.count(b"=")
            if self._nodes > (limit := _NODES + _NODES_OF_A_BYTE * self._bytes):
                raise UserError(f"its XML has more than {limit:,} elements and attributes: export it as glTF")
        return content


class ArchivePictures(References):
    """The pictures of a COLLADA archive."""

    def __init__(self, mesh: Path, data: bytes) -> None:
        super().__init__(mesh)
        self._archive = MeshArchive(data)

    def picture(self, name: str, losses: Losses) -> bytes | None:
        """The picture of a member that exists."""
        return self._archive.read(name)
