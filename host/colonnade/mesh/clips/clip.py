"""A clip: vertices that bones and morph targets move over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from colonnade.common import fixed_order
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

    def moved(self, tracks: Sequence[Track], time: float, before: bool = False) -> Floats:
        """The transforms to the parents at a time, seconds, or just before it, float64 [n, 4, 4]."""
        parts = {
            "translation": self.translations.copy(),
            "rotation": self.rotations.copy(),
            "scale": self.scales.copy(),
        }
        own = [track for track in tracks if track.path != "weights"]
        for track in own:
            parts[track.path][track.node] = track.at(time, before)
        matrices, nodes = self.matrices.copy(), sorted({track.node for track in own})
        matrices[nodes, :3, :3] = rotations(parts["rotation"][nodes]) * parts["scale"][nodes][:, None, :]
        matrices[nodes, :3, 3] = parts["translation"][nodes]
        return matrices

    def to_scene(self, matrices: Floats) -> Floats:
        """The transforms of all nodes to the scene, float64 [n, 4, 4], from those to their parents."""
        result = matrices.copy()
        for node in self.order:
            if self.parents[node] >= 0:
                result[node] = fixed_order.product(result[self.parents[node]], matrices[node])
        return result


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

    def rest(self) -> Pose:
        """The pose in which no track moves."""
        return self._pose(self.nodes.matrices, self.morphs.weights)

    def pose(self, time: float, before: bool = False) -> Pose:
        """The pose at a time, seconds, or just before it, if it jumps there."""
        weights = self.morphs.weights.copy()
        for track in self.tracks:
            if track.path == "weights":
                own = self.morphs.nodes == track.node
                weights[own] = track.at(time, before)[self.morphs.places[own]]
        return self._pose(self.nodes.moved(self.tracks, time, before), weights)

    def _pose(self, matrices: Floats, weights: Floats) -> Pose:
        to_scene = self.nodes.to_scene(matrices)
        return Pose(fixed_order.product(to_scene[self.joints], self.inverses)[:, :3], weights)

    def bound(self, weights: Floats) -> Floats:
        """The vertices where they are bound, with morph targets of these weights, float64 [v, 3]."""
        morphs = self.morphs
        if not len(morphs.targets):
            return self.positions
        added = morphs.positions * weights[morphs.targets][:, None]
        count = len(self.positions)
        sums = [np.bincount(morphs.vertices, added[:, axis], minlength=count) for axis in range(3)]
        return self.positions + np.stack(sums, axis=1)

    def blended(self, matrices: Floats) -> Floats:
        """The matrix of each vertex, float64 [v, 3, 4], by those of bones."""
        result = self.weights[:, 0, None, None] * matrices[self.bones[:, 0]]
        for influence in range(1, INFLUENCES):
            shared: npt.NDArray[np.int64] = np.flatnonzero(self.weights[:, influence])
            weights = self.weights[shared, influence, None, None]
            result[shared] += weights * matrices[self.bones[shared, influence]]
        return result

    def vertices(self, matrices: Floats, weights: Floats) -> Floats:
        """The vertices in the scene, float64 [v, 3], by matrices of bones and weights of morph targets."""
        blended = self.blended(matrices)
        return np.asarray(fixed_order.dot(blended[:, :, :3], self.bound(weights)[:, None, :]) + blended[:, :, 3])
