"""glTF files with animations, and an evaluator of its own: it moves points from node to node, without a matrix."""

from __future__ import annotations

import base64
import json
import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from gltf_documents import uri
from textured_files import png

_KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
_TYPES = {"f4": 5126, "u1": 5121, "u2": 5123, "u4": 5125}


class Document:
    """A glTF document that grows by arrays."""

    def __init__(self, **content: Any) -> None:
        self.json: dict[str, Any] = {"asset": {"version": "2.0"}, "accessors": [], "bufferViews": [], **content}
        self._data = b""

    def add(self, values: Any, kind: str = "f4", **changes: Any) -> int:
        """The number of an accessor of values [n] or [n, width]."""
        array = np.asarray(values, dtype="<" + kind)
        width = 1 if array.ndim == 1 else array.shape[1]
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self._data), "byteLength": array.nbytes})
        self._data += array.tobytes() + b"\0" * (-array.nbytes % 4)
        accessor = {"componentType": _TYPES[kind], "count": len(array), "type": _KINDS[width]}
        self.json["accessors"].append(accessor | {"bufferView": len(self.json["bufferViews"]) - 1} | changes)
        return len(self.json["accessors"]) - 1

    def animate(self, name: str, *channels: tuple[int, str, str, Any, Any]) -> None:
        """Add an animation of (node, path, interpolation, times, values)."""
        samplers = [
            {"input": self.add(times), "output": self.add(values), "interpolation": kind}
            for _, _, kind, times, values in channels
        ]
        targets = [
            {"sampler": number, "target": {"node": channel[0], "path": channel[1]}}
            for number, channel in enumerate(channels)
        ]
        self.json.setdefault("animations", []).append({"name": name, "samplers": samplers, "channels": targets})

    def write(self, path: Path) -> Path:
        """Write the file."""
        self.json["buffers"] = [{"byteLength": len(self._data), "uri": uri(self._data)}]
        path.write_text(json.dumps(self.json))
        return path


def grid(columns: int, rows: int) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """A bent strip of quads along z: points [n, 3], and faces [m, 3]."""
    points = [(x / columns, 0.1 * x * x / columns, z / 4) for z in range(rows + 1) for x in range(columns + 1)]
    faces = []
    for z in range(rows):
        for x in range(columns):
            a = z * (columns + 1) + x
            faces += [(a, a + columns + 1, a + 1), (a + 1, a + columns + 1, a + columns + 2)]
    return np.array(points), np.array(faces)


def turn(axis: tuple[float, float, float], degrees: float) -> list[float]:
    """A quaternion x, y, z, w."""
    half = math.radians(degrees) / 2
    length = math.sqrt(sum(a * a for a in axis))
    return [math.sin(half) * a / length for a in axis] + [math.cos(half)]


def arm() -> Document:
    """A strip on a chain of three joints, beside a box that moves as a whole and one with two morph targets."""
    document = Document(scene=0, scenes=[{"nodes": [0, 4, 5, 6]}])
    points, faces = grid(2, 8)
    weights = np.maximum(0.0, 1.0 - np.abs(points[:, 2:] - np.array([[0.0, 0.8, 1.6]])))
    weights /= weights.sum(axis=1, keepdims=True)
    joints = np.tile([0, 1, 2, 0], (len(points), 1))
    inverses = [np.eye(4) for _ in range(3)]
    for number, inverse in enumerate(inverses):
        inverse[:3, 3] = (-0.5, 0.0, -0.8 * number)
    attributes = {
        "POSITION": document.add(points),
        "JOINTS_0": document.add(joints, "u1"),
        "WEIGHTS_0": document.add(
            np.rint(np.column_stack([weights, 0 * weights[:, 0]]) * 65535), "u2", normalized=True
        ),
    }
    corners, corner_faces = grid(1, 1)
    plain = {"POSITION": document.add(corners + 2), "NORMAL": document.add(np.tile([0.0, 1.0, 0.0], (4, 1)))}
    targets = [
        {"POSITION": document.add(np.eye(4, 3) * scale), "NORMAL": document.add(-0.1 * np.eye(4, 3))}
        for scale in (0.5, -0.25)
    ]
    strip = document.add(faces.ravel(), "u2")
    quad = document.add(corner_faces.ravel(), "u2")
    document.json["meshes"] = [
        {"primitives": [{"attributes": attributes, "indices": strip}]},
        {"primitives": [{"attributes": plain, "indices": quad}]},
        {"primitives": [{"attributes": plain, "indices": quad, "targets": targets}], "weights": [0.5, 0.0]},
    ]
    inverse_matrices = document.add(np.array([inverse.T.ravel() for inverse in inverses]))
    document.json["skins"] = [{"joints": [1, 2, 3], "inverseBindMatrices": inverse_matrices}]
    document.json["nodes"] = [
        {"children": [1], "translation": [0.0, 0.5, 0.0], "rotation": turn((1, 2, 0), 40), "scale": [1.0, 1.0, 2.0]},
        {"children": [2], "translation": [0.5, 0.0, 0.0]},
        {"children": [3], "translation": [0.0, 0.0, 0.8]},
        {"translation": [0.0, 0.0, 0.8]},
        {"mesh": 0, "skin": 0, "translation": [9.0, 9.0, 9.0]},
        {"mesh": 1, "scale": [-1.0, 1.0, 1.0]},
        {"mesh": 2, "translation": [1.0, 0.0, 0.0]},
    ]
    spline = [[[0, 0, 0], [0, 0, 0.8], [0.4, 0, 0]], [[0.2, 1, 0], [0.2, 0.4, 1.0], [0, 0, 0]]]
    swing = [[0] * 4, [0, 0, 0, 1], [0, 1, 0, 0], [0] * 4, turn((0, 0, 1), 70), [0] * 4]
    document.animate(
        "bend",
        (2, "rotation", "LINEAR", [0.0, 0.5, 1.0], [turn((1, 0, 0), 0), turn((1, 1, 0), 80), turn((0, 1, 1), 250)]),
        (2, "translation", "CUBICSPLINE", [0.25, 0.75], np.array(spline).reshape(6, 3)),
        (3, "scale", "STEP", [0.0, 0.625], [[1, 1, 1], [1.5, 0.5, 1.0]]),
        (5, "rotation", "CUBICSPLINE", [0.0, 1.0], swing),
        (6, "weights", "LINEAR", [0.0, 1.0], [0.0, 1.0, 1.0, 0.25]),
    )
    return document


def painted(glows: bool = True) -> Document:
    """`arm`, whose faces all show pictures: colours with a hole, bumps, and a glow, or a part that is thin."""
    document, random = arm(), np.random.default_rng(3)
    y, x = np.mgrid[:64, :64]
    colours = random.integers(0, 256, (64, 64, 4)).astype(np.uint8)
    colours[..., 3] = np.where((x - 14) ** 2 + (y - 34) ** 2 < 90, 0, np.where((y > 52) & (not glows), 60, 255))
    colours[40:, :, :3] = (200, 40, 90)
    bumps = np.full((64, 64, 3), 255, np.uint8)
    bumps[..., :2] = np.repeat(np.repeat(random.integers(90, 166, (4, 4, 2)), 16, axis=0), 16, axis=1)
    glow = np.zeros((64, 64, 3), np.uint8)
    glow[8:20, 34:] = (40, 230, 250)
    pictures = ["data:image/png;base64," + base64.b64encode(png(one)).decode() for one in (colours, bumps, glow)]
    document.json |= {
        "images": [{"uri": picture} for picture in pictures],
        "textures": [{"source": number} for number in range(3)],
        "materials": [
            {
                "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0.0},
                "normalTexture": {"index": 1},
                "emissiveTexture": {"index": 2},
                "emissiveFactor": [1.0, 1.0, 1.0],
                "alphaMode": "BLEND",
            },
            {"pbrMetallicRoughness": {"metallicFactor": 0.0, "baseColorFactor": [1, 1, 1, 0.4]}, "alphaMode": "BLEND"},
        ],
    }
    if not glows:
        del document.json["materials"][0]["emissiveTexture"]
        document.json["materials"][0]["emissiveFactor"] = [0.0, 0.0, 0.0]
    for mesh in document.json["meshes"]:
        (primitive,) = mesh["primitives"]
        positions = primitive["attributes"]["POSITION"]
        count = document.json["accessors"][positions]["count"]
        rows = np.arange(count) // (3 if count > 4 else 2) / (8 if count > 4 else 1)
        columns = np.arange(count) % (3 if count > 4 else 2) / (2 if count > 4 else 1)
        places = document.add(np.column_stack([0.05 + 0.9 * columns, 0.05 + 0.9 * rows]))
        mesh["primitives"] = [
            {**primitive, "material": 0, "attributes": primitive["attributes"] | {"TEXCOORD_0": places}}
        ]
    return document


#: Places in the document of `arm`, a value that they get, and words of the error.
HOSTILE: list[tuple[tuple[Any, ...], Any, str]] = [
    (("animations", 0, "channels", 0, "sampler"), 9, "uses sampler 9, which does not exist"),
    (("animations", 0, "channels", 0, "target", "node"), 99, r"nodes\[99\] is used, but does not exist"),
    (
        ("animations", 0, "channels", 1),
        {"sampler": 0, "target": {"node": 2, "path": "rotation"}},
        "moves the same property of a node twice",
    ),
    (("animations", 0, "channels"), [], "moves no node and no morph target"),
    (("animations", 0, "channels"), 3, r"animations\[0\].channels is not a list of objects"),
    (("animations", 0, "samplers", 0, "interpolation"), "EASE", "has an unknown interpolation"),
    (("animations", 0, "samplers", 0, "input"), 0, "ascend|numbers for"),
    (("animations", 0, "samplers", 0, "output"), 0, "numbers for 3 keys of a rotation"),
    (
        ("nodes", 2),
        {"matrix": [1.0] * 16},
        "moves node 2, which has a matrix",
    ),
    (("nodes", 4, "skin"), 7, r"skins\[7\] is used, but does not exist"),
    (("skins", 0, "joints"), [1, 2], "a vertex has joint 2, its skin has 2"),
    (("skins", 0, "joints"), [1, 2, "a"], "joints is not a list of whole numbers"),
    (("skins", 0, "inverseBindMatrices"), 0, "inverse bind matrices that are not valid"),
    (("nodes", 6, "weights"), ["a", 0], "a weight of node 6 is not a finite number"),
    (("nodes", 1, "scale"), [1e300, 1e300, 1e300], "the transform of node 1 is not finite, or too large"),
    (("meshes", 2, "primitives", 0, "targets", 0, "POSITION"), 0, "a morph target has POSITION that are not valid"),
    (("meshes", 0, "primitives", 0, "attributes", "JOINTS_0"), 0, "joints or weights that are not valid"),
]


def changed(places: tuple[Any, ...], to: Any) -> Document:
    """The document of `arm` with another value."""
    document = arm()
    value: Any = document.json
    for place in places[:-1]:
        value = value[place]
    value[places[-1]] = to
    return document


def swaying(seed: int) -> Document:
    """A strip on a chain of five joints with ten morph targets, all of them random."""
    random = np.random.default_rng(seed)
    document = Document(scene=0, scenes=[{"nodes": [0, 6]}])
    points, faces = grid(6, 20)
    points = points + 0.02 * random.normal(size=points.shape)
    weights = random.random((len(points), 4))
    attributes = {
        "POSITION": document.add(points),
        "NORMAL": document.add(random.normal(size=points.shape)),
        "JOINTS_0": document.add(random.integers(0, 5, (len(points), 4)), "u1"),
        "WEIGHTS_0": document.add(weights / weights.sum(axis=1, keepdims=True)),
    }
    targets = [
        {
            "POSITION": document.add(0.2 * random.normal(size=points.shape) * (random.random((len(points), 1)) < 0.4)),
            "NORMAL": document.add(0.1 * random.normal(size=points.shape)),
        }
        for _ in range(10)
    ]
    primitive = {"attributes": attributes, "indices": document.add(faces.ravel(), "u2"), "targets": targets}
    document.json["meshes"] = [{"primitives": [primitive], "weights": random.random(10).tolist()}]
    inverses = np.tile(np.eye(4), (5, 1, 1))
    inverses[:, 3, :3] = 0.2 * random.normal(size=(5, 3))  # by columns
    matrices = document.add(inverses.reshape(5, 16))
    document.json["skins"] = [{"joints": [1, 2, 3, 4, 5], "inverseBindMatrices": matrices}]

    def rotation() -> list[float]:
        x, y, z = random.normal(size=3).tolist()
        return turn((x, y, z), float(80 * random.normal()))

    chain = [{"children": [node], "translation": random.normal(size=3).tolist()} for node in range(1, 6)]
    document.json["nodes"] = [node | {"rotation": rotation()} for node in chain] + [{}, {"mesh": 0, "skin": 0}]
    channels: list[tuple[int, str, str, Any, Any]] = []
    for node in range(1, 6):
        times = np.cumsum(random.random(int(random.integers(2, 9))) + 0.05)
        channels.append((node, "rotation", "LINEAR", times, [rotation() for _ in times]))
    document.animate(
        "sway",
        *channels,
        (0, "translation", "CUBICSPLINE", [0.1, 0.9, 1.7], random.normal(size=(9, 3))),
        (5, "scale", "STEP", [0.3, 0.7], [[1, 1, 1], [2, 1, 0.5]]),
        (6, "weights", "CUBICSPLINE", [0.0, 1.0], random.normal(size=60)),
    )
    return document


def _sandwich(q: list[float], p: list[float]) -> list[float]:
    """A point turned by a quaternion: p + 2 u × (u × p + w p)."""
    u, w = q[:3], q[3]

    def cross(a: list[float], b: list[float]) -> list[float]:
        return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]

    inner = [c + w * x for c, x in zip(cross(u, p), p, strict=True)]
    return [x + 2 * c for x, c in zip(p, cross(u, inner), strict=True)]


def _slerp(a: list[float], b: list[float], part: float) -> list[float]:
    """By the angle of the rotation from a to b."""
    w = sum(x * y for x, y in zip(a, b, strict=True))
    if w < 0:
        b, w = [-x for x in b], -w
    across = [y - w * x for x, y in zip(a, b, strict=True)]
    length = math.sqrt(sum(x * x for x in across))
    if length < 1e-12:
        return a
    angle = part * math.atan2(length, w)
    return [math.cos(angle) * x + math.sin(angle) * y / length for x, y in zip(a, across, strict=True)]


class Evaluator:
    """Reads the animation of a document with float32 arrays, by the text of glTF 2.0."""

    def __init__(self, document: Any, arrays: Any, animation: int = 0) -> None:
        """``arrays`` gives the elements of an accessor by its number."""
        self.json, self.arrays = document, arrays
        self.channels = document["animations"][animation]
        self.parents = {child: n for n, node in enumerate(document["nodes"]) for child in node.get("children", [])}

    def value(self, node: int, path: str, time: float, default: list[float]) -> list[float]:
        """A property of a node."""
        for channel in self.channels["channels"]:
            if channel["target"] != {"node": node, "path": path}:
                continue
            sampler = self.channels["samplers"][channel["sampler"]]
            times = [float(t) for t in self.arrays(sampler["input"])[:, 0]]
            kind = sampler.get("interpolation", "LINEAR")
            keys = np.array(self.arrays(sampler["output"]), dtype=np.float64).reshape(len(times), -1)
            if kind == "CUBICSPLINE":
                into, keys, out = np.split(keys, 3, axis=1)
            if time <= times[0]:
                return list(keys[0])
            if time >= times[-1]:
                return list(keys[-1])
            k = max(n for n, t in enumerate(times) if t <= time)
            span = times[k + 1] - times[k]
            t = (time - times[k]) / span
            if kind == "STEP":
                return list(keys[k])
            if kind == "LINEAR":
                if path == "rotation":
                    return _slerp(list(keys[k]), list(keys[k + 1]), t)
                return list((1 - t) * keys[k] + t * keys[k + 1])
            # Bézier points of the same cubic
            points = [keys[k], keys[k] + span * out[k] / 3, keys[k + 1] - span * into[k + 1] / 3, keys[k + 1]]
            for _ in range(3):
                points = [(1 - t) * a + t * b for a, b in pairwise(points)]
            value = points[0]
            return list(value / np.linalg.norm(value) if path == "rotation" else value)
        return default

    def to_scene(self, node: int | None, point: list[float], time: float) -> list[float]:
        """A point of a node in the scene."""
        while node is not None:
            entry = self.json["nodes"][node]
            scale = self.value(node, "scale", time, entry.get("scale", [1.0] * 3))
            rotation = self.value(node, "rotation", time, entry.get("rotation", [0.0, 0.0, 0.0, 1.0]))
            translation = self.value(node, "translation", time, entry.get("translation", [0.0] * 3))
            point = _sandwich(rotation, [s * p for s, p in zip(scale, point, strict=True)])
            point = [p + t for p, t in zip(point, translation, strict=True)]
            node = self.parents.get(node)
        return point

    def vertex(self, node: int, primitive: Any, vertex: int, time: float) -> list[float]:
        """A vertex of a primitive in the scene."""
        attributes, entry = primitive["attributes"], self.json["nodes"][node]
        point = np.array(self.arrays(attributes["POSITION"])[vertex], dtype=np.float64)
        targets = primitive.get("targets", [])
        weights = self.value(
            node, "weights", time, self.json["meshes"][entry["mesh"]].get("weights", [0.0] * len(targets))
        )
        for weight, target in zip(weights, targets, strict=False):
            point = point + weight * np.array(self.arrays(target["POSITION"])[vertex], dtype=np.float64)
        if "skin" not in entry:
            return self.to_scene(node, list(point), time)
        skin = self.json["skins"][entry["skin"]]
        inverses = self.arrays(skin["inverseBindMatrices"]).astype(np.float64).reshape(-1, 4, 4)
        joints, shares = (self.arrays(attributes[name])[vertex] for name in ("JOINTS_0", "WEIGHTS_0"))
        total = np.zeros(3)
        for joint, share in zip(
            joints, np.asarray(shares, dtype=np.float64) / np.sum(shares, dtype=np.float64), strict=True
        ):
            if share > 0:
                local = (np.append(point, 1.0) @ inverses[joint])[:3]
                total += share * np.array(self.to_scene(skin["joints"][joint], list(local), time))
        return list(total)
