"""A clip: vertices that bones and morph targets move over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from colonnade.common.types import Floats, Indices
from colonnade.mesh.clips.tracks import Track

#: Bones that move a vertex.
INFLUENCES = 4


def rotations(quaternions: Floats) -> Floats:
    """The rotations of unit quaternions x, y, z, w, float64 [n, 3, 3]."""
    x, y, z, w = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


@dataclass(frozen=True)
class Nodes:
    """A forest of coordinate systems.

    Attributes:
        parents: Of each node, −1 for a root.
        order: The nodes, each after its parent.
        matrices: To their parents, at rest, float64 [n, 4, 4].
        translations, rotations, scales: Their parts at rest, float64 [n, 3], [n, 4], [n, 3].
    """

    parents: tuple[int, ...]
    order: tuple[int, ...]
    matrices: Floats
    translations: Floats
    rotations: Floats
    scales: Floats


@dataclass(frozen=True)
class Pose:
    """The clip at a time.

    Attributes:
        matrices: Of the bones, from where their vertices are bound to the scene, float64 [b, 3, 4].
        weights: Of the morph targets, float64 [t].
    """

    matrices: Floats
    weights: Floats

    def is_equal(self, other: Pose) -> bool:
        """Whether both are the same."""
        return np.array_equal(self.matrices, other.matrices) and np.array_equal(self.weights, other.weights)


@dataclass(frozen=True)
class Morphs:
    """Shapes that are added to the vertices, each by its weight.

    Attributes:
        nodes: The node of each target, int64 [t].
        places: Its place among the weights of its node, int64 [t].
        weights: At rest, float64 [t].
        targets, vertices: The target and the vertex of each change, by ascending vertex, int64 [d].
        positions, normals: What is added, float64 [d, 3].
    """

    nodes: Indices
    places: Indices
    weights: Floats
    targets: Indices
    vertices: Indices
    positions: Floats
    normals: Floats


@dataclass(frozen=True, eq=False)
class Clip:
    """Vertices, and what moves them.

    Attributes:
        name: Its name, for messages.
        duration: Seconds.
        nodes: The nodes.
        tracks: What changes of them.
        joints: The node of each bone, int64 [b].
        inverses: From where vertices are bound to their bone, float64 [b, 4, 4].
        positions: Of the vertices, where they are bound, float64 [v, 3].
        bones: Bones of each vertex, int64 [v, 4].
        weights: Their weights, of sum 1, the largest first, float64 [v, 4].
        morphs: The morph targets.
    """

    name: str
    duration: float
    nodes: Nodes
    tracks: tuple[Track, ...]
    joints: Indices
    inverses: Floats
    positions: Floats
    bones: Indices
    weights: Floats
    morphs: Morphs

    @cached_property
    def compiled(self) -> Any:
        """The clip as ``cpp/mesh/clip.hpp`` evaluates it, here and in the browser tab."""
        from colonnade import _core

        nodes, morphs = self.nodes, self.morphs

        def numbers(values: Sequence[int] | Indices) -> Indices:
            return np.ascontiguousarray(values, dtype=np.int64)

        return _core.Clip(
            self.duration,
            numbers(nodes.parents),
            numbers(nodes.order),
            *(
                np.ascontiguousarray(part)
                for part in (nodes.matrices, nodes.translations, nodes.rotations, nodes.scales)
            ),
            [track.numbers for track in self.tracks],
            numbers(self.joints),
            np.ascontiguousarray(self.inverses),
            np.ascontiguousarray(self.positions),
            numbers(self.bones),
            np.ascontiguousarray(self.weights),
            (
                *map(numbers, (morphs.nodes, morphs.places)),
                morphs.weights,
                *map(numbers, (morphs.targets, morphs.vertices)),
                *map(np.ascontiguousarray, (morphs.positions, morphs.normals)),
            ),
        )

    def rest(self) -> Pose:
        """The pose in which no track moves."""
        return Pose(*self.compiled.rest())

    def pose(self, time: float, before: bool = False) -> Pose:
        """The pose at a time, seconds, or just before it, if it jumps there."""
        return Pose(*self.compiled.pose(time, before))

    def vertices(self, matrices: Floats, weights: Floats) -> Floats:
        """The vertices in the scene, float64 [v, 3], by matrices of bones and weights of morph targets."""
        return np.asarray(self.compiled.vertices(np.ascontiguousarray(matrices), weights))
