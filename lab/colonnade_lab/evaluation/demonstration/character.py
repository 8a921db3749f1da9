"""The character of the demonstration: a walking figure of tubes with a skin, as a glTF file (`scenes/character.gltf`).

A bone is a node that turns about the x axis, sideways of the figure; the figure looks along +z, y is up, metres. Rings
of a tube near a joint have both of its bones.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from colonnade.common.types import Floats
from numpy.typing import NDArray

#: Duration of the walk, seconds, steps of each foot in it, and keys of a step.
SECONDS, STEPS, KEYS = 10, 6, 16
#: Name of the animation.
WALK = "walk"
#: Bones: name, parent, place of the joint. Left is +x.
_SIDES = (("left", 1.0), ("right", -1.0))
_BONES: dict[str, tuple[str | None, tuple[float, float, float]]] = {
    "hips": (None, (0.0, 0.92, 0.0)),
    "chest": ("hips", (0.0, 1.12, 0.0)),
    "head": ("chest", (0.0, 1.46, 0.0)),
} | {
    f"{side} {name}": (parent if parent in ("hips", "chest") else f"{side} {parent}", (sign * x, y, z))
    for side, sign in _SIDES
    for name, parent, (x, y, z) in (
        ("thigh", "hips", (0.1, 0.88, 0.0)),
        ("shin", "thigh", (0.1, 0.48, 0.0)),
        ("foot", "shin", (0.1, 0.09, -0.01)),
        ("arm", "chest", (0.23, 1.38, 0.0)),
        ("forearm", "arm", (0.25, 1.1, -0.01)),
    )
}
_NAMES = list(_BONES)
#: Middle of a foot below the middle of the figure, and half its size.
_FOOT, _FOOT_HALF = (0.1, 0.045, 0.05), (0.05, 0.045, 0.13)
#: Half the length over which a joint bends a tube, metres.
_BLEND = 0.07


@dataclass
class _Skin:
    """Vertices, what moves them, and triangles."""

    positions: list[Floats] = field(default_factory=list)
    bones: list[list[int]] = field(default_factory=list)
    weights: list[list[float]] = field(default_factory=list)
    faces: list[tuple[int, int, int]] = field(default_factory=list)

    def tube(self, chain: Sequence[str], rings: Sequence[tuple[Floats, float, float]], around: int) -> None:
        """A closed tube of rings that lie level: middle, half width and half depth, from below upwards."""
        first = len(self.positions)
        angles = 2 * np.pi * np.arange(around) / around
        for middle, width, depth in rings:
            for angle in angles:
                point = middle + np.array([width * np.cos(angle), 0.0, depth * np.sin(angle)])
                self._vertex(point, chain)
        count = len(rings)
        for ring in range(count - 1):
            for k in range(around):
                a, b = first + ring * around + k, first + ring * around + (k + 1) % around
                self.faces += [(a, a + around, b + around), (a, b + around, b)]
        for ring, is_top in ((0, False), (count - 1, True)):
            base = first + ring * around
            pole = len(self.positions)
            self._vertex(rings[ring][0], chain)
            for k in range(around):
                a, b = base + k, base + (k + 1) % around
                self.faces.append((pole, b, a) if is_top else (pole, a, b))

    def _vertex(self, point: Floats, chain: Sequence[str]) -> None:
        """A vertex of a chain of bones from below upwards: each joint but the last one's blends into the next bone."""
        shares = np.ones(1)
        for upper in chain[1:]:
            # The joint between two bones is the lower one's
            joint = _BONES[chain[len(shares) - 1]][1][1] if chain[0] != "hips" else _BONES[upper][1][1]
            part = float(np.clip((point[1] - joint) / (2 * _BLEND) + 0.5, 0.0, 1.0))
            part = part * part * (3 - 2 * part)
            shares = np.append(shares[:-1], [shares[-1] * (1 - part), shares[-1] * part])
        order = np.argsort(-shares, kind="stable")[:2]
        self.positions.append(point)
        self.bones.append([_NAMES.index(chain[k]) for k in order] + [0] * (4 - len(order)))
        codes = [round(255 * float(shares[order[0]])), 0]
        self.weights.append([codes[0], 255 - codes[0], 0, 0])


def _ellipsoid(middle: Sequence[float], half: Sequence[float], count: int) -> list[tuple[Floats, float, float]]:
    """Rings of an ellipsoid."""
    angles = np.pi * (np.arange(count) + 0.5) / count
    x, y, z = half
    return [(np.add(middle, [0.0, -y * np.cos(angle), 0.0]), x * np.sin(angle), z * np.sin(angle)) for angle in angles]


def _profile(
    points: Sequence[tuple[float, float, float, float, float]], count: int
) -> list[tuple[Floats, float, float]]:
    """Rings through points of height, middle x and z, half width and half depth, with round ends."""
    values = np.array(points)
    heights = np.linspace(values[0, 0], values[-1, 0], count)
    smooth = [np.interp(heights, values[:, 0], values[:, k]) for k in range(1, 5)]
    span = values[-1, 0] - values[0, 0]
    ends = np.minimum(heights - values[0, 0], values[-1, 0] - heights) / (0.08 * span)
    round_ends = np.sqrt(1 - (1 - np.clip(ends, 0.05, 1.0)) ** 2)
    x, z, width, depth = smooth
    return [
        (np.array([x[k], heights[k], z[k]]), width[k] * round_ends[k], depth[k] * round_ends[k]) for k in range(count)
    ]


def _skin() -> _Skin:
    skin = _Skin()
    torso = [(0.8, 0, 0, 0.15, 0.11), (0.95, 0, 0, 0.16, 0.12), (1.08, 0, 0, 0.13, 0.1), (1.28, 0, 0, 0.19, 0.12),
             (1.4, 0, 0, 0.17, 0.1), (1.5, 0, 0, 0.06, 0.06)]  # fmt: skip
    skin.tube(("hips", "chest", "head"), _profile(torso, 24), 24)
    skin.tube(("head",), _ellipsoid((0.0, 1.6, 0.01), (0.095, 0.125, 0.11), 14), 20)
    for side, sign in _SIDES:
        x, out = 0.1 * sign, 0.24 * sign
        leg = [(0.05, x, -0.01, 0.045, 0.05), (0.12, x, -0.01, 0.045, 0.05), (0.3, x, -0.01, 0.06, 0.065),
               (0.46, x, 0, 0.058, 0.062), (0.7, x, 0, 0.08, 0.085), (0.9, x, 0, 0.085, 0.1)]  # fmt: skip
        skin.tube((f"{side} foot", f"{side} shin", f"{side} thigh"), _profile(leg, 26), 18)
        skin.tube((f"{side} foot",), _ellipsoid((x, *_FOOT[1:]), _FOOT_HALF, 9), 14)
        arm = [(0.8, 0.255 * sign, 0, 0.035, 0.03), (0.87, 0.255 * sign, 0, 0.045, 0.03),
               (0.92, 0.255 * sign, 0, 0.032, 0.032), (1.1, 0.25 * sign, 0, 0.042, 0.042),
               (1.3, out, 0, 0.052, 0.055), (1.43, 0.22 * sign, 0, 0.055, 0.06)]  # fmt: skip
        skin.tube((f"{side} forearm", f"{side} arm"), _profile(arm, 24), 14)
    return skin


def _walk(step: Floats) -> dict[str, Floats]:
    """Turns of the bones at shares of a step of the left foot, degrees about x; forward is negative."""
    found = {"chest": 2.0 + 0 * step, "head": -2.0 + 0 * step, "hips": 0 * step}
    for side, phase in (("left", 0.0), ("right", 0.5)):
        angle = 2 * np.pi * (step + phase)
        thigh = -6.0 - 24.0 * np.sin(angle)
        shin = 8.0 + 26.0 * (1 + np.cos(angle - 0.3)) ** 2 / 2
        found[f"{side} thigh"], found[f"{side} shin"] = thigh, shin
        found[f"{side} foot"] = -(thigh + shin) * 0.55
        found[f"{side} arm"] = 22.0 * np.sin(angle)
        found[f"{side} forearm"] = -28.0 - 12.0 * np.sin(angle + np.pi)
    return found


def _heights(turns: dict[str, Floats]) -> Floats:
    """Places of the hips, float64 [k, 3], with which the lower foot is on the ground."""
    lowest = []
    for side, _ in _SIDES:
        angle, height = 0.0 * turns["hips"], _BONES[f"{side} thigh"][1][1] - _BONES["hips"][1][1] + 0.0 * turns["hips"]
        bones = [f"{side} {name}" for name in ("thigh", "shin", "foot")]
        for upper, lower in pairwise(bones):
            angle = angle + np.radians(turns[upper])
            _, y, z = np.subtract(_BONES[lower][1], _BONES[upper][1])
            height = height + y * np.cos(angle) - z * np.sin(angle)
        angle = angle + np.radians(turns[bones[-1]])
        _, y, z = np.subtract(_FOOT, _BONES[bones[-1]][1])
        middle = height + y * np.cos(angle) - z * np.sin(angle)
        lowest.append(middle - np.hypot(_FOOT_HALF[1] * np.cos(angle), _FOOT_HALF[2] * np.sin(angle)))
    return np.column_stack([0.0 * turns["hips"], -np.min(lowest, axis=0), 0.0 * turns["hips"]])


class _Buffer:
    """The binary part of a glTF file and its accessors."""

    def __init__(self) -> None:
        self.data = b""
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, values: NDArray[Any], kind: str, component: int, **more: Any) -> int:
        """An accessor of values [n] or [n, w]; returns its number."""
        self.data += b"\0" * (-len(self.data) % 4)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": values.nbytes}
        self.data += values.tobytes()
        self.accessors.append(
            {"bufferView": len(self.views), "componentType": component, "count": len(values), "type": kind} | more
        )
        self.views.append(view)
        return len(self.accessors) - 1


_FLOAT, _BYTE, _SHORT = 5126, 5121, 5123


def character() -> str:
    """The glTF file, JSON with its data in it."""
    skin, buffer = _skin(), _Buffer()
    points = np.array(skin.positions).round(5).astype("<f4")
    limits = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
    attributes = {
        "POSITION": buffer.add(points, "VEC3", _FLOAT, **limits),
        "JOINTS_0": buffer.add(np.array(skin.bones, dtype=np.uint8), "VEC4", _BYTE),
        "WEIGHTS_0": buffer.add(np.array(skin.weights, dtype=np.uint8), "VEC4", _BYTE, normalized=True),
    }
    indices = buffer.add(np.array(skin.faces, dtype="<u2").reshape(-1), "SCALAR", _SHORT)
    inverses = np.tile(np.eye(4), (len(_NAMES), 1, 1))
    inverses[:, 3, :3] = [np.negative(_BONES[name][1]) for name in _NAMES]  # by columns
    bound = buffer.add(inverses.astype("<f4").reshape(-1, 16), "MAT4", _FLOAT)
    keys = np.arange(STEPS * KEYS + 1)
    times = (keys * (SECONDS / (STEPS * KEYS))).astype("<f4")
    at = buffer.add(times, "SCALAR", _FLOAT, min=[0.0], max=[float(times[-1])])
    samplers: list[dict[str, int]] = []
    channels: list[dict[str, Any]] = []
    walk = _walk(keys / KEYS)
    for name, degrees in walk.items():
        half = np.radians(degrees) / 2
        turns = np.column_stack([np.sin(half), np.zeros((len(keys), 2)), np.cos(half)]).round(6).astype("<f4")
        channels.append({"sampler": len(samplers), "target": {"node": _NAMES.index(name), "path": "rotation"}})
        samplers.append({"input": at, "output": buffer.add(turns, "VEC4", _FLOAT)})
    channels.append({"sampler": len(samplers), "target": {"node": _NAMES.index("hips"), "path": "translation"}})
    samplers.append({"input": at, "output": buffer.add(_heights(walk).round(6).astype("<f4"), "VEC3", _FLOAT)})
    encoded = base64.b64encode(buffer.data).decode("ascii")
    document = {
        "asset": {"version": "2.0", "generator": "tools/live --character"},
        "scene": 0,
        "scenes": [{"nodes": [0, len(_NAMES)]}],
        "nodes": [*(_node(name) for name in _NAMES), {"name": "figure", "mesh": 0, "skin": 0}],
        "meshes": [{"name": "figure", "primitives": [{"attributes": attributes, "indices": indices, "material": 0}]}],
        "materials": [
            {
                "name": "cloth",
                "pbrMetallicRoughness": {"baseColorFactor": [0.75, 0.35, 0.12, 1.0], "metallicFactor": 0.0},
            }
        ],
        "skins": [{"joints": list(range(len(_NAMES))), "inverseBindMatrices": bound}],
        "animations": [{"name": WALK, "samplers": samplers, "channels": channels}],
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": len(buffer.data), "uri": f"data:application/octet-stream;base64,{encoded}"}],
    }
    return json.dumps(document, indent=1) + "\n"


def _node(name: str) -> dict[str, Any]:
    parent, joint = _BONES[name]
    origin = np.zeros(3) if parent is None else np.array(_BONES[parent][1])
    children = [k for k, other in enumerate(_NAMES) if _BONES[other][0] == name]
    node: dict[str, Any] = {"name": name, "translation": (np.array(joint) - origin).round(6).tolist()}
    return node | ({"children": children} if children else {})
