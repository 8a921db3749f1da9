"""Reads an animation of a glTF file: skins, morph targets and moving nodes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colonnade.common.errors import UserError
from colonnade.common.terminal_text import listed, meant, plain
from colonnade.common.types import Floats, Indices
from colonnade.mesh import losses as lost
from colonnade.mesh.clips.clip import INFLUENCES, Clip, Morphs
from colonnade.mesh.clips.faces import ClipFaces
from colonnade.mesh.clips.tracks import Track
from colonnade.mesh.files.gltf_document import GltfDocument
from colonnade.mesh.files.gltf_draco import PrimitiveArrays
from colonnade.mesh.losses import Losses
from colonnade.mesh.materials.surface import RawSurface

_WIDTHS = {"translation": 3, "rotation": 4, "scale": 3}


class ClipReader:
    """Collects the vertices of a file's primitives, and what moves them."""

    def __init__(
        self, document: GltfDocument, animation: str, losses: Losses, source: GltfDocument | None = None
    ) -> None:
        """Find an animation.

        Args:
            document: The file.
            animation: Its name, or its number from 0.
            losses: Counts what is left out of it.
            source: A file that has the animation; nodes of both with one name are the same. None: the file itself.

        Raises:
            UserError: There is no such animation, it is not valid, or it moves nothing of the file.
        """
        self._document, self._losses, self._source = document, losses, source or document
        self._named = None if source is None else _nodes_by_name(document)
        self.name = animation
        self._nodes = document.nodes()
        self._missing: dict[str, None] = {}
        self._tracks = self._read_tracks(self._chosen(animation))
        self._bones: dict[tuple[int, bytes], int] = {}
        self._positions: list[Floats] = []
        self._influences: list[tuple[Indices, Floats]] = []
        self._targets: dict[tuple[int, int], float] = {}
        self._changes: list[tuple[Indices, Indices, Floats, Floats]] = []
        self._count = 0

    def add(self, index: int, primitive: Mapping[str, Any], arrays: PrimitiveArrays, positions: Floats) -> None:
        """Take the vertices of a primitive of a node, float64 [n, 3]."""
        node, count = self._document.entry("nodes", index), len(positions)
        skinned = self._skinned(node, primitive, arrays, count) if "skin" in node else None
        if skinned is None:
            bones = np.full((count, INFLUENCES), self._bone(index, np.eye(4)))
            skinned = bones, np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
        self._influences.append(skinned)
        self._add_targets(index, node, primitive, count)
        self._positions.append(positions)
        self._count += count

    def surface(self, joined: RawSurface) -> tuple[RawSurface, NDArray[np.bool_]]:
        """The joined surface of the primitives, in the rest pose, with what moves it, and mirrored faces, bool [m].

        Its vertices are where they are bound. The corners of mirrored faces go backwards.

        Raises:
            UserError: A transform is not finite.
        """
        clip = self._clip()
        normals = None if joined.normals is None else np.ascontiguousarray(joined.normals)
        is_finite, vertices, normals, is_mirrored = clip.compiled.rest_surface(joined.faces.astype(np.int32), normals)
        if not is_finite:
            raise self._document.error("a transform of its rest pose is not finite, or too large: export it again")
        surface = replace(joined, vertices=vertices, normals=normals).reversed(is_mirrored != 0)
        return replace(surface, moves=ClipFaces.whole(clip, surface.faces)), is_mirrored != 0

    def _chosen(self, name: str) -> Mapping[str, Any]:
        animations = self._source.json.get("animations", [])
        names = [str(animation.get("name", number)) for number, animation in enumerate(animations)]
        if name in names:
            return self._source.entry("animations", names.index(name))
        if name.isdecimal() and int(name) < len(animations):
            return self._source.entry("animations", int(name))
        count = f"{len(names)} animation{'s' * (len(names) > 1)}"
        near = meant(name, names)
        known = f"it has {count}, {listed(names)}" if names else "it has none"
        hint = f": did you mean {listed([near])}? It has {count}, {listed(names)}" if near else f": {known}"
        raise self._source.error(f"it has no animation {listed([name])}{hint}")

    def _node_of(self, index: Any, path: str) -> int | None:
        """The node of the mesh's file that one of the animation's is; None: there is none, or it has other targets."""
        if self._named is None:
            return int(index)
        name = str(self._source.entry("nodes", index).get("name", f"node {index}"))
        if name not in self._named:
            self._missing[name] = None
            return None
        found = self._named[name]
        own, other = self._document.entry("nodes", found), self._source.entry("nodes", index)
        if path == "weights" and _targets_of(self._document, own) != _targets_of(self._source, other):
            self._losses.add(lost.CHANNELS)
            return None
        return found

    def _read_tracks(self, animation: Mapping[str, Any]) -> tuple[Track, ...]:
        tracks, samplers = [], animation.get("samplers", [])
        for channel in animation.get("channels", []):
            target, number = channel.get("target", {}), channel.get("sampler", -1)
            path = target.get("path") if isinstance(target, Mapping) else None
            if path is None or "node" not in target or path not in (*_WIDTHS, "weights"):
                self._losses.add(lost.CHANNELS)
                continue
            if not 0 <= number < len(samplers):
                raise self._error(f"uses sampler {number}, which does not exist")
            node = self._node_of(target["node"], path)
            if node is not None:
                tracks.append(self._track(node, path, samplers[number]))
        if self._missing and not tracks:
            moved, own = (listed(list(names), 80) for names in (self._missing, self._named or ("no names",)))
            raise self._error(f"moves {moved}, and no node of the mesh, which has {own}", "")
        for name in self._missing:
            self._losses.add(lost.JOINTS, name=name)
        if not tracks:
            raise self._error("moves no node and no morph target")
        places = [(track.node, track.path) for track in tracks]
        if len(set(places)) < len(places):
            raise self._error("moves the same property of a node twice")
        return tuple(tracks)

    def _track(self, index: int, path: Any, sampler: Mapping[str, Any]) -> Track:
        node = self._document.entry("nodes", index)
        kind = sampler.get("interpolation", "LINEAR")
        if kind not in ("STEP", "LINEAR", "CUBICSPLINE"):
            raise self._error("has an unknown interpolation")
        times = self._source.array(sampler.get("input"))[:, 0].astype(np.float64)
        values = self._source.array(sampler.get("output")).astype(np.float64)
        if not (np.isfinite(times).all() and np.isfinite(values).all()):
            raise self._error("has a key that is not a finite number")
        if times[0] < 0 or (np.diff(times) <= 0).any():
            raise self._error("has keys whose times do not ascend from 0 on")
        if path == "weights":
            width = _targets_of(self._document, node)
        else:
            width = _WIDTHS[path]
            if "matrix" in node:
                raise self._error(f"moves node {index}, which has a matrix")
        shape = (len(times), 3, width) if kind == "CUBICSPLINE" else (len(times), width)
        if values.size != np.prod(shape):
            raise self._error(f"has {values.size:,} numbers for {len(times):,} keys of a {path}")
        return Track(index, path, times, values.reshape(shape), kind)

    def _skinned(
        self, node: Mapping[str, Any], primitive: Mapping[str, Any], arrays: PrimitiveArrays, count: int
    ) -> tuple[Indices, Floats] | None:
        """Bones and weights of the vertices of a skin; None if they have none."""
        attributes = primitive.get("attributes", {})
        if "JOINTS_0" not in attributes or "WEIGHTS_0" not in attributes:
            return None
        skin = self._document.entry("skins", node["skin"])
        joints = skin.get("joints", [])
        for joint in joints:
            self._document.entry("nodes", joint)
        inverses = np.tile(np.eye(4), (len(joints), 1, 1))
        if "inverseBindMatrices" in skin:
            values = self._document.array(skin["inverseBindMatrices"]).astype(np.float64)
            if values.shape[1] != 16 or len(values) < len(joints) or not np.isfinite(values).all():
                raise self._document.error("a skin has inverse bind matrices that are not valid: export it again")
            inverses = values[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1)
        sets = sum(f"JOINTS_{number}" in attributes and f"WEIGHTS_{number}" in attributes for number in range(8))
        places = np.concatenate([arrays.attribute(f"JOINTS_{number}") for number in range(sets)], axis=1)
        weights = np.concatenate([arrays.attribute(f"WEIGHTS_{number}") for number in range(sets)], axis=1)
        weights = weights.astype(np.float64)
        is_valid = len(places) == len(weights) == count and places.shape[1] == weights.shape[1] == 4 * sets
        if not is_valid or places.dtype.kind not in "iu" or not (weights >= 0).all() or not np.isfinite(weights).all():
            raise self._document.error("a primitive has joints or weights that are not valid: export it again")
        if int(places.max(initial=0)) >= len(joints):
            raise self._document.error(
                f"a vertex has joint {places.max()}, its skin has {len(joints)}: export it again"
            )
        largest = np.argsort(-weights, axis=1, kind="stable")[:, :INFLUENCES]
        kept = np.take_along_axis(weights, largest, axis=1)
        self._losses.add(lost.INFLUENCES, int(((weights > 0).sum(axis=1) > INFLUENCES).sum()))
        kept[kept[:, 0] == 0, 0] = 1.0
        numbers = np.array([self._bone(joint, one) for joint, one in zip(joints, inverses, strict=True)])
        total = kept.sum(axis=1, keepdims=True)
        return numbers[np.take_along_axis(places, largest, axis=1).astype(np.int64)], kept / total

    def _bone(self, joint: int, inverse: Floats) -> int:
        return self._bones.setdefault((joint, inverse.tobytes()), len(self._bones))

    def _add_targets(self, index: int, node: Mapping[str, Any], primitive: Mapping[str, Any], count: int) -> None:
        mesh = self._document.entry("meshes", node["mesh"])
        weights = node.get("weights", mesh.get("weights", []))
        for place, target in enumerate(primitive.get("targets", [])):
            weight = weights[place] if isinstance(weights, list) and place < len(weights) else 0.0
            if not isinstance(weight, int | float) or isinstance(weight, bool) or not np.isfinite(weight):
                raise self._document.error(f"a weight of node {index} is not a finite number: export it again")
            self._targets[index, place] = float(weight)
            added = [self._added(target, name, count) for name in ("POSITION", "NORMAL")]
            vertices = np.flatnonzero(np.any([values != 0 for values in added], axis=(0, 2)))
            number = np.full(len(vertices), list(self._targets).index((index, place)))
            self._changes.append((number, self._count + vertices, added[0][vertices], added[1][vertices]))

    def _added(self, target: Mapping[str, Any], name: str, count: int) -> Floats:
        if name not in target:
            return np.zeros((count, 3))
        values = self._document.array(target[name]).astype(np.float64)
        if values.shape != (count, 3) or not np.isfinite(values).all():
            raise self._document.error(f"a morph target has {name} that are not valid: export it again")
        return values

    def _clip(self) -> Clip:
        empty = np.zeros(0, dtype=np.int64)
        changes = self._changes or [(empty, empty, np.zeros((0, 3)), np.zeros((0, 3)))]
        targets, vertices, positions, normals = (np.concatenate(one) for one in zip(*changes, strict=True))
        order = np.argsort(vertices, kind="stable")
        places = np.array(list(self._targets), dtype=np.int64).reshape(-1, 2)
        bones, weights = (np.concatenate(one) for one in zip(*self._influences, strict=True))
        bones = np.where(weights > 0, bones, bones[:, :1])
        used, bones = np.unique(bones, return_inverse=True)
        joints = [joint for joint, _ in self._bones]
        inverses = np.array([np.frombuffer(inverse).reshape(4, 4) for _, inverse in self._bones])
        return Clip(
            name=self.name,
            duration=max(float(track.times[-1]) for track in self._tracks),
            nodes=self._nodes,
            tracks=self._tracks,
            joints=np.array(joints)[used],
            inverses=inverses[used],
            positions=np.concatenate(self._positions),
            bones=bones.reshape(weights.shape),
            weights=weights,
            morphs=Morphs(
                nodes=places[:, 0],
                places=places[:, 1],
                weights=np.array(list(self._targets.values()), dtype=np.float64),
                targets=targets[order],
                vertices=vertices[order],
                positions=positions[order],
                normals=normals[order],
            ),
        )

    def _error(self, reason: str, advice: str = ": export it again") -> UserError:
        return self._source.error(f"its animation {plain(self.name)} {reason}{advice}")


def _targets_of(document: GltfDocument, node: Mapping[str, Any]) -> int:
    """The number of a node's morph targets."""
    primitives = document.entry("meshes", node.get("mesh", -1)).get("primitives", [])
    return max((len(primitive.get("targets", [])) for primitive in primitives), default=0)


def _nodes_by_name(document: GltfDocument) -> dict[str, int]:
    """The first node of each name, those that are joints of skins before others."""
    skins, nodes = document.json.get("skins", []), document.json.get("nodes", [])
    joints = [joint for skin in skins for joint in skin.get("joints", []) if joint < len(nodes)]
    found: dict[str, int] = {}
    for index in (*joints, *range(len(nodes))):
        if "name" in nodes[index]:
            found.setdefault(str(nodes[index]["name"]), index)
    return found
