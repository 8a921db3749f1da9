"""The document of a glTF file: its JSON, its buffers, and the arrays of its accessors."""

from __future__ import annotations

import base64
import binascii
import struct
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt

from colonnade.common.errors import UserError
from colonnade.common.input_files import parse_json
from colonnade.mesh.files.gltf_checks import check_gltf
from colonnade.mesh.files.resolver import References

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
#: Extensions that compress the mesh, and are not supported.
COMPRESSION = ("EXT_meshopt_compression", "KHR_meshopt_compression")
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


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
        self._path, self._references, self._kind = path, references, kind
        self._binary: bytes | None = None
        text = data
        if data[:4] == b"glTF":
            text, self._binary = self._chunks(data)
        self.json: Mapping[str, Any] = parse_json(
            text, f"{path} cannot be read as a mesh: its glTF document", len(data)
        )
        check_gltf(self.json, path)

    def error(self, reason: str) -> UserError:
        """An error of this file."""
        return UserError(f"{self._kind} {self._path}: {reason}")

    def compressed(self, name: str) -> UserError:
        """The error of a file whose meshes an extension compresses."""
        return self.error(f"its meshes are compressed ({name}): export it without compression")

    def _chunks(self, data: bytes) -> tuple[bytes, bytes | None]:
        """The JSON of a binary file, and the chunk after it."""
        version = struct.unpack_from("<I", data, 4)[0] if len(data) >= 12 else 0
        if version == 1:
            raise UserError(f"{self._path} cannot be read as a mesh: it is glTF of version 1: export it as glTF 2.0")
        chunks: list[tuple[bytes, bytes]] = []
        at = 12
        while at + 8 <= len(data) and len(chunks) < 2:
            length, kind = struct.unpack_from("<I4s", data, at)
            if length > len(data) - at - 8:
                raise UserError(
                    f"mesh {self._path} is truncated: a part of {length:,} bytes begins, {len(data) - at - 8:,} follow"
                )
            chunks.append((kind, data[at + 8 : at + 8 + length]))
            at += 8 + length
        if not chunks or chunks[0][0] != b"JSON":
            raise UserError(f"{self._path} cannot be read as a mesh: it is not a binary glTF file of version 2")
        return chunks[0][1], chunks[1][1] if len(chunks) > 1 and chunks[1][0] == b"BIN\0" else None

    def entry(self, kind: str, index: Any) -> Mapping[str, Any]:
        """An entry of one of the document's lists, such as ``meshes``."""
        entries = self.json.get(kind, [])
        if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(entries):
            raise self.error(f"{kind}[{index}] is used, but does not exist: export it again")
        entry: Mapping[str, Any] = entries[index]
        return entry

    def array(self, index: Any) -> npt.NDArray[Any]:
        """The elements of an accessor, [count, components]; normalised integers as float64."""
        accessor, kind, width = self._typed(index)
        count = int(accessor["count"])
        if "bufferView" in accessor:
            values = self._view(accessor["bufferView"], accessor.get("byteOffset", 0), kind, count, width)
        elif "sparse" in accessor:
            values = np.zeros((count, width), dtype=kind)
        else:
            raise self.error(f"accessor {index} has no data, as of a compressed mesh: export it without compression")
        return self._changed(_scaled(values, kind) if accessor.get("normalized") else values, accessor, kind)

    def decoded(self, index: Any, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """The elements of a compressed accessor, as of `array`, from those of a decoder."""
        accessor, kind, width = self._typed(index)
        if values.shape[1] != width:
            raise self.error(f"accessor {index} has {width} components, its compressed data {values.shape[1]}")
        # Draco's decoder normalises signed integers itself
        is_scaled = values.dtype.kind == "f" and bool((np.abs(values) <= 1.0).all())
        values = _scaled(values, kind) if accessor.get("normalized") and not is_scaled else values
        return self._changed(values, accessor, kind)

    def _typed(self, index: Any) -> tuple[Mapping[str, Any], str, int]:
        """An accessor, the type of its components as of numpy, and their number."""
        accessor = self.entry("accessors", index)
        kind, width = _COMPONENTS.get(accessor.get("componentType", 0)), _WIDTHS.get(accessor.get("type", ""))
        if kind is None or width is None:
            raise self.error(f"accessor {index} has an unknown type")
        return accessor, kind, width

    def _changed(self, values: npt.NDArray[Any], accessor: Mapping[str, Any], kind: str) -> npt.NDArray[Any]:
        """The elements of an accessor with the changes that it states, if it is sparse."""
        if "sparse" not in accessor:
            return values
        sparse = accessor["sparse"]
        count, rows, changes = int(sparse["count"]), sparse["indices"], sparse["values"]
        index_kind = _COMPONENTS[rows["componentType"]]
        indices = self._view(rows["bufferView"], rows.get("byteOffset", 0), index_kind, count, 1)[:, 0]
        if len(indices) and int(indices.max()) >= len(values):
            raise self.error(f"a sparse accessor changes element {indices.max()} of {len(values):,}")
        changed = self._view(changes["bufferView"], changes.get("byteOffset", 0), kind, count, values.shape[1])
        values = values.copy()
        values[indices] = _scaled(changed, kind) if accessor.get("normalized") else changed
        return values

    def _view(self, index: Any, offset: Any, kind: str, count: int, width: int) -> npt.NDArray[Any]:
        """Elements of a buffer view, [count, width]."""
        view = self.entry("bufferViews", index)
        buffer = self._buffer(view.get("buffer"))
        element = np.dtype(kind).itemsize * width
        start, stride = view.get("byteOffset", 0) + offset, view.get("byteStride") or element
        end = start + (count - 1) * stride + element
        size = min(len(buffer), view.get("byteOffset", 0) + view.get("byteLength", 0))
        if min(start, offset, count, stride - element) < 0 or end > size:
            raise self.error(f"bufferViews[{index}] is too short for {count:,} elements: the file may be truncated")
        steps = np.ndarray((count, width), dtype=kind, buffer=buffer, offset=start, strides=(stride, element // width))
        return np.array(steps)

    def view_bytes(self, index: Any) -> bytes:
        """The bytes of a buffer view, such as a picture."""
        size = self.entry("bufferViews", index).get("byteLength", 0)
        if not isinstance(size, int) or isinstance(size, bool) or size < 1:
            raise self.error(f"bufferViews[{index}] is empty: export it again")
        return self._view(index, 0, "<u1", size, 1).tobytes()

    def embedded(self, uri: str, name: str) -> bytes:
        """The content of a ``data:`` URI."""
        try:
            return base64.b64decode(uri.partition(",")[2], validate=True)
        except (ValueError, binascii.Error):
            raise self.error(f"the data of {name} are not base64") from None

    def _buffer(self, index: Any) -> bytes:
        self.entry("buffers", index)
        if index not in self._buffers:
            self._buffers[index] = self._read_buffer(index)
        return self._buffers[index]

    @cached_property
    def _buffers(self) -> dict[int, bytes]:
        return {}

    def _read_buffer(self, index: int) -> bytes:
        buffer = self.entry("buffers", index)
        uri = buffer.get("uri")
        if uri is None:
            if name := next(iter(buffer.get("extensions", {}).keys() & set(COMPRESSION)), None):
                raise self.compressed(name)
            if index != 0 or self._binary is None:
                raise self.error(f"buffer {index} has no data")
            return self._binary
        if not isinstance(uri, str):
            raise self.error(f"the uri of buffer {index} is not text")
        if uri.startswith("data:"):
            return self.embedded(uri, f"buffer {index}")
        content = self._references.buffer(unquote(uri))
        if content is None:
            raise self.error(f"its buffer {uri} is missing: copy it beside the mesh")
        return content


def _scaled(values: npt.NDArray[Any], kind: str) -> npt.NDArray[Any]:
    """Normalised integers of a type as float64, -1 to 1; floats as they are."""
    return values if kind == "<f4" else np.maximum(values / np.iinfo(kind).max, -1.0)
