"""Checks the JSON of glTF files before it is used."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from colonnade.common.errors import UserError

#: Elements of an accessor, at most.
_MAX_ELEMENTS = 100_000_000


def check_gltf(document: Any, path: Path) -> None:
    """Refuse a glTF document with invalid accessors or materials, or whose nodes are not trees."""

    def fail(reason: str) -> UserError:
        return UserError(f"mesh {path}: {reason}: export it again")

    if not isinstance(document, Mapping):
        raise fail("its JSON is not an object")
    for key in (
        "nodes",
        "meshes",
        "accessors",
        "bufferViews",
        "buffers",
        "materials",
        "scenes",
        "textures",
        "images",
        "samplers",
    ):
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
