"""Reads STL files, after a check that they are whole.

This is our own code because trimesh prints a traceback for a facet normal that is no number, as some programs write.
"""

from __future__ import annotations

import re
import struct
from pathlib import Path

import numpy as np

from colonnade.common.errors import UserError
from colonnade.mesh.losses import FACET_COLOURS, SPARE_BYTES, Losses
from colonnade.mesh.materials.surface import RawSurface

#: Bytes before the facets of a binary file, and of a facet.
HEADER_BYTES, FACET_BYTES = 84, 50


def read_stl(data: bytes, path: Path, losses: Losses) -> RawSurface:
    """Read an STL file, ASCII or binary. Its normals are those of the facets.

    Raises:
        UserError: The file is invalid or truncated.
    """
    count = struct.unpack_from("<I", data, 80)[0] if len(data) >= HEADER_BYTES else 0
    is_binary = len(data) >= HEADER_BYTES and len(data) == HEADER_BYTES + FACET_BYTES * count
    if not is_binary and _is_ascii(data):
        facets, corners = (len(re.findall(word, data)) for word in (rb"(?i)\bfacet\s+normal\b", rb"(?i)\bvertex\b"))
        if corners != 3 * facets or len(re.findall(rb"(?i)\bendsolid\b", data)) == 0:
            raise UserError(
                f"mesh {path} is truncated: it begins {facets:,} facets and has {corners:,} of their vertices, and"
                f" {'no' if b'endsolid' not in data.lower() else 'an'} endsolid"
            )
        words = re.findall(rb"(?i)\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", data)
        if facets == 0:
            raise UserError(f"mesh {path} has no faces: its solids hold no facets")
        if len(words) != corners:
            raise UserError(f"mesh {path}: a vertex has fewer than 3 numbers")
        vertices = np.array(words).astype(np.float64).reshape(-1, 3)
    else:
        if len(data) < HEADER_BYTES:
            raise UserError(f"mesh {path} is truncated: a binary STL file has {HEADER_BYTES} bytes and its facets")
        present = (len(data) - HEADER_BYTES) // FACET_BYTES
        if present < count:
            raise UserError(f"mesh {path} is truncated: its header states {count:,} facets, it holds {present:,}")
        records = np.frombuffer(data, np.uint8, FACET_BYTES * count, HEADER_BYTES).reshape(-1, FACET_BYTES)
        losses.add(SPARE_BYTES, len(data) - HEADER_BYTES - FACET_BYTES * count)
        losses.add(FACET_COLOURS, int(records[:, 48:].any(axis=1).sum()))
        if count == 0:
            raise UserError(f"mesh {path} has no faces: its header states none")
        vertices = np.ascontiguousarray(records[:, 12:48]).view("<f4").reshape(-1, 3).astype(np.float64)
    return RawSurface(vertices, np.arange(len(vertices), dtype=np.int64).reshape(-1, 3))


def _is_ascii(data: bytes) -> bool:
    """Whether a file that is not whole as a binary one is text: some binary files begin with solid, too."""
    head = data[:4096].lower()
    return head.lstrip().startswith(b"solid") and (b"facet" in head or b"endsolid" in head)
