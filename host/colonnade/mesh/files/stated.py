"""How many triangles a mesh file states: from its header, or by a count of its lines, before it is read."""

from __future__ import annotations

import re
import struct
from pathlib import Path

from colonnade.common.input_files import read_input
from colonnade.common.limits import MAX_MESH_BYTES
from colonnade.mesh.files.gltf_document import GltfDocument
from colonnade.mesh.files.resolver import References

#: Bytes before the facets of a binary STL file, and of a facet.
HEADER_BYTES, FACET_BYTES = 84, 50
#: Bytes in which a header ends.
_HEAD = 1 << 16


def stated_triangles(path: Path) -> int:
    """The least number of triangles of a file; 0 if it states none, or cannot be read, of which its reader tells."""
    try:
        return _FORMATS.get(path.suffix.lower(), lambda _: 0)(path)
    except Exception:  # of many types, on invalid data
        return 0


def _read(path: Path, first: int | None = None) -> bytes:
    return read_input(path, "the mesh", MAX_MESH_BYTES, first=first)


def _of_ply(path: Path) -> int:
    head = _read(path, _HEAD).partition(b"end_header")[0]
    found = re.search(rb"(?m)^element[ \t]+face[ \t]+([0-9]{1,18})\s*$", head)
    return 0 if found is None else int(found[1])


def _of_off(path: Path) -> int:
    text = re.sub(rb"#[^\r\n]*", b"", _read(path, _HEAD))
    found = re.match(rb"\s*[A-Z]*OFF\s*[0-9]{1,18}\s+([0-9]{1,18})\s", text)
    return 0 if found is None else int(found[1])


def _of_stl(path: Path) -> int:
    head = _read(path, HEADER_BYTES)
    count = struct.unpack_from("<I", head, HEADER_BYTES - 4)[0] if len(head) == HEADER_BYTES else 0
    if path.stat().st_size == HEADER_BYTES + FACET_BYTES * count:
        return int(count)
    return _read(path).count(b"endfacet")


def _of_obj(path: Path) -> int:
    data = _read(path)
    return data.count(b"\nf ") + data.count(b"\nf\t")


def _of_gltf(path: Path) -> int:
    head = _read(path, 20)
    if head[:4] != b"glTF" or len(head) < 20:
        return GltfDocument(_read(path), path, References(path)).triangles()
    (length,) = struct.unpack_from("<I", head, 12)
    return GltfDocument(_read(path, 20 + length)[20:], path, References(path)).triangles()


_FORMATS = {
    ".ply": _of_ply,
    ".off": _of_off,
    ".stl": _of_stl,
    ".obj": _of_obj,
    ".gltf": _of_gltf,
    ".glb": _of_gltf,
}
