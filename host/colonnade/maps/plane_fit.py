"""Fits a small table of planes to a whole environment.

1. **Candidates**: at every 8th pixel the plane of its normal, refitted to its inlier neighbours.
2. **Greedy choice**: repeatedly the candidate that lowers the total error most. Gains only decrease, so old gains are
   upper bounds and few candidates need re-evaluation ("lazy greedy", Minoux 1978).
3. **Lloyd iterations**: assign pixels to their nearest plane and refit the planes.

Errors are metres along the view ray, saturated at `REACH`, so a pixel far from all planes belongs to none.

This is our own code because libraries fit one plane to a point cloud at a time (e.g. RANSAC), with the distance normal
to the plane. The plane map needs the best set of a given size, with errors along the view ray.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.common import fixed_order
from colonnade.environment.model import Environment
from colonnade.maps.planes import PlaneProjection

#: Saturation of the error, metres.
REACH = 0.06
#: Errors below this count as equal, metres, which saves planes for larger errors.
FINE = 0.002
_CANDIDATE_STEP = 8
_SAMPLE_STEP = 4
_NEIGHBOURS = 5
_NEAR = 0.01
_ROUNDS = 8
_REFITS = 3


@dataclass(frozen=True)
class Samples:
    """Pixels as linear equations in a plane's coefficients A, B, C.

    Attributes:
        basis: float64 [n, 3], factors of A, B and C.
        w: float64 [n], depth_unit / z.
        metres: float64 [n], error along the view ray per unit of w, first order.
        scaled: float32 [n, 4]: its product with (A, B, C, -1) is the signed error in metres.
    """

    basis: NDArray[np.float64]
    w: NDArray[np.float64]
    metres: NDArray[np.float64]
    scaled: NDArray[np.float32]

    @staticmethod
    def of(basis: NDArray[np.float64], w: NDArray[np.float64], metres: NDArray[np.float64]) -> Samples:
        """Compute ``scaled`` from the other attributes."""
        scaled = np.concatenate([basis, w[:, np.newaxis]], axis=1) * metres[:, np.newaxis]
        return Samples(basis, w, metres, scaled.astype(np.float32))

    def errors(self, planes: NDArray[np.float64]) -> NDArray[np.float32]:
        """Unsaturated errors of the pixels on planes [k, 3], metres along the view ray: float32 [n, k]."""
        factors = np.concatenate([planes, np.full((len(planes), 1), -1.0)], axis=1).astype(np.float32)
        difference = fixed_order.product(self.scaled, factors.T)
        return np.abs(difference, out=difference)

    def part(self, which: NDArray[np.intp] | NDArray[np.bool_]) -> Samples:
        """A subset of the samples."""
        return Samples(self.basis[which], self.w[which], self.metres[which], self.scaled[which])


def sample_pixels(environment: Environment, projection: PlaneProjection, step: int = 1) -> Samples:
    """Sample every ``step``-th pixel of every ``step``-th row."""
    depth = environment.depth[::step, ::step]
    length = np.linalg.norm(
        environment.camera.directions(environment.width, environment.height)[::step, ::step], axis=2
    )
    basis = projection.basis()[::step, ::step]
    metres = depth * depth * length / projection.depth_unit
    return Samples.of(basis.reshape(-1, 3), (projection.depth_unit / depth).ravel(), metres.ravel())


def fit_planes(environment: Environment, projection: PlaneProjection, count: int) -> NDArray[np.float64]:
    """Fit ``count`` planes A, B, C, float64 [count, 3], in order of decreasing gain."""
    samples = sample_pixels(environment, projection, _SAMPLE_STEP)
    candidates = _candidates(environment, projection)
    planes = _greedy(samples, candidates, count)
    for _ in range(_ROUNDS):
        errors = samples.errors(planes)
        planes = refit_planes(samples, planes, errors.argmin(axis=1))
    return planes


def refit_planes(samples: Samples, planes: NDArray[np.float64], owner: NDArray[np.intp]) -> NDArray[np.float64]:
    """Refit planes to their own samples: least absolute error by reweighted least squares, without outliers.

    Args:
        samples: n samples.
        planes: float64 [k, 3].
        owner: intp [n], the plane of each sample.
    """
    result = planes.copy()
    order = np.argsort(owner, kind="stable")
    bounds = np.searchsorted(owner[order], np.arange(len(planes) + 1))
    for k in range(len(planes)):
        own = samples.part(order[bounds[k] : bounds[k + 1]])
        for _ in range(_REFITS):
            error = own.errors(result[k : k + 1])[:, 0]
            near = error < REACH
            if np.count_nonzero(near) < 8:
                break
            root = own.metres[near] / np.sqrt(np.maximum(error[near], FINE))
            equations = own.basis[near] * root[:, np.newaxis]
            normal = fixed_order.product(equations.T, equations)
            normal = normal + 1e-9 * np.trace(normal) * np.eye(3)
            change = own.w[near] - fixed_order.product(own.basis[near], result[k])
            result[k] = result[k] + fixed_order.solve(normal, fixed_order.product(equations.T, root * change))
    return result


def _candidates(environment: Environment, projection: PlaneProjection) -> NDArray[np.float64]:
    """Fit local planes, float64 [n, 3]."""
    y = np.arange(min(_CANDIDATE_STEP, environment.height) // 2, environment.height, _CANDIDATE_STEP)
    x = np.arange(min(_CANDIDATE_STEP, environment.width) // 2, environment.width, _CANDIDATE_STEP)
    rows, columns = (grid.ravel() for grid in np.meshgrid(y, x, indexing="ij"))
    points = (
        environment.camera.directions(environment.width, environment.height)[rows, columns]
        * environment.depth[rows, columns, np.newaxis]
    )
    normals = environment.normals[rows, columns]
    distance = np.linalg.norm(points, axis=1)
    # Tilt surfaces seen edge-on towards the camera: their planes would pass through it
    facing = fixed_order.dot(normals, points) / distance
    tilt = np.maximum(facing + 0.05, 0.0)
    normals = normals - tilt[:, np.newaxis] * points / distance[:, np.newaxis]
    planes = projection.planes(normals, points)
    # Refit to the neighbours within 1 % of the plane
    reach = np.arange(-_NEIGHBOURS, _NEIGHBOURS + 1)
    down, right = (grid.ravel() for grid in np.meshgrid(reach, reach, indexing="ij"))
    near_rows = np.clip(rows[:, np.newaxis] + down, 0, environment.height - 1)
    near_columns = np.clip(columns[:, np.newaxis] + right, 0, environment.width - 1)
    basis = projection.basis()[near_rows, near_columns]
    w = projection.depth_unit / environment.depth[near_rows, near_columns]
    change = w - fixed_order.dot(basis, planes[:, np.newaxis])
    weight = (np.abs(change) < _NEAR * w).astype(np.float64)
    weighted = (weight[..., np.newaxis] * basis).transpose(0, 2, 1)
    matrix = fixed_order.product(weighted, basis) + 1e-9 * np.eye(3)
    step = fixed_order.solve(matrix, fixed_order.product(weighted, change[..., np.newaxis])[..., 0])
    enough = (weight.sum(axis=1) > 30)[:, np.newaxis]
    local: NDArray[np.float64] = planes + np.where(enough, step, 0.0)
    return local


def _cost(errors: NDArray[np.float32]) -> NDArray[np.float32]:
    # The greedy choice starts at REACH, so larger errors gain nothing
    return np.maximum(errors, np.float32(FINE))


def _greedy(samples: Samples, candidates: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Choose the candidates greedily, in order of decreasing gain."""
    errors_so_far = np.full(len(samples.w), REACH, np.float32)

    def gains(planes: NDArray[np.float64]) -> NDArray[np.float32]:
        gained: NDArray[np.float32] = np.maximum(errors_so_far[:, np.newaxis] - _cost(samples.errors(planes)), 0).sum(
            axis=0
        )
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
        errors_so_far = np.minimum(errors_so_far, _cost(samples.errors(candidates[index : index + 1]))[:, 0])
    # With fewer candidates than planes, repeat the first one; argmin never picks the copies
    chosen += chosen[:1] * (count - len(chosen))
    return candidates[chosen]
