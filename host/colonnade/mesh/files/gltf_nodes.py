"""The nodes of a glTF file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from colonnade.common import fixed_order
from colonnade.common.types import Floats
from colonnade.mesh import losses as lost
from colonnade.mesh.clips.clip import Nodes, rotations
from colonnade.mesh.files.gltf_document import INSTANCING, GltfDocument
from colonnade.mesh.losses import Losses

#: Components of the attributes of copies of a mesh.
_OF_COPIES = {"TRANSLATION": 3, "ROTATION": 4, "SCALE": 3}
#: Nodes with a mesh, with the copies of each, at most.
MAX_COPIES = 1 << 16
#: Largest magnitude of a transform's element, in the scene.
_MAX_TRANSFORM = 1e100
#: Modes of primitives.
TRIANGLES, STRIP, FAN = 4, 5, 6


def mesh_nodes(
    document: GltfDocument, losses: Losses, *, is_animated: bool = False
) -> Iterator[tuple[int, Mapping[str, Any], Floats]]:
    """The nodes with a mesh of the default scene, with their numbers, and transforms to the scene, float64 [c, 4, 4].

    A node has one for each copy of its mesh; if it is animated, one.
    """
    losses.add(lost.SCENES, len(document.json.get("scenes", [])) - 1)
    pending, count = [(root, np.eye(4)) for root in reversed(_roots(document))], 0
    while pending:
        index, parent = pending.pop()
        node = document.entry("nodes", index)
        matrix = _finite(document, index, fixed_order.product(parent, _local(document, index, node)))
        pending += [(child, matrix) for child in reversed(node.get("children", []))]
        if "mesh" not in node:
            continue
        extension = node.get("extensions", {}).get(INSTANCING)
        count += 1 if extension is None else _copy_count(document, extension)
        if count > MAX_COPIES:
            raise document.error(f"it has more than {MAX_COPIES:,} copies of meshes: leave some out, or join them")
        copies = np.eye(4)[np.newaxis] if extension is None else _copies(document, index, extension)
        if is_animated:
            losses.add(lost.BENT_COPIES, len(copies) - 1)
            copies = np.eye(4)[np.newaxis]
        yield index, node, _finite(document, index, fixed_order.product(matrix, copies))


def _roots(document: GltfDocument) -> list[int]:
    """The nodes of the default scene."""
    json = document.json
    if json.get("scenes", []):
        return list(document.entry("scenes", json.get("scene", 0)).get("nodes", []))
    nodes = json.get("nodes", [])
    children = {child for node in nodes for child in node.get("children", [])}
    return [index for index in range(len(nodes)) if index not in children]


def triangles_of(document: GltfDocument) -> int:
    """The triangles of the default scene, with all copies, by the counts of accessors."""
    meshes: dict[int, int] = {}
    pending, count = _roots(document), 0
    while pending:
        node = document.entry("nodes", pending.pop())
        pending += node.get("children", [])
        if "mesh" not in node:
            continue
        if (mesh := node["mesh"]) not in meshes:
            primitives = document.entry("meshes", mesh).get("primitives", [])
            meshes[mesh] = sum(_triangles_of(document, primitive) for primitive in primitives)
        extension = node.get("extensions", {}).get(INSTANCING)
        count += meshes[mesh] * (1 if extension is None else _copy_count(document, extension))
    return count


def _triangles_of(document: GltfDocument, primitive: Mapping[str, Any]) -> int:
    mode = primitive.get("mode", TRIANGLES)
    if mode not in (TRIANGLES, STRIP, FAN):
        return 0
    accessor = primitive.get("indices", primitive.get("attributes", {}).get("POSITION"))
    corners = int(document.entry("accessors", accessor)["count"])
    return corners // 3 if mode == TRIANGLES else max(0, corners - 2)


def _copy_count(document: GltfDocument, extension: Mapping[str, Any]) -> int:
    """The number of copies that the first of their attributes states."""
    accessors = [accessor for name, accessor in extension.get("attributes", {}).items() if name in _OF_COPIES]
    return int(document.entry("accessors", accessors[0])["count"]) if accessors else 0


def _copies(document: GltfDocument, index: int, extension: Mapping[str, Any]) -> Floats:
    """The transforms of copies to their node, float64 [n, 4, 4]."""
    given = {name: accessor for name, accessor in extension.get("attributes", {}).items() if name in _OF_COPIES}
    values = {name: document.array(accessor).astype(np.float64) for name, accessor in given.items()}
    count = max(map(len, values.values()), default=0)
    if count == 0 or any(value.shape != (count, _OF_COPIES[name]) for name, value in values.items()):
        raise document.error(f"the copies of node {index} ({INSTANCING}) are not valid: export it again")
    rotation = values.get("ROTATION", np.array([[0.0, 0.0, 0.0, 1.0]]))
    length = np.sqrt(fixed_order.dot(rotation, rotation))[:, np.newaxis]
    placed = np.tile(np.eye(4), (count, 1, 1))
    placed[:, :3, :3] = rotations(rotation / np.where(length > 0, length, 1.0))
    placed[:, :3, :3] *= values.get("SCALE", np.ones((1, 3)))[:, np.newaxis]
    placed[:, :3, 3] = values.get("TRANSLATION", 0.0)
    return placed


def _finite(document: GltfDocument, index: int, matrices: Floats) -> Floats:
    if not (np.abs(matrices) < _MAX_TRANSFORM).all():
        raise document.error(f"the transform of node {index} is not finite, or too large: export it again")
    return matrices


def all_nodes(document: GltfDocument) -> Nodes:
    """The nodes of the file, those outside of the default scene, too."""
    nodes = document.json.get("nodes", [])
    parents = [-1] * len(nodes)
    for index, node in enumerate(nodes):
        for child in node.get("children", []):
            parents[child] = index
    order = [index for index, parent in enumerate(parents) if parent < 0]
    for index in order:  # which grows
        order += nodes[index].get("children", [])
    parts = [_Parts.of(document, index, node) for index, node in enumerate(nodes)]
    return Nodes(
        tuple(parents),
        tuple(order),
        np.array([_local(document, index, node) for index, node in enumerate(nodes)]),
        np.array([part.translation for part in parts]),
        np.array([part.rotation for part in parts]),
        np.array([part.scale for part in parts]),
    )


@dataclass(frozen=True)
class _Parts:
    """Translation, unit rotation and scale of a node; a matrix replaces them."""

    translation: Floats
    rotation: Floats
    scale: Floats

    @classmethod
    def of(cls, document: GltfDocument, index: int, node: Mapping[str, Any]) -> _Parts:
        rotation = _numbers(document, index, node, "rotation", (0.0, 0.0, 0.0, 1.0))
        return cls(
            _numbers(document, index, node, "translation", (0.0, 0.0, 0.0)),
            rotation / (math.hypot(*rotation) or 1.0),
            _numbers(document, index, node, "scale", (1.0, 1.0, 1.0)),
        )


def _numbers(
    document: GltfDocument, index: int, node: Mapping[str, Any], name: str, default: tuple[float, ...]
) -> Floats:
    try:
        return np.array(node.get(name, default), dtype=np.float64).reshape(len(default))
    except (ValueError, TypeError):
        raise document.error(f"the transform of node {index} is not valid: export it again") from None


def _local(document: GltfDocument, index: int, node: Mapping[str, Any]) -> Floats:
    """A node's transform to its parent, float64 [4, 4]."""
    if "matrix" in node:
        return _numbers(document, index, node, "matrix", (0.0,) * 16).reshape(4, 4).T
    parts = _Parts.of(document, index, node)
    matrix = np.eye(4)
    matrix[:3, :3] = rotations(parts.rotation[np.newaxis])[0] * parts.scale
    matrix[:3, 3] = parts.translation
    return matrix
