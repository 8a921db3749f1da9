"""The document of a glTF file, its JSON and arrays, read by ``cpp/mesh/files``, which the browser tab shares."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.mesh.clips.clip import Nodes
from colonnade.mesh.files.resolver import References
from colonnade.mesh.losses import Losses

DRACO = "KHR_draco_mesh_compression"
#: The extension of a node that has copies of its mesh.
INSTANCING = "EXT_mesh_gpu_instancing"
#: Extensions that compress the mesh, and are not supported.
COMPRESSION = ("EXT_meshopt_compression", "KHR_meshopt_compression")

_Result = TypeVar("_Result")


class GltfDocument:
    """A glTF 2.0 file, as text or binary.

    Attributes:
        json: The checked JSON object.
    """

    def __init__(self, data: bytes, path: Path, references: References, kind: str = "mesh") -> None:
        """Parse the file; ``kind`` names it in messages.

        Raises:
            UserError: The JSON or the container is invalid.
        """
        from colonnade import _core

        self._path, self._references, self._kind = path, references, kind
        self._file = _core.GltfFile(os.fsencode(path), kind)
        self._tried(lambda: self._file.begin(data))
        self.json: Mapping[str, Any] = json.loads(self._file.text())

    def error(self, reason: str) -> UserError:
        """An error of this file."""
        return UserError(f"{self._kind} {self._path}: {reason}")

    def compressed(self, name: str) -> UserError:
        """The error of a file whose meshes an extension compresses."""
        return self.error(f"its meshes are compressed ({name}): export it without compression")

    def check_extensions(self) -> None:
        """Refuse a file that requires an extension that is not read."""
        self._tried(self._file.check_extensions)

    def entry(self, kind: str, index: Any) -> Mapping[str, Any]:
        """An entry of one of the document's lists, such as ``meshes``."""
        entries = self.json.get(kind, [])
        if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(entries):
            raise self.error(f"{kind}[{index}] is used, but does not exist: export it again")
        entry: Mapping[str, Any] = entries[index]
        return entry

    def array(self, index: Any) -> npt.NDArray[Any]:
        """The elements of an accessor, int64 or float64 [count, components]; normalised integers as float64."""
        self.entry("accessors", index)
        return self._found(lambda: self._file.array(index))

    def decoded(self, index: Any, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """The elements of a compressed accessor, as of `array`, from those of a decoder."""
        self.entry("accessors", index)
        rows = np.ascontiguousarray(values, dtype=np.float64)
        return self._found(lambda: self._file.array(index, rows, values.dtype.kind in "iu"))

    def view_bytes(self, index: Any) -> bytes:
        """The bytes of a buffer view, such as a picture."""
        self.entry("bufferViews", index)
        content: bytes = self._found(lambda: self._file.view_bytes(index))
        return content

    def image(self, index: Any) -> tuple[bytes | None, str | None]:
        """The bytes of an image, or the name of its file."""
        self.entry("images", index)
        content, name = self._found(lambda: self._file.image(index))
        return content, None if name is None else os.fsdecode(name)

    def nodes(self) -> Nodes:
        """All nodes, those outside of the default scene, too."""
        parents, order, *parts = self._tried(self._file.nodes)
        return Nodes(tuple(parents.tolist()), tuple(order.tolist()), *parts)

    def placements(self, losses: Losses, *, is_animated: bool) -> list[tuple[int, Floats]]:
        """The nodes with a mesh of the default scene, by number, and their transforms to the scene, float64 [c, 4, 4].

        A node has one for each copy of its mesh; if it is animated, one.
        """
        placed, lost = self._found(lambda: self._file.placements(is_animated))
        losses.take(lost)
        return list(placed)

    def triangles(self) -> int:
        """The triangles of the default scene, with all copies, by the counts of accessors."""
        return int(self._tried(self._file.triangles))

    def _found(self, ask: Callable[[], _Result | None]) -> _Result:
        """What the reader finds when it has the buffers that it needs."""
        while (found := self._tried(ask)) is None:
            content = self._references.buffer(os.fsdecode(self._file.buffer_file()))
            self._tried(lambda content=content: self._file.give(content))  # type: ignore[misc]
        return found

    def _tried(self, ask: Callable[[], _Result]) -> _Result:
        try:
            return ask()
        except ValueError:
            raise UserError(self._file.refusal().decode("utf-8", "surrogateescape")) from None
