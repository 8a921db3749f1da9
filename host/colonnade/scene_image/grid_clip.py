"""A clip in whole numbers, as a target has it: vertices, bones and keys on the object's grid."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from colonnade.common import fixed_order
from colonnade.common.errors import UserError
from colonnade.common.types import Floats, Indices
from colonnade.common.vectors import cofactors, unit_vectors
from colonnade.mesh.clips.clip import Clip, Pose
from colonnade.mesh.clips.keys import Keys, baked
from colonnade.mesh.materials.mesh import Mesh
from colonnade.scene_image.header import ObjectFrame

Integers = npt.NDArray[np.int64]

#: Fraction bits of times, of weights of bones and of morph targets, of normals.
TIME_FRACTION, WEIGHT_FRACTION, TARGET_FRACTION, NORMAL_FRACTION = 16, 15, 16, 14
#: Bits of bound positions, of elements of matrices, of weights of morph targets, without the sign.
_BOUND_BITS, _MATRIX_BITS, _TARGET_BITS = 25, 30, 24
#: Of `GridClip.shift` and `GridClip.linear_shift`.
_LEAST_SHIFT, _MOST_SHIFT, _MOST_LINEAR_SHIFT = 2, 20, 32


@dataclass(frozen=True)
class GridClip:
    """A clip in the numbers of a clip file (docs/driver.md).

    Attributes:
        frame: From the scene of the mesh to vertex units, for all poses.
        low, high: Bounds of all poses, vertex units.
        corners: The vertex of the clip at each corner of the mesh's faces, int32 [m, 3].
        vertices: Bound position, normal, bones, and weights of all bones but the first, int64 [v, 3 + 3 + 4 + 3].
        changes: Vertex, position, normal and target of what morph targets add, int64 [d, 1 + 3 + 3 + 1].
        times: Of the keys, 2^-16 s, int64 [k].
        poses: Of the keys: matrices of bones row by row, and weights of targets, int64 [k, 12 b + t].
        rest: The rest pose, int64 [12 b + t].
        bones, targets: Their numbers.
        linear_shift, shift: Fraction bits of matrices beyond those of translations, and of these.
    """

    frame: ObjectFrame
    low: tuple[int, int, int]
    high: tuple[int, int, int]
    corners: npt.NDArray[np.int32]
    vertices: Integers
    changes: Integers
    times: Integers
    poses: Integers
    rest: Integers
    bones: int
    targets: int
    linear_shift: int
    shift: int


def grid_clip(mesh: Mesh, vertex_bits: int) -> GridClip:
    """Put the clip of a mesh on a grid that holds all of its poses.

    Raises:
        UserError: The clip is too long, moves too far, or has weights that are too large.
    """
    clip = mesh.clip
    assert clip is not None
    clip_keys = baked(clip)
    keys, low, high = clip_keys.keys, clip_keys.low, clip_keys.high
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        raise UserError(f"mesh {mesh.name}: its animation {clip.name} has a pose that is not finite: export it again")
    # Vertices are within this of where floats have them, in vertex units, by the rounding of positions and weights
    margin = 2 + ((1 << vertex_bits) >> 14)
    frame = _frame(low, high, vertex_bits, margin)
    numbers = _Numbers(mesh, clip, keys, frame)
    corners, rows = _vertices(mesh, clip, numbers)
    units = [np.rint((corner - np.array(frame.offset)) * frame.scale).astype(int) for corner in (low, high)]
    bounds = [tuple(int(value) for value in unit) for unit in (units[0] - margin, units[1] + margin)]
    times = np.rint(keys.times * 2.0**TIME_FRACTION)
    if times[-1] >= 2.0**32:
        raise UserError(f"mesh {mesh.name}: its animation {clip.name} is longer than 18 hours: shorten it")
    rest = clip.rest()
    return GridClip(
        frame=frame,
        low=(bounds[0][0], bounds[0][1], bounds[0][2]),
        high=(bounds[1][0], bounds[1][1], bounds[1][2]),
        corners=corners,
        vertices=rows.vertices,
        changes=rows.changes,
        times=times.astype(np.int64),
        poses=np.array([numbers.pose(Pose(*pose)) for pose in zip(keys.matrices, keys.weights, strict=True)]),
        rest=numbers.pose(rest),
        bones=len(clip.joints),
        targets=len(clip.morphs.weights),
        linear_shift=numbers.linear_bits - numbers.bits,
        shift=numbers.bits,
    )


def _frame(low: Floats, high: Floats, vertex_bits: int, margin: int) -> ObjectFrame:
    """A box in the centre of the cube, with a margin; its low planes are whole numbers."""
    maximum = (1 << vertex_bits) - 1
    scale = (maximum - 2 * margin) / float((high - low).max())
    start = np.floor((maximum - np.rint((high - low) * scale)) / 2)
    x, y, z = (float(value) for value in low - start / scale)
    return ObjectFrame(scale, (x, y, z))


class _Numbers:
    """The scales of a clip's numbers."""

    def __init__(self, mesh: Mesh, clip: Clip, keys: Keys, frame: ObjectFrame) -> None:
        """Find scales with which all numbers fit."""
        self._frame, morphs = frame, clip.morphs
        low, high = clip.positions.min(axis=0), clip.positions.max(axis=0)
        self.centre = (low + high) / 2
        largest = np.zeros(len(morphs.weights))
        np.maximum.at(largest, morphs.targets, np.abs(morphs.positions).max(axis=1, initial=0.0))
        rest = clip.rest()
        weights = np.abs(np.concatenate([keys.weights, rest.weights[np.newaxis]])).max(axis=0, initial=0.0)
        if not (weights < 2.0 ** (_TARGET_BITS - TARGET_FRACTION)).all():
            raise UserError(f"mesh {mesh.name}: its animation {clip.name} has a weight beyond 255: export it again")
        reach = float((high - low).max()) / 2 + float((largest * (1.0 + weights)).sum())
        self.step = 2.0 ** (math.frexp(max(reach, 1e-30))[1] - _BOUND_BITS)
        matrices = np.concatenate([keys.matrices, rest.matrices[np.newaxis]])
        linear, offset = self._parts(matrices)
        self.linear_bits, self.bits = (_fraction(part) for part in (linear, offset))
        self.bits = min(self.bits, self.linear_bits, _MOST_SHIFT)
        self.linear_bits = min(self.linear_bits, self.bits + _MOST_LINEAR_SHIFT)
        if self.bits < _LEAST_SHIFT:
            raise UserError(f"mesh {mesh.name}: its animation {clip.name} moves a bone too far: export it again")

    def _parts(self, matrices: Floats) -> tuple[Floats, Floats]:
        """From bound positions to vertex units: the linear part and the offset."""
        linear, scale = matrices[..., :3], self._frame.scale
        at = fixed_order.dot(linear, self.centre) + matrices[..., 3]
        return linear * (self.step * scale), (at - np.array(self._frame.offset)) * scale

    def pose(self, pose: Pose) -> Integers:
        """The words of a pose."""
        linear, offset = self._parts(pose.matrices)
        scaled = np.concatenate([linear * 2.0**self.linear_bits, (offset * 2.0**self.bits)[..., np.newaxis]], axis=2)
        words = np.rint(np.concatenate([scaled.reshape(-1), pose.weights * 2.0**TARGET_FRACTION]))
        return np.asarray(words, dtype=np.int64)

    def bound(self, positions: Floats) -> Integers:
        """Differences of bound positions."""
        return np.asarray(np.rint(positions / self.step), dtype=np.int64)


def _fraction(values: Floats) -> int:
    """The fraction bits with which the largest of some values has `_MATRIX_BITS` bits."""
    return _MATRIX_BITS - 1 - math.frexp(max(float(np.abs(values).max()), 2.0**-60))[1]


@dataclass(frozen=True)
class _Rows:
    vertices: Integers
    changes: Integers


def _vertices(mesh: Mesh, clip: Clip, numbers: _Numbers) -> tuple[npt.NDArray[np.int32], _Rows]:
    """The vertex at each corner, int32 [m, 3], and the vertices: corners that always move together have one."""
    assert mesh.clip_corners is not None
    morphs, sources = clip.morphs, mesh.clip_corners.reshape(-1)
    changes = np.column_stack([numbers.bound(morphs.positions), _directions(morphs.normals), morphs.targets])
    first = np.searchsorted(morphs.vertices, np.arange(len(clip.positions) + 1))
    shapes: dict[bytes, int] = {}
    shape = np.array([shapes.setdefault(changes[a:b].tobytes(), len(shapes)) for a, b in pairwise(first)])
    weights = np.rint(clip.weights[:, 1:] * 2.0**WEIGHT_FRACTION).astype(np.int64)
    place = numbers.bound(clip.positions - numbers.centre)
    own = np.column_stack([place, clip.bones, weights, shape])[sources]
    normals = _directions(_bound_normals(mesh, clip))
    rows, inverse = np.unique(np.column_stack([own[:, :3], normals, own[:, 3:]]), axis=0, return_inverse=True)
    inverse = inverse.reshape(-1)
    source = np.zeros(len(rows), dtype=np.int64)
    source[inverse] = sources
    counts = (first[1:] - first[:-1])[source]
    vertex = np.repeat(np.arange(len(rows)), counts)
    within = np.arange(len(vertex)) - np.repeat(np.cumsum(counts) - counts, counts)
    changed = changes[np.repeat(first[:-1][source], counts) + within]
    corners = inverse.reshape(-1, 3).astype(np.int32)
    return corners, _Rows(rows[:, :-1], np.column_stack([vertex, changed]))


def _directions(vectors: Floats) -> Integers:
    limit = (1 << (NORMAL_FRACTION + 1)) - 1
    return np.clip(np.rint(vectors * 2.0**NORMAL_FRACTION), -limit, limit).astype(np.int64)


def _bound_normals(mesh: Mesh, clip: Clip) -> Floats:
    """The normals of all corners where their vertices are bound, float64 [3 m, 3]."""
    assert mesh.clip_corners is not None
    normals: Floats = mesh.corner_normals
    x, y, z = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    across = unit_vectors(np.cross(y - x, z - x))[:, np.newaxis]
    normals = np.where((normals == 0).all(axis=2, keepdims=True), across, normals).reshape(-1, 3)
    sources: Indices = mesh.clip_corners.reshape(-1)
    linear = clip.blended(clip.rest().matrices)[sources][:, :, :3]
    determinant = fixed_order.dot(linear[:, :, 0], cofactors(linear)[:, :, 0])
    turned = fixed_order.dot(np.swapaxes(linear, 1, 2), normals[:, np.newaxis])
    bound = np.where(determinant[:, np.newaxis] == 0, normals, turned * np.sign(determinant)[:, np.newaxis])
    morphs, weights = clip.morphs, clip.rest().weights
    added = np.zeros_like(clip.positions)
    np.add.at(added, morphs.vertices, morphs.normals * weights[morphs.targets][:, np.newaxis])
    return unit_vectors(bound) - added[sources]
