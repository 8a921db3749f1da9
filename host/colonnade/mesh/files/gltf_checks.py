"""Checks the JSON of glTF files before it is used."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from colonnade.common.errors import UserError
from colonnade.mesh.materials.materials import USED_EXTENSIONS

DRACO = "KHR_draco_mesh_compression"
#: The extension of a node that has copies of its mesh.
INSTANCING = "EXT_mesh_gpu_instancing"
#: Extensions whose content is read, and checked.
READ_EXTENSIONS = (
    *USED_EXTENSIONS,
    DRACO,
    "KHR_mesh_quantization",
    "KHR_lights_punctual",
    "KHR_texture_transform",
    "KHR_texture_basisu",
    INSTANCING,
    "EXT_texture_webp",
    "EXT_texture_avif",
)
#: Elements of an accessor, at most.
_MAX_ELEMENTS = 100_000_000


#: The lists of a document.
_LISTS = (
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
    "animations",
    "skins",
)
#: Keys at any depth whose values are whole numbers from 0 on, texts, objects, and lists of these.
_WHOLE = {"mesh", "material", "bufferView", "buffer", "source", "sampler", "index", "texCoord", "byteOffset"}
_WHOLE |= {"byteLength", "byteStride", "componentType", "mode", "skin", "wrapS", "wrapT", "magFilter", "minFilter"}
_WHOLE |= {"node", "input", "output", "inverseBindMatrices"}
_TEXT = {"uri", "mimeType", "alphaMode"}
_OBJECT = {"attributes", "extensions", "pbrMetallicRoughness", "sparse", "values"}
_OBJECT |= {"baseColorTexture", "metallicRoughnessTexture", "normalTexture", "occlusionTexture", "emissiveTexture"}
_OBJECTS, _WHOLES = {"primitives", "targets", "channels", "samplers"}, {"nodes", "children", "joints"}


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 1 << 53


def _check_types(value: Any, where: str, fail: Callable[[str], UserError]) -> None:
    """Refuse an object of a document with values of other types than glTF's."""
    if isinstance(value, list):
        for number, entry in enumerate(value):
            _check_types(entry, f"{where}[{number}]", fail)
    if not isinstance(value, Mapping):
        return
    for key, entry in value.items():
        entries = entry if isinstance(entry, list) else [None]
        if key in _WHOLE and not _is_whole(entry):
            raise fail(f"{where}.{key} is not a whole number from 0 on")
        if key in _TEXT and not isinstance(entry, str):
            raise fail(f"{where}.{key} is not text")
        if key in _OBJECT and not isinstance(entry, Mapping):
            raise fail(f"{where}.{key} is not an object")
        if key == "extensions" and not all(isinstance(extension, Mapping) for extension in entry.values()):
            raise fail(f"{where}.{key} has a value that is not an object")
        if key in _OBJECTS and not all(isinstance(one, Mapping) for one in entries):
            raise fail(f"{where}.{key} is not a list of objects")
        if key in _WHOLES and not all(map(_is_whole, entries)):
            raise fail(f"{where}.{key} is not a list of whole numbers")
        if key == "attributes" and not all(map(_is_whole, entry.values())):
            raise fail(f"{where}.{key} has a value that is not a whole number")
        if key == "extensions":
            entry = {name: entry[name] for name in READ_EXTENSIONS if name in entry}
        if key != "extras":
            _check_types(entry, f"{where}.{key}", fail)


def check_gltf(document: Any, path: Path) -> None:
    """Refuse a glTF document with invalid accessors or materials, or whose nodes are not trees."""

    def fail(reason: str) -> UserError:
        return UserError(f"mesh {path}: {reason}: export it again")

    if not isinstance(document, Mapping):
        raise fail("its JSON is not an object")
    asset = document.get("asset", {})
    version = asset.get("version") if isinstance(asset, Mapping) else None
    # Files of version 1, whose lists are objects, need not name it
    if str(version).startswith("1") or (version is None and isinstance(document.get("nodes"), Mapping)):
        raise UserError(f"mesh {path}: it is glTF of version 1: export it as glTF 2.0")
    for key in _LISTS:
        entries = document.get(key, [])
        if not isinstance(entries, list) or not all(isinstance(entry, Mapping) for entry in entries):
            raise fail(f"{key} must be a list of objects")
        _check_types(entries, key, fail)
    if not _is_whole(document.get("scene", 0)) or not isinstance(document.get("extensions", {}), Mapping):
        raise fail("its scene is not a whole number, or its extensions are not an object")
    required = document.get("extensionsRequired", [])
    if not isinstance(required, list) or not all(isinstance(name, str) for name in required):
        raise fail("extensionsRequired is not a list of texts")
    for number, accessor in enumerate(document.get("accessors", [])):
        sparse = accessor.get("sparse", {"count": 0, "indices": {}, "values": {}})
        parts = (sparse.get("indices"), sparse.get("values"))
        if not all(isinstance(part, Mapping) for part in parts) or not isinstance(accessor.get("type", ""), str):
            raise fail(f"accessor {number} has an invalid type, or lacks indices or values")
        is_sparse = "sparse" in accessor
        if is_sparse and not (_is_whole(sparse.get("count")) and all("bufferView" in part for part in parts)):
            raise fail(f"accessor {number} lacks a part of its changes")
        if is_sparse and parts[0].get("componentType") not in (5121, 5123, 5125):
            raise fail(f"accessor {number} has indices of an unknown type")
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
    emission = material.get("emissiveFactor", [])
    for factors in (colour, emission):
        values += factors if isinstance(factors, list) else [None]
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
