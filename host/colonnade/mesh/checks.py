"""Checks mesh files for errors that trimesh would accept silently or crash on."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from colonnade.common.errors import UserError

_FACE = re.compile(rb"(?m)^[ \t]*f[ \t]+([^\r\n#]*)")
_VERTEX = re.compile(rb"(?m)^[ \t]*v[ \t]")
#: Elements of an accessor, at most.
_MAX_ELEMENTS = 100_000_000


def check_obj(data: bytes, path: Path) -> None:
    """Refuse an OBJ file whose faces name vertex 0 or a missing vertex."""
    joined = re.sub(rb"\\\r?\n", b" ", data)
    vertices = sum(1 for _ in _VERTEX.finditer(joined))
    corners = re.sub(rb"/\S*", b"", b" ".join(face[1] for face in _FACE.finditer(joined))).split()
    try:
        indices = [int(corner) for corner in corners]
    except ValueError:
        raise UserError(f"mesh {path}: a vertex index of a face is not an integer") from None
    if not indices:
        return
    if 0 in indices:
        raise UserError(f"mesh {path}: a face names vertex 0; OBJ files number vertices from 1")
    for worst in (min(indices), max(indices)):
        if abs(worst) > vertices:
            raise UserError(f"mesh {path}: a face names vertex {worst}, but the file has {vertices:,} vertices")


def check_ply(data: bytes, path: Path) -> None:
    """Refuse a PLY file with fewer elements than its header states."""
    header, mark, body = data.partition(b"end_header")
    counts = [int(count) for count in re.findall(rb"(?m)^element[ \t]+\S+[ \t]+(\d{1,18})[ \t]*\r?$", header)]
    # An element takes one line in ASCII, and at least one byte in binary
    capacity = len(body.split(b"\n")) if re.search(rb"(?m)^format[ \t]+ascii", header) else len(body)
    if not mark:
        raise UserError(f"{path} cannot be read as a mesh: its PLY header has no end")
    if sum(counts) > capacity:
        raise UserError(f"mesh {path} is truncated: its header states {sum(counts):,} elements")


def check_gltf(document: Any, path: Path) -> None:
    """Refuse a glTF document with invalid accessors or materials, or whose nodes are not trees."""

    def fail(reason: str) -> UserError:
        return UserError(f"mesh {path}: {reason}: export it again")

    if not isinstance(document, Mapping):
        raise fail("its JSON is not an object")
    for key in ("nodes", "meshes", "accessors", "bufferViews", "buffers", "materials", "scenes"):
        entries = document.get(key, [])
        if not isinstance(entries, list) or not all(isinstance(entry, Mapping) for entry in entries):
            raise fail(f"{key} must be a list of objects")
    for number, accessor in enumerate(document.get("accessors", [])):
        count = accessor.get("count")
        if not isinstance(count, int) or isinstance(count, bool) or not 0 < count <= _MAX_ELEMENTS:
            raise fail(f"accessor {number} has an invalid count")
    for number, material in enumerate(document.get("materials", [])):
        if not _has_valid_factors(material):
            raise fail(f"material {number} has a factor that is negative or not a number")
    _check_nodes(document.get("nodes", []), fail)


def _has_valid_factors(material: Mapping[str, Any]) -> bool:
    """Whether all used factors are non-negative numbers."""
    surface, extensions = material.get("pbrMetallicRoughness", {}), material.get("extensions", {})
    if not isinstance(surface, Mapping) or not isinstance(extensions, Mapping):
        return False
    values = [surface.get("metallicFactor", 1.0)]
    colour = surface.get("baseColorFactor", [])
    values += colour if isinstance(colour, list) else [None]
    for name, key in (("transmission", "transmissionFactor"), ("ior", "ior")):
        extension = extensions.get(f"KHR_materials_{name}", {})
        values.append(extension.get(key, 0.0) if isinstance(extension, Mapping) else None)
    return all(isinstance(value, int | float) and not isinstance(value, bool) and value >= 0 for value in values)


def _check_nodes(nodes: list[Mapping[str, Any]], fail: Callable[[str], UserError]) -> None:
    """Refuse nodes with two parents or in a cycle."""
    parents: dict[int, int] = {}
    for number, node in enumerate(nodes):
        children = node.get("children", [])
        if not isinstance(children, list):
            raise fail(f"the children of node {number} must be a list")
        for child in children:
            if not isinstance(child, int) or isinstance(child, bool) or not 0 <= child < len(nodes):
                raise fail(f"node {number} has a child that does not exist")
            if child in parents:
                raise fail(f"node {child} has two parents")
            parents[child] = number
    is_rooted: dict[int, bool] = {}
    for number in range(len(nodes)):
        path, ancestor = [], number
        while ancestor in parents and ancestor not in is_rooted:
            path.append(ancestor)
            is_rooted[ancestor] = False
            ancestor = parents[ancestor]
        if not is_rooted.get(ancestor, True):
            raise fail(f"node {ancestor} is its own ancestor")
        is_rooted.update(dict.fromkeys(path, True))
