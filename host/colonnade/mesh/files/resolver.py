"""Reads the files that a mesh file references: an OBJ file's MTL, a glTF file's buffers, and pictures."""

from __future__ import annotations

from itertools import product
from pathlib import Path, PurePosixPath

from colonnade.common.errors import UserError
from colonnade.common.input_files import exists, read_input
from colonnade.common.limits import MAX_MESH_BYTES, MAX_PICTURE_BYTES, MAX_TEXT_BYTES
from colonnade.mesh import losses as lost
from colonnade.mesh.losses import Losses


class _OutsideFolder(UserError):
    """A file is outside of the mesh's folder."""


class References:
    """Reads regular files in the mesh's folder and its subfolders; names are relative to it or to an MTL file's.

    A name whose case differs is that of the only such file.
    """

    def __init__(self, mesh: Path) -> None:
        self._parent = mesh.parent.resolve()
        self._folders = [self._parent]

    def materials(self, name: str) -> tuple[bytes, Path] | None:
        """The content of an MTL file, and its place; None if it is missing.

        Raises:
            UserError: The file cannot be read, or is outside the folder.
        """
        path = self._find(name)
        if path is None:
            return None
        self._folders.append(path.parent)
        return read_input(path, "the materials", MAX_TEXT_BYTES * 16), path

    def buffer(self, name: str) -> bytes | None:
        """The content of a glTF buffer; None if it is missing.

        Raises:
            UserError: The file cannot be read, or is outside the folder.
        """
        path = self._find(name)
        return None if path is None else read_input(path, "the buffer", MAX_MESH_BYTES)

    def picture(self, name: str, losses: Losses) -> bytes | None:
        """The content of a texture's picture; None, and a loss, if it is missing or outside the folder.

        Raises:
            UserError: The file cannot be read.
        """
        loss = lost.NO_PICTURES
        try:
            path = self._find(name)
        except _OutsideFolder:
            path, loss = None, lost.OUTSIDE_PICTURES
        losses.add(loss, path is None, name)
        return None if path is None else read_input(path, "the texture", MAX_PICTURE_BYTES)

    def _find(self, name: str) -> Path | None:
        outside = False
        written = name.strip()
        of_windows = written.replace("\\", "/")
        candidates = (written, of_windows, of_windows.lstrip("/"), of_windows.split("/")[-1].strip())
        for place, candidate, folder in product((_exactly, _in_any_case), filter(None, candidates), self._folders):
            try:
                path = place(folder, candidate).resolve()
                if not exists(path):
                    continue
            except (OSError, ValueError, RuntimeError):
                continue
            if path.is_relative_to(self._parent):
                return path
            outside = True
        if outside:
            raise _OutsideFolder(
                f"{name}, which a mesh references, is outside its folder {self._parent}: copy it there"
            )
        return None


def _exactly(folder: Path, name: str) -> Path:
    return folder / name


def _in_any_case(folder: Path, name: str) -> Path:
    """The only file with a name but for its case.

    Raises:
        ValueError: There is none, or there are several.
    """
    for part in PurePosixPath(name).parts:
        (folder,) = (one for one in folder.iterdir() if one.name.casefold() == part.casefold())
    return folder
