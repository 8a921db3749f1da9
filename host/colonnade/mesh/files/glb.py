"""Writes binary glTF files."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

_FLOAT, _INDEX = 5126, 5125
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


class Glb:
    """The buffer of a file, and the views and accessors of it."""

    def __init__(self) -> None:
        self._body = bytearray()
        self._views: list[dict[str, int]] = []
        self._accessors: list[dict[str, Any]] = []

    def view(self, data: bytes) -> int:
        """Add bytes, such as those of a picture: the number of their view."""
        self._views.append({"buffer": 0, "byteOffset": len(self._body), "byteLength": len(data)})
        self._body += data + bytes(-len(data) % 4)
        return len(self._views) - 1

    def accessor(self, values: npt.NDArray[Any]) -> int:
        """Add an array [n, 1 to 4], as float32, or as uint32 if it is one of integers: the number of its accessor."""
        is_float = values.dtype.kind == "f"
        written = np.ascontiguousarray(values, dtype="<f4" if is_float else "<u4")
        entry = {
            "bufferView": self.view(written.tobytes()),
            "componentType": _FLOAT if is_float else _INDEX,
            "count": len(written),
            "type": _TYPES[written.shape[1]],
        }
        if np.isfinite(written).all() and len(written):
            entry |= {"min": written.min(axis=0).tolist(), "max": written.max(axis=0).tolist()}
        self._accessors.append(entry)
        return len(self._accessors) - 1

    def content(self, document: Mapping[str, Any]) -> bytes:
        """The file of a document, whose views, accessors and buffer are added; empty lists are left out."""
        whole = {
            "asset": {"version": "2.0"},
            **document,
            "accessors": self._accessors,
            "bufferViews": self._views,
            "buffers": [{"byteLength": len(self._body)}],
        }
        text = json.dumps({key: value for key, value in whole.items() if value != []}).encode()
        text += b" " * (-len(text) % 4)
        size = 28 + len(text) + len(self._body)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(self._body), b"BIN\0")
        return struct.pack("<4sII", b"glTF", 2, size) + chunks + self._body
