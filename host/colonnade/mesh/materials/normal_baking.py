"""Bakes normal maps into corner normals: the device has normals at the corners of faces, and no maps of them.

Faces inside which a map varies are bisected at their longest edge, the worst first, on both sides of the edge, so
neighbours keep common vertices. The normals at the corners are then the least-squares fit to the map.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from colonnade.common import fixed_order
from colonnade.common.types import Floats, Indices
from colonnade.common.vectors import unit_vectors
from colonnade.mesh import losses as lost
from colonnade.mesh.geometry.normals import face_normals
from colonnade.mesh.geometry.topology import MAX_SPLIT_FACES, SMALLEST_SPLIT, Faces, triangle_points
from colonnade.mesh.losses import Losses
from colonnade.mesh.materials.relief import Relief

#: Samples along an edge of a face, of small, larger and the largest meshes, and samples of a mesh at most.
_STEPS, _SAMPLES = (8, 4, 3), 1 << 22
#: Mean square of the difference between the map and interpolated corners of a face that is not split: 2.5 degrees.
_FLAT = 2e-3
#: Faces are split at the same time if their errors are at least this part of the largest one.
_NEAR = 0.25
#: Steps of the fit.
_FIT = 6
#: Root of the mean square of the difference that is reported, degrees.
_REPORTED = 3.0


@dataclass(frozen=True)
class BakedSurface:
    """A surface whose corner normals are those of its normal maps.

    Attributes:
        vertices: Those of the surface first, float64 [n, 3].
        faces: int32 [k, 3].
        normals: At the corners, unit length, float64 [k, 3, 3].
        owners: The face of the surface of which each is a part, ascending, int64 [k].
        weights: Weights of its corners at the corners of each, float64 [k, 3, 3].
    """

    vertices: Floats
    faces: Faces
    normals: Floats
    owners: Indices
    weights: Floats

    def corners(self, values: Floats) -> Floats:
        """Values at the corners of the surface's faces, float64 [m, 3, c], as those of the parts, float64 [k, 3, c]."""
        return fixed_order.product(self.weights, values[self.owners])


def baked(vertices: Floats, faces: Faces, normals: Floats, relief: Relief, losses: Losses) -> BakedSurface:
    """Split the faces of a clean surface where its normal maps need it, and fit the corner normals to the maps.

    Args:
        vertices: float64 [n, 3], merged by position.
        faces: int32 [m, 3], each with an area.
        normals: At the corners, float64 [m, 3, 3]; 0 for none.
        relief: The maps. Faces without one keep their normals to the bit, but where they share those of others.
        losses: Counts maps that the corner normals do not show.
    """
    normals = np.where(normals.any(axis=2, keepdims=True), normals, face_normals(vertices, faces)[:, None])
    pieces = _Pieces(vertices, faces.astype(np.int64), np.arange(len(faces)), _whole(len(faces)))
    sampler = _Sampler(relief, _frames(vertices, faces, normals, relief))
    pieces = _split(pieces, sampler, MAX_SPLIT_FACES - len(faces))
    order = np.argsort(pieces.owners, kind="stable")
    pieces = pieces[order]
    found, error = _fitted(pieces, sampler, fixed_order.product(pieces.weights, normals[pieces.owners]))
    # A normal that faces the back would be replaced when it is seen
    front = fixed_order.dot(found, face_normals(pieces.vertices, pieces.faces.astype(np.int32))[:, None]) > 0
    base = unit_vectors(fixed_order.product(pieces.weights, normals[pieces.owners]))
    if error > math.radians(_REPORTED):
        losses.add(lost.smooth_normals(math.degrees(error)), len({id(one.texture) for one in relief.maps}))
    return BakedSurface(
        pieces.vertices,
        pieces.faces.astype(np.int32),
        np.where(front[..., None], found, base),
        pieces.owners,
        pieces.weights,
    )


@dataclass(frozen=True)
class _Pieces:
    """Parts of faces: vertices float64 [n, 3], corners int64 [k, 3], owners int64 [k], their weights [k, 3, 3]."""

    vertices: Floats
    faces: Indices
    owners: Indices
    weights: Floats

    def __getitem__(self, chosen: npt.NDArray[np.bool_] | Indices) -> _Pieces:
        return replace(self, faces=self.faces[chosen], owners=self.owners[chosen], weights=self.weights[chosen])

    @property
    def squares(self) -> Floats:
        """Squares of the lengths of the edges from each corner to the next, float64 [k, 3]."""
        corners = self.vertices[self.faces]
        return np.asarray(((np.roll(corners, -1, axis=1) - corners) ** 2).sum(axis=2))

    @property
    def areas(self) -> Floats:
        """Twice the areas, float64 [k]."""
        corners = self.vertices[self.faces]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return np.asarray(np.sqrt((across**2).sum(axis=1)))

    @property
    def edges(self) -> Indices:
        """A number of each edge from a corner to the next, equal for both its faces, int64 [k, 3]."""
        ends = np.roll(self.faces, -1, axis=1)
        return np.minimum(self.faces, ends) << 32 | np.maximum(self.faces, ends)

    def bisected(self, marked: Indices) -> tuple[_Pieces, npt.NDArray[np.bool_]]:
        """Bisect all faces with these edges, int64 [e], ascending: the parts, and which of them are new, bool [k]."""
        low, high = marked >> 32, marked & 0xFFFFFFFF
        middles = (self.vertices[low] + self.vertices[high]) / 2
        rest = replace(self, vertices=np.concatenate([self.vertices, middles]))
        done: list[_Pieces] = []
        while True:
            is_marked = np.isin(rest.edges, marked)
            hit = np.asarray(is_marked.any(axis=1))
            done.append(rest[~hit])
            if not hit.any():
                break
            rest, is_marked = rest[hit], is_marked[hit]
            # The longest of its marked edges first; its parts have the others
            order = (np.where(is_marked, rest.squares, -1.0).argmax(axis=1)[:, None] + np.arange(3)) % 3
            edge = np.take_along_axis(rest.edges, order[:, :1], axis=1)[:, 0]
            a, b, c = np.take_along_axis(rest.faces, order, axis=1).T
            first, second, third = np.moveaxis(np.take_along_axis(rest.weights, order[:, :, None], axis=1), 1, 0)
            middle, half = len(self.vertices) + np.searchsorted(marked, edge), (first + second) / 2
            rest = _Pieces(
                rest.vertices,
                np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)]),
                np.concatenate([rest.owners, rest.owners]),
                np.concatenate([np.stack([first, half, third], axis=1), np.stack([half, second, third], axis=1)]),
            )
        joined = _Pieces(rest.vertices, *(np.concatenate([getattr(one, key) for one in done]) for key in _ARRAYS))
        return joined, np.arange(len(joined.faces)) >= len(done[0].faces)


_ARRAYS = ("faces", "owners", "weights")


def _whole(count: int) -> Floats:
    """The weights of whole faces, float64 [count, 3, 3]."""
    return np.repeat(np.eye(3)[None], count, axis=0)


class _Sampler:
    """The normals of maps at points of faces."""

    def __init__(self, relief: Relief, frames: Floats) -> None:
        """Frames are those of the corners of the faces, float64 [m, 3, 9]."""
        self._relief, self._frames = relief, frames

    def has_map(self, pieces: _Pieces) -> npt.NDArray[np.bool_]:
        """Whether faces have a map, bool [k]."""
        return np.asarray(self._relief.index[pieces.owners] >= 0)

    def normals(self, pieces: _Pieces, points: Floats, width: float | None = None) -> Floats:
        """Normals of parts at points, by weights of their corners, float64 [k, n, 3], at most of unit length.

        They are means over squares so wide; None: as wide as points that fill a triangle are apart.
        """
        own = self._relief.pieces(pieces.owners, pieces.weights)
        frames = fixed_order.product(pieces.weights, self._frames[pieces.owners])
        axes = fixed_order.product(points, frames).reshape(-1, len(points), 3, 3)
        tilts = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (len(own.index), len(points), 3)).copy()
        for number, one in enumerate(own.maps):
            users = np.flatnonzero(own.index == number)
            at = fixed_order.product(points, own.uvs[users])
            texels = np.ptp(own.uvs[users] * one.texture.size, axis=1).max(axis=1, initial=0.0)
            if width is None:
                spacing = texels / math.sqrt(2 * len(points))
            else:
                spacing = texels * width / np.sqrt(pieces[users].squares.max(axis=1, initial=0.0))
            levels = np.maximum(np.frexp(np.maximum(spacing, 1.0))[1] - 1, 0)
            for level in np.unique(levels):
                chosen = levels == level
                tilts[users[chosen]] = one.normals(at[chosen].reshape(-1, 2), int(level)).reshape(-1, len(points), 3)
        length = np.sqrt((tilts**2).sum(axis=2, keepdims=True))
        return np.asarray(unit_vectors((tilts[..., None] * axes).sum(axis=2)) * length)


def _frames(vertices: Floats, faces: Faces, normals: Floats, relief: Relief) -> Floats:
    """Tangent, bitangent and normal at the corners, float64 [m, 3, 9]; tangents are 0 where a map has no direction."""
    corners = vertices[faces]
    edge, ways = corners[:, 1:] - corners[:, :1], relief.uvs[:, 1:] - relief.uvs[:, :1]
    turn = ways[:, 0, 0] * ways[:, 1, 1] - ways[:, 0, 1] * ways[:, 1, 0]
    along = (edge[:, 0] * ways[:, 1, 1:] - edge[:, 1] * ways[:, 0, 1:]) * np.sign(turn)[:, None]
    # v goes down, so a map that is not mirrored has a negative area
    sides = np.repeat(-np.sign(turn)[:, None], 3, axis=1)
    # Corners of one vertex, normal, position in the map and side have one tangent, the mean of their faces by area
    keys = np.column_stack([faces.reshape(-1), normals.reshape(-1, 3), relief.uvs.reshape(-1, 2), sides.reshape(-1)])
    _, group = np.unique(keys + 0.0, axis=0, return_inverse=True)
    area = np.sqrt((np.cross(edge[:, 0], edge[:, 1]) ** 2).sum(axis=1, keepdims=True))
    weighted = np.repeat((unit_vectors(along) * area)[:, None], 3, axis=1).reshape(-1, 3)
    sums = np.stack([np.bincount(group.reshape(-1), weighted[:, axis]) for axis in range(3)], axis=1)
    tangents = np.asarray(sums[group.reshape(-1)].reshape(-1, 3, 3), dtype=np.float64)
    given = np.asarray(relief.tangents[..., :3].any(axis=2))
    tangents = np.asarray(np.where(given[..., None], relief.tangents[..., :3], tangents), dtype=np.float64)
    sides = np.where(given, np.sign(relief.tangents[..., 3]), sides)
    tangents = unit_vectors(tangents - fixed_order.dot(tangents, normals)[..., None] * normals)
    return np.concatenate([tangents, np.cross(normals, tangents) * sides[..., None], normals], axis=2)


def _split(pieces: _Pieces, sampler: _Sampler, budget: int) -> _Pieces:
    """Split faces until their maps are nearly linear on them, edges are too short, or there are so many more faces."""
    shortest = float(np.ptp(pieces.vertices, axis=0).max() * SMALLEST_SPLIT)
    # Half an edge of as many equal faces: finer detail is not looked for
    area = float(pieces[sampler.has_map(pieces)].areas.sum())
    width = max(shortest, math.sqrt(area / (len(pieces.faces) + max(budget, 0))) / 2)
    errors = _errors(pieces, sampler, width)
    while budget > 1:
        squares = pieces.squares
        can_split = (errors > 0) & (squares.max(axis=1) > shortest**2)
        chosen = np.flatnonzero(can_split & (errors > _NEAR * errors[can_split].max(initial=0.0)))
        chosen = chosen[np.argsort(-errors[chosen], kind="stable")][: budget // 2]
        edges = pieces.edges
        longest = np.take_along_axis(edges, squares.argmax(axis=1)[:, None], axis=1)[:, 0]
        marked = _closed(edges, longest, longest[chosen])
        while len(chosen) and np.isin(edges, marked).sum() > budget:
            chosen = chosen[: len(chosen) // 2]
            marked = _closed(edges, longest, longest[chosen])
        if not len(chosen):
            break
        before = len(pieces.faces)
        hit = np.isin(edges, marked).any(axis=1)
        pieces, is_new = pieces.bisected(marked)
        errors = np.concatenate([errors[~hit], _errors(pieces[is_new], sampler, width)])
        budget -= len(pieces.faces) - before
    return pieces


def _closed(edges: Indices, longest: Indices, marked: Indices) -> Indices:
    """Edges to bisect, and the longest ones of all faces that have one: so faces do not become slivers (Rivara 1984).

    Args:
        edges: Of faces, int64 [k, 3].
        longest: Of each, int64 [k].
        marked: Edges to bisect, int64 [e].

    Returns:
        Ascending, int64 [e'].
    """
    marked = np.unique(marked)
    while True:
        further = np.union1d(marked, longest[np.isin(edges, marked).any(axis=1)])
        if len(further) == len(marked):
            return marked
        marked = further


def _steps(count: int) -> int:
    """Samples along an edge of so many faces."""
    return next((steps for steps in _STEPS if count * len(triangle_points(steps)) <= _SAMPLES), _STEPS[-1])


def _errors(pieces: _Pieces, sampler: _Sampler, width: float) -> Floats:
    """Area times the mean square of what interpolated corners differ from the map, 0 where little, float64 [k]."""
    errors, users = np.zeros(len(pieces.owners)), np.flatnonzero(sampler.has_map(pieces))
    if not len(users):
        return errors
    points = triangle_points(_steps(len(users)))
    found = sampler.normals(pieces[users], np.concatenate([np.eye(3), points]), width)
    spread = ((found[:, 3:] - fixed_order.product(points, found[:, :3])) ** 2).sum(axis=(1, 2)) / len(points)
    errors[users] = np.where(spread > _FLAT, spread * pieces[users].areas, 0.0)
    return errors


def _fitted(pieces: _Pieces, sampler: _Sampler, base: Floats) -> tuple[Floats, float]:
    """Normals at the corners, float64 [k, 3, 3], and the root of the mean square of their difference to the map.

    Corners of one vertex and base normal have one normal. Where no face of theirs has a map, it is the base normal.
    """
    keys = np.column_stack([pieces.faces.reshape(-1), base.reshape(-1, 3)]) + 0.0
    _, group = np.unique(keys, axis=0, return_inverse=True)
    group, has_map = group.reshape(-1), sampler.has_map(pieces)
    touched = np.bincount(group, np.repeat(has_map, 3)) > 0
    users = np.flatnonzero(touched[group].reshape(-1, 3).any(axis=1))
    own, points = pieces[users], triangle_points(_steps(len(users)))
    target = sampler.normals(own, points)
    places = group.reshape(-1, 3)[users].reshape(-1)
    shares = np.repeat(own.areas[:, None], 3, axis=1).reshape(-1) * float(points[:, 0].sum())
    total = np.bincount(places, shares, len(touched))
    fit = np.zeros((len(touched), 3))
    by_corner = np.ascontiguousarray(points.T)
    for _ in range(_FIT):
        left = target - fixed_order.product(points, fit[places].reshape(-1, 3, 3))
        moments = (fixed_order.product(by_corner, left) * own.areas[:, None, None]).reshape(-1, 3)
        sums = np.stack([np.bincount(places, moments[:, axis], len(touched)) for axis in range(3)], axis=1)
        fit += sums / np.where(total > 0, total, 1.0)[:, None]
    fit = unit_vectors(fit)
    normals = np.where(touched[group][:, None], fit[group], unit_vectors(base).reshape(-1, 3)).reshape(base.shape)
    fitted = unit_vectors(fixed_order.product(points, normals[users]))
    # The mean of unit normals is as short as they differ
    squares = ((target - fitted) ** 2).sum(axis=2) + 1.0 - (target**2).sum(axis=2)
    areas = own.areas * has_map[users]
    mean = float((squares.mean(axis=1) * areas).sum()) / max(float(areas.sum()), 1e-300)
    return normals, math.sqrt(max(mean, 0.0))
