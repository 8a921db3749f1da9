"""Planes that a whole room shares: few enough for a table, near enough to its depth.

1. **Candidates**: at every 8th pixel the plane of its normal, refitted to the neighbours that lie on it.
2. **Greedy choice**: always the candidate that lowers the room's error most. The gains of the others only fall, so old
   ones are bounds, and few candidates are looked at again ("lazy greedy", Minoux 1978).
3. **Lloyd's rounds**: pixels go to their nearest plane, planes are refitted to their pixels.

Errors are metres along the view ray, saturated at `REACH`: a pixel farther from every plane belongs to none.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.environment.encoding.planes import Picture
from colonnade.environment.model import Environment

#: Beyond this distance an error is no worse, metres.
REACH = 0.06
#: A smaller error does not matter, metres: spares planes for what is worse.
FINE = 0.002
_CANDIDATE_STEP = 8
_SAMPLE_STEP = 4
_NEIGHBOURS = 5
_NEAR = 0.01
_ROUNDS = 8
_REFITS = 3


@dataclass(frozen=True)
class Samples:
    """Pixels of a room as the fit sees them.

    Attributes:
        basis: float64 [n, 3], what A, B, C are multiplied by.
        w: float64 [n], depth_unit / z.
        metres: float64 [n], of error along the view ray for each unit of w, to first order.
        scaled: float32 [n, 4]: ``scaled @ (A, B, C, -1)`` is the signed error in metres.
    """

    basis: NDArray[np.float64]
    w: NDArray[np.float64]
    metres: NDArray[np.float64]
    scaled: NDArray[np.float32]

    @staticmethod
    def of(basis: NDArray[np.float64], w: NDArray[np.float64], metres: NDArray[np.float64]) -> Samples:
        """Samples of all but ``scaled``."""
        scaled = np.concatenate([basis, w[:, np.newaxis]], axis=1) * metres[:, np.newaxis]
        return Samples(basis, w, metres, scaled.astype(np.float32))

    def errors(self, planes: NDArray[np.float64]) -> NDArray[np.float32]:
        """Metres along the view ray between the pixels and planes [k, 3], not saturated: float32 [n, k]."""
        factors = np.concatenate([planes, np.full((len(planes), 1), -1.0)], axis=1).astype(np.float32)
        difference: NDArray[np.float32] = self.scaled @ factors.T
        return np.abs(difference, out=difference)

    def part(self, which: NDArray[np.intp] | NDArray[np.bool_]) -> Samples:
        """Some of them."""
        return Samples(self.basis[which], self.w[which], self.metres[which], self.scaled[which])


def samples_of(environment: Environment, picture: Picture, step: int = 1) -> Samples:
    """Every ``step``-th pixel across and down."""
    depth = environment.depth[::step, ::step]
    length = np.linalg.norm(
        environment.camera.directions(environment.width, environment.height)[::step, ::step], axis=2
    )
    basis = picture.basis()[::step, ::step]
    metres = depth * depth * length / picture.depth_unit
    return Samples.of(basis.reshape(-1, 3), (picture.depth_unit / depth).ravel(), metres.ravel())


def fitted_planes(environment: Environment, picture: Picture, count: int) -> NDArray[np.float64]:
    """``count`` planes A, B, C, float64 [count, 3], those that explain most first."""
    samples = samples_of(environment, picture, _SAMPLE_STEP)
    candidates = _candidates(environment, picture)
    planes = _greedy(samples, candidates, count)
    for _ in range(_ROUNDS):
        errors = samples.errors(planes)
        planes = refitted(samples, planes, errors.argmin(axis=1))
    return planes


def refitted(samples: Samples, planes: NDArray[np.float64], owner: NDArray[np.intp]) -> NDArray[np.float64]:
    """Planes moved to the samples that they own: least absolute error by reweighted least squares, without far ones."""
    result = planes.copy()
    order = np.argsort(owner, kind="stable")
    bounds = np.searchsorted(owner[order], np.arange(len(planes) + 1))
    for k in range(len(planes)):
        mine = samples.part(order[bounds[k] : bounds[k + 1]])
        for _ in range(_REFITS):
            error = mine.errors(result[k : k + 1])[:, 0]
            near = error < REACH
            if np.count_nonzero(near) < 8:
                break
            root = mine.metres[near] / np.sqrt(np.maximum(error[near], FINE))
            equations = mine.basis[near] * root[:, np.newaxis]
            normal = equations.T @ equations
            normal += 1e-9 * np.trace(normal) * np.eye(3)
            change = mine.w[near] - mine.basis[near] @ result[k]
            result[k] = result[k] + np.linalg.solve(normal, equations.T @ (root * change))
    return result


def _candidates(environment: Environment, picture: Picture) -> NDArray[np.float64]:
    """Local planes, float64 [n, 3]."""
    y = np.arange(min(_CANDIDATE_STEP, environment.height) // 2, environment.height, _CANDIDATE_STEP)
    x = np.arange(min(_CANDIDATE_STEP, environment.width) // 2, environment.width, _CANDIDATE_STEP)
    rows, columns = (grid.ravel() for grid in np.meshgrid(y, x, indexing="ij"))
    points = (
        environment.camera.directions(environment.width, environment.height)[rows, columns]
        * environment.depth[rows, columns, np.newaxis]
    )
    normals = environment.normals[rows, columns]
    distance = np.linalg.norm(points, axis=1)
    # A surface seen edge-on is taken a little less so: its plane would pass through the camera
    facing = np.einsum("nc,nc->n", normals, points) / distance
    tilt = np.maximum(facing + 0.05, 0.0)
    normals = normals - tilt[:, np.newaxis] * points / distance[:, np.newaxis]
    planes = picture.planes(normals, points)
    # Refit to the neighbours within a per cent of the plane
    reach = np.arange(-_NEIGHBOURS, _NEIGHBOURS + 1)
    down, right = (grid.ravel() for grid in np.meshgrid(reach, reach, indexing="ij"))
    near_rows = np.clip(rows[:, np.newaxis] + down, 0, environment.height - 1)
    near_columns = np.clip(columns[:, np.newaxis] + right, 0, environment.width - 1)
    basis = picture.basis()[near_rows, near_columns]
    w = picture.depth_unit / environment.depth[near_rows, near_columns]
    change = w - np.einsum("nkc,nc->nk", basis, planes)
    weight = (np.abs(change) < _NEAR * w).astype(np.float64)
    matrix = np.einsum("nk,nkc,nkd->ncd", weight, basis, basis)
    matrix += 1e-9 * np.eye(3)
    right_side = np.einsum("nk,nkc,nk->nc", weight, basis, change)
    step = np.linalg.solve(matrix, right_side[..., np.newaxis])[..., 0]
    enough = (weight.sum(axis=1) > 30)[:, np.newaxis]
    local: NDArray[np.float64] = planes + np.where(enough, step, 0.0)
    return local


def _cost(errors: NDArray[np.float32]) -> NDArray[np.float32]:
    # REACH is where a greedy choice starts: what is beyond it gains nothing
    return np.maximum(errors, np.float32(FINE))


def _greedy(samples: Samples, candidates: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """The candidates that together leave the least error, in the order of their choice."""
    reached = np.full(len(samples.w), REACH, np.float32)

    def gains(planes: NDArray[np.float64]) -> NDArray[np.float32]:
        gained: NDArray[np.float32] = np.maximum(reached[:, np.newaxis] - _cost(samples.errors(planes)), 0).sum(axis=0)
        return gained

    queue: list[tuple[float, int, int]] = []
    for first in range(0, len(candidates), 64):
        part = gains(candidates[first : first + 64])
        queue += [(-float(gain), first + k, 0) for k, gain in enumerate(part)]
    heapq.heapify(queue)
    chosen: list[int] = []
    while queue and len(chosen) < count:
        gain, index, age = heapq.heappop(queue)
        if age < len(chosen):
            gain = -float(gains(candidates[index : index + 1])[0])
            heapq.heappush(queue, (gain, index, len(chosen)))
            continue
        chosen.append(index)
        reached = np.minimum(reached, _cost(samples.errors(candidates[index : index + 1]))[:, 0])
    # Fewer candidates than planes: the first one again, which nobody will use
    chosen += chosen[:1] * (count - len(chosen))
    return candidates[chosen]
