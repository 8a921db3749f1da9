"""Reads the files that a mesh file references: an OBJ file's MTL, a glTF file's buffers, but no textures."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import NoReturn

import trimesh

from colonnade.common.errors import UserError
from colonnade.common.input_files import exists, read_input
from colonnade.common.limits import MAX_MESH_BYTES, MAX_TEXT_BYTES

#: A line of an MTL file that names a texture.
_TEXTURE = re.compile(rb"(?im)^[ \t]*(map_\w+|bump|disp|decal|refl|norm)[ \t].*$")
#: A line of an MTL file with numbers, which must be finite.
_NUMBERS = re.compile(rb"(?im)^[ \t]*(k[asde]|tf|ni|ns|d|tr|illum|p[rmsc]\w*)[ \t]+(.*)$")


class MeshResolver(trimesh.resolvers.FilePathResolver):  # type: ignore[misc]
    """Reads regular files in the mesh's folder and its subfolders.

    Attributes:
        refused: The first error. trimesh would ignore a missing file, so the caller must raise it.
    """

    def __init__(self, mesh: Path) -> None:
        super().__init__(str(mesh))
        self.refused: UserError | None = None
        self._suffix = mesh.suffix.lower()

    def get(self, name: str) -> bytes:
        """The content of the file ``name``, for trimesh."""
        if self._suffix not in (".obj", ".gltf", ".glb"):
            raise FileNotFoundError(name)
        path = self._find(name)
        try:
            if self._suffix != ".obj":
                return read_input(path, "the buffer", MAX_MESH_BYTES)
            return _checked_mtl(read_input(path, "the materials", MAX_TEXT_BYTES * 16), path)
        except UserError as error:
            self.refused = self.refused or error
            raise FileNotFoundError(name) from None

    def namespaced(self, namespace: str) -> NoReturn:
        """Refuse other folders."""
        raise FileNotFoundError(namespace)

    def _find(self, name: str) -> Path:
        parent = Path(self.parent).resolve()
        for candidate in (name.strip(), name.strip().lstrip("/"), name.rsplit("/", 1)[-1].strip()):
            try:
                path = (parent / candidate).resolve()
            except (OSError, ValueError, RuntimeError):
                continue
            if not exists(path):
                continue
            if path.is_relative_to(parent):
                return path
            outside = UserError(f"{name}, which a mesh references, is outside its folder {parent}: copy it there")
            self.refused = self.refused or outside
        raise FileNotFoundError(name)


def _checked_mtl(data: bytes, path: Path) -> bytes:
    """Remove the textures from an MTL file and check its numbers.

    Raises:
        UserError: A number is negative or not finite.
    """
    for line in _NUMBERS.finditer(data):
        for word in line[2].split():
            try:
                number = float(word)
            except ValueError:
                break
            if not math.isfinite(number) or number < 0:
                row = data.count(b"\n", 0, line.start()) + 1
                text = line[0].decode("latin-1").strip()
                raise UserError(f"{path}, line {row}: {text}: a material's numbers must be finite and not negative")
    return _TEXTURE.sub(b"", data)
