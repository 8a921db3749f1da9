"""Hostile and odd glTF files, for the host's reader and for the browser tab's."""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np

POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
_INSTANCING = "EXT_mesh_gpu_instancing"
_NO_DATA = {"componentType": 5126, "count": 3, "type": "VEC3"}
_DATA = POINTS.tobytes() + np.array([0, 1, 2], np.uint16).tobytes()


def gltf(**changes: Any) -> dict[str, Any]:
    """A glTF document of one triangle with an embedded buffer."""
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"name": "a", "pbrMetallicRoughness": {"metallicFactor": 0}}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 6}],
        "buffers": [{"byteLength": 42, "uri": uri(_DATA)}],
    }
    return document | changes


def uri(data: bytes) -> str:
    """Bytes as a ``data:`` URI."""
    return "data:application/octet-stream;base64," + base64.b64encode(data).decode()


def glb(document: bytes, binary: bytes = b"", claimed: int | None = None) -> bytes:
    """A binary file; ``claimed``: the length that it states of its JSON."""
    document += b" " * (-len(document) % 4)
    chunk = struct.pack("<I", len(document) if claimed is None else claimed) + b"JSON" + document
    chunk += struct.pack("<I", len(binary)) + b"BIN\0" + binary if binary else b""
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunk)) + chunk


def _text(**changes: Any) -> bytes:
    return json.dumps(gltf(**changes)).encode()


def _accessor(**changes: Any) -> bytes:
    """The document with another accessor of positions; a change to None leaves a key out."""
    changed = {key: value for key, value in (gltf()["accessors"][0] | changes).items() if value is not None}
    return _text(accessors=[changed, gltf()["accessors"][1]])


def _view(**changes: Any) -> bytes:
    first, second = gltf()["bufferViews"]
    return _text(bufferViews=[first | changes, second])


def _primitive(**changes: Any) -> bytes:
    return _text(meshes=[{"primitives": [gltf()["meshes"][0]["primitives"][0] | changes]}])


def _node(**changes: Any) -> bytes:
    return _text(nodes=[{"mesh": 0} | changes])


def _arrays(attributes: Mapping[str, np.ndarray], indices: np.ndarray | None = None, **primitive: Any) -> bytes:
    """A document of one primitive with these arrays; normalised unless they are floats."""
    kinds = {"f4": 5126, "u4": 5125, "u2": 5123, "i2": 5122, "u1": 5121, "i1": 5120}
    arrays = [*attributes.values()] + ([] if indices is None else [indices])
    data, views, accessors = b"", [], []
    for array in arrays:
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes})
        width = 1 if array.ndim == 1 else array.shape[1]
        accessor = {"bufferView": len(views) - 1, "componentType": kinds[array.dtype.str[1:]], "count": len(array)}
        is_scaled = array is not indices and array.dtype.kind != "f"
        accessors.append(accessor | {"type": "SCALAR" if width == 1 else f"VEC{width}", "normalized": is_scaled})
        data += array.tobytes() + b"\0" * (-array.nbytes % 4)
    primitive["attributes"] = {name: number for number, name in enumerate(attributes)}
    if indices is not None:
        primitive["indices"] = len(accessors) - 1
    buffers = [{"byteLength": len(data), "uri": uri(data)}]
    meshes = [{"primitives": [primitive]}]
    return _text(meshes=meshes, accessors=accessors, bufferViews=views, buffers=buffers)


def _sparse(**changes: Any) -> bytes:
    """The document with changed positions: vertex 2 is at (0, 0, 1)."""
    sparse = {"count": 1, "indices": {"bufferView": 1, "byteOffset": 4, "componentType": 5123}}
    return _accessor(sparse=sparse | {"values": {"bufferView": 0, "byteOffset": 20}} | changes)


def _copies(many: int = 0, nodes: int = 1, **arrays: np.ndarray) -> bytes:
    """Copies of the triangle in each of some nodes; ``many``: so many with a translation of 0."""
    document = json.loads(_arrays(arrays)) if arrays else gltf(accessors=[], bufferViews=[])
    accessors, views = document["accessors"], document["bufferViews"]
    numbers = {name: 2 + number for number, name in enumerate(arrays)}
    views = [view | {"buffer": 1} for view in views]
    accessors = [accessor | {"bufferView": 2 + number} for number, accessor in enumerate(accessors)]
    if many:
        numbers["TRANSLATION"] = 2 + len(accessors)
        changes = {"indices": {"bufferView": 1, "componentType": 5123}, "values": {"bufferView": 0}}
        accessors.append(_NO_DATA | {"count": many, "sparse": changes | {"count": 1}})
    return _text(
        nodes=[{"mesh": 0, "translation": [0, 0, 1], "extensions": {_INSTANCING: {"attributes": numbers}}}] * nodes,
        scenes=[{"nodes": list(range(nodes))}],
        accessors=gltf()["accessors"] + accessors,
        bufferViews=gltf()["bufferViews"] + views,
        buffers=gltf()["buffers"] + document["buffers"],
        extensionsRequired=[_INSTANCING],
    )


def _moved(value: float) -> bytes:
    points = POINTS.copy()
    points[1, 0] = value
    return _arrays({"POSITION": points})


def _chain(count: int, children: int) -> list[dict[str, Any]]:
    """Nodes that each have the next one as a child, so many times; the last one has the mesh."""
    return [{"children": [index + 1] * children} for index in range(count)] + [{"mesh": 0}]


_FOUR = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.float32)
_MESHOPT = "EXT_meshopt_compression"

#: By name and suffix: words of the error, and the file.
REFUSED: dict[str, tuple[str, bytes]] = {
    "empty.gltf": ("is empty", b""),
    "deep.gltf": ("nested too deeply", b"[" * 100_000 + b"]" * 100_000),
    "nested.gltf": ("nested too deeply", b'{"a":' + b"[" * 5_000 + b"]" * 5_000 + b"}"),
    "list.gltf": ("not an object", b"[]"),
    "cut.gltf": ("is not JSON", _text()[:-9]),
    "bytes.gltf": ("is not UTF-8 text", b'{"a": "\xff"}'),
    "nan.gltf": ("is not JSON", _text(extras=float("nan"))),
    "large-number.gltf": ("the number 1e999 is too large", b'{"a": 1e999}'),
    "digits.gltf": ("a number has 41 digits", b'{"a": 1' + b"0" * 40 + b"}"),
    "duplicate.gltf": ("the key asset occurs twice", b'{"asset": {}, "extras": {"a": "{"}, "as\\u0073et": 2}'),
    "version-1.gltf": ("export it as glTF 2.0", _text(asset={"version": "1.0"})),
    "circle.gltf": ("node 1 is its own ancestor", _text(nodes=[{"mesh": 0}, {"children": [2]}, {"children": [1]}])),
    "own-child.gltf": ("node 0 is its own ancestor", _node(children=[0])),
    "two-parents.gltf": ("node 2 has two parents", _text(nodes=[{"children": [2]}, {"children": [2]}, {"mesh": 0}])),
    "doubled.gltf": ("node 1 has two parents", _text(nodes=_chain(60, 2))),
    "no-child.gltf": ("node 0 has a child that does not exist", _node(children=[7])),
    "child-text.gltf": ("nodes[0].children is not a list of whole numbers", _node(children=["1"])),
    "nodes.gltf": ("nodes must be a list of objects", _text(nodes={"a": 1})),
    "materials.gltf": ("materials must be a list of objects", _text(materials=[7])),
    "null.gltf": ("buffers must be a list of objects", _text(buffers=None)),
    "count.gltf": ("invalid count", _accessor(count=10**12)),
    "count-negative.gltf": ("invalid count", _accessor(count=-3)),
    "zeros.gltf": ("accessor 0 has an invalid count", _text(accessors=[_NO_DATA | {"count": 10**9}])),
    "no-data.gltf": ("accessor 0 has no data, as of a compressed mesh", _text(accessors=[_NO_DATA])),
    "no-accessor.gltf": ("accessors[1] is used, but does not exist", _text(accessors=gltf()["accessors"][:1])),
    "type.gltf": ("accessor 0 has an unknown type", _accessor(type="constructor")),
    "component.gltf": ("accessor 0 has an unknown type", _accessor(componentType=5124)),
    "colour-factor.gltf": (
        "material 0 has a factor",
        _text(materials=[{"pbrMetallicRoughness": {"baseColorFactor": [-1, 0, 0, 1]}}]),
    ),
    "emission.gltf": ("material 0 has a factor", _text(materials=[{"emissiveFactor": [0, "1", 0]}])),
    "no-mesh.gltf": ("meshes[7] is used, but does not exist", _node(mesh=7)),
    "no-scene.gltf": ("scenes[3] is used, but does not exist", _text(scene=3)),
    "no-material.gltf": ("materials[9] is used", _primitive(material=9)),
    "no-positions.gltf": ("a primitive has no positions", _primitive(attributes={})),
    "mode.gltf": ("a primitive has the unknown mode 9", _primitive(mode=9)),
    "points.gltf": ("has no faces: 1 point primitive is not shown: only faces", _primitive(mode=0)),
    "no-faces.gltf": ("has no faces: it holds no polygons", _text(scenes=[{}])),
    "flat-positions.gltf": ("the positions of a primitive are not of type VEC3", _accessor(type="VEC2")),
    "index.gltf": ("names vertex 2, which does not exist: its primitive has 2 vertices", _accessor(count=2)),
    "index-floats.gltf": ("indices of a primitive are not whole numbers", _primitive(indices=0)),
    "normals.gltf": (
        "has 2 of NORMAL for 3 positions",
        _arrays({"POSITION": POINTS, "NORMAL": POINTS[:2]}),
    ),
    "colours.gltf": ("a COLOR_0 that is not a finite", _arrays({"POSITION": POINTS, "COLOR_0": POINTS + np.nan})),
    "offset.gltf": ("accessors[0].byteOffset is not a whole number from 0 on", _accessor(byteOffset=-12)),
    "view-offset.gltf": ("bufferViews[0].byteOffset is not a whole number from 0 on", _view(byteOffset=-4)),
    "view.gltf": ("bufferViews[0] is too short for 30 elements", _accessor(count=30)),
    "view-length.gltf": ("bufferViews[0] is too short for 3 elements", _view(byteLength=35)),
    "view-no-length.gltf": ("bufferViews[0] is too short", _text(bufferViews=[{"buffer": 0}] * 2)),
    "view-no-buffer.gltf": ("buffers[None] is used", _text(bufferViews=[{"byteLength": 36}] * 2)),
    "buffer-length.gltf": ("bufferViews[0] is too short for 3 elements", _view(byteOffset=30)),
    "stride.gltf": ("bufferViews[0] is too short", _view(byteStride=4)),
    "stride-long.gltf": ("bufferViews[0] is too short", _view(byteStride=2**31)),
    "stride-negative.gltf": ("bufferViews[0].byteStride is not a whole number", _view(byteStride=-12)),
    "buffer-empty.gltf": ("buffer 0 has no data", _text(buffers=[{"byteLength": 42}])),
    "buffer-missing.gltf": ("its buffer a%20b.bin is missing", _text(buffers=[{"uri": "a%20b.bin"}])),
    "buffer-text.gltf": ("the data of buffer 0 are not base64", _text(buffers=[{"uri": "data:;base64,AAA"}])),
    "sparse.gltf": (
        "a sparse accessor changes element 2 of 2",
        _sparse(count=1).replace(b'"count": 3, "type": "VEC3"', b'"count": 2, "type": "VEC3"'),
    ),
    "sparse-long.gltf": ("bufferViews[1] is too short for 50,000 elements", _sparse(count=50_000)),
    "sparse-no-values.gltf": ("accessors[0].sparse.values is not an object", _sparse(values=None)),
    "sparse-floats.gltf": (
        "accessor 0 has indices of an unknown type",
        _sparse(indices={"bufferView": 1, "componentType": 5126}),
    ),
    "matrix.gltf": ("transform of node 0 is not finite, or too large", _node(matrix=[1e300] * 16)),
    "matrix-short.gltf": ("transform of node 0 is not valid", _node(matrix=[1] * 15)),
    "rotation.gltf": ("transform of node 0 is not valid", _node(rotation=[0, 0, 1])),
    "copies-none.gltf": ("the copies of node 0 (EXT_mesh_gpu_instancing) are not valid", _copies()),
    "copies-some.gltf": ("the copies of node 0", _copies(TRANSLATION=POINTS, SCALE=POINTS[:2])),
    "copies-width.gltf": ("the copies of node 0", _copies(ROTATION=POINTS)),
    "copies-many.gltf": ("it has more than 65,536 copies of meshes: leave some out", _copies(65_537)),
    "copies-of-nodes.gltf": ("it has more than 65,536 copies of meshes: leave some out", _copies(32_769, 2)),
    "copies-infinite.gltf": ("transform of node 0 is not finite", _copies(TRANSLATION=np.full_like(POINTS, np.inf))),
    "meshopt.gltf": (f"its meshes are compressed ({_MESHOPT})", _text(extensionsRequired=[_MESHOPT])),
    "meshopt-optional.gltf": (
        f"its meshes are compressed ({_MESHOPT})",
        _text(
            accessors=[_NO_DATA, gltf()["accessors"][1]],
            meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "extensions": {_MESHOPT: {}}}]}],
        ),
    ),
    "meshopt-buffer.gltf": (
        f"its meshes are compressed ({_MESHOPT})",
        _text(buffers=[{"byteLength": 96, "extensions": {_MESHOPT: {"fallback": True}}}]),
    ),
    "extension.gltf": (
        "requires the glTF extension ACME_x, which is not supported",
        _text(extensionsRequired=["KHR_texture_basisu", "ACME_x"]),
    ),
    "extensions-text.gltf": ("extensionsRequired is not a list of texts", _text(extensionsRequired="ACME_x")),
    "position-nan.gltf": ("vertex 1 is not a finite number: repair the file", _moved(float("nan"))),
    "position-infinite.gltf": ("vertex 1 is not a finite number: repair the file", _moved(float("inf"))),
    "no-area.gltf": ("only degenerate triangles (1, all without area)", _node(scale=[0, 0, 0])),
    "long.glb": ("is truncated: a part of 4,294,967,295 bytes begins", glb(b"{}", claimed=0xFFFFFFFF)),
    "short.glb": ("not a binary glTF file of version 2", b"glTF\x02"),
    "version-1.glb": ("it is glTF of version 1", b"glTF" + struct.pack("<II", 1, 12)),
    "deep.glb": ("nested too deeply", glb(b'{"a":' + b"[" * 50_000 + b"]" * 50_000 + b"}")),
    "binary.glb": ("is not UTF-8 text", glb(b"\xff" * 400)),
}

#: Files that are read, by name.
READ: dict[str, bytes] = {
    "plain.gltf": _text(),
    "text.glb": _text(),
    "binary.glb": glb(_text(buffers=[{"byteLength": 42}]), _DATA),
    "binary.gltf": glb(_text(buffers=[{"byteLength": 42}]), _DATA),
    "mark.gltf": b"\xef\xbb\xbf" + _text(),
    "no-scenes.gltf": _text(scenes=[], nodes=[{"children": [1]}, {"mesh": 0, "scale": [2, 1, 1]}, {"mesh": 0}]),
    "second-scene.gltf": _text(scene=1, scenes=[{}, {"nodes": [1]}], nodes=[{}, {"mesh": 0, "translation": [1, 2, 3]}]),
    "same-root.gltf": _text(scenes=[{"nodes": [0, 0]}]),
    "chain.gltf": _text(nodes=_chain(3_000, 1)),
    "order.gltf": _text(
        nodes=[{"children": [1, 2], "scale": [1, 2, 1]}, {"mesh": 0}, {"mesh": 0, "translation": [0, 0, 5]}]
    ),
    "rotation.gltf": _node(rotation=[0, 0.5, 0, 0.5], translation=[1, 0, 0]),
    "rotation-0.gltf": _node(rotation=[0, 0, 0, 0]),
    "rotation-huge.gltf": _node(rotation=[1e300, 0, 0, 1e300]),
    "mirrored.gltf": _node(scale=[-2, 1, 1], rotation=[0.1, 0.2, 0.3, 0.4]),
    "matrix.gltf": _node(matrix=[0, 2, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 7, 8, 9, 1]),
    "copies.gltf": _copies(TRANSLATION=POINTS),
    "copies-turned.gltf": _copies(
        SCALE=np.float32([[1, 2, 3], [-1, 1, 1]]), ROTATION=np.int16([[0, 0, 32767, 0], [9000, 0, 0, 20000]])
    ),
    "copies-100.gltf": _copies(100, ROTATION=np.zeros((100, 4), np.float32)),
    "strip.gltf": _arrays({"POSITION": _FOUR}, mode=5),
    "fan.gltf": _arrays({"POSITION": _FOUR}, np.array([0, 1, 3, 2], np.uint8), mode=6),
    "lines-too.gltf": _text(meshes=[{"primitives": [{"mode": 1}, *gltf()["meshes"][0]["primitives"]]}]),
    "corners-left.gltf": _arrays({"POSITION": _FOUR}, np.array([0, 1, 2, 3], np.uint32)),
    "normals.gltf": _arrays({"POSITION": POINTS, "NORMAL": np.float32([[0, 3, 4]] * 3)}),
    "quantised.gltf": _arrays({"POSITION": np.int16([[0, 0, 0], [32767, 0, 0], [0, -32768, 9]])}),
    "colours.gltf": _arrays({"POSITION": POINTS, "COLOR_0": np.uint8([[255, 0, 9, 255]] * 3)}, material=0),
    "stride.gltf": _text(
        bufferViews=[{"buffer": 0, "byteLength": 72, "byteStride": 24}],
        buffers=[{"byteLength": 72, "uri": uri(np.hstack([POINTS, POINTS[::-1] + 1]).tobytes())}],
        accessors=[gltf()["accessors"][0] | {"byteOffset": offset} for offset in (0, 12)],
        meshes=[{"primitives": [{"attributes": {"POSITION": 1, "NORMAL": 0}}]}],
    ),
    "sparse.gltf": _sparse(count=1),
    "sparse-zeros.gltf": _accessor(
        bufferView=None,
        sparse={"count": 3, "indices": {"bufferView": 1, "componentType": 5123}, "values": {"bufferView": 0}},
    ),
    "extensions.gltf": _text(extensionsRequired=["KHR_texture_basisu", "KHR_materials_unlit"]),
    "unread.gltf": _text(textures=[{"extensions": {"ACME_x": {"source": -1}}}], extras={"mode": None}),
}
