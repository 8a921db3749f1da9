"""Estimates depth from normals and the floor, for a room without a depth map.

On a smooth surface the normal gives the depth gradient: with the view ray d = (x, y, 1),
``grad log z = -(n_x / fx, n_y / fy) / (n . d)``. Log depth is the weighted least-squares solution over all pairs of
adjacent pixels. At a depth discontinuity only one of a pixel's two neighbours fits, so a few rounds reduce the other's
weight (Cao et al., "Bilateral Normal Integration", ECCV 2022). The floor is the lowest horizontal surface; its known
distance below the camera gives the scale. After the first rounds, floor pixels are also constrained to this height.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.common.errors import UserError
from colonnade.environment.model import EnvironmentCamera

#: Default height of the camera above the floor, metres.
DEFAULT_CAMERA_HEIGHT = 1.5
#: Largest number of unknowns; larger maps are subsampled.
_GRID_PIXELS = 40_000
#: Number of rounds, and of those before the floor constraint.
_ROUNDS = 12
_FREE_ROUNDS = 4
#: Steepness of the weighting between a pixel's two neighbours.
_STEEPNESS = 4.0
#: A floor pixel's normal has at least this cosine with up, and its height at most this relative error.
_LEVEL = 0.96
_FLOOR_TOLERANCE = 0.12
#: The fraction of horizontal pixels from which the floor counts as visible.
_MIN_FLOOR_FRACTION = 0.005
#: Weight of the floor constraint relative to a pair of neighbours.
_FLOOR_WEIGHT = 0.05


@dataclass(frozen=True)
class _Grid:
    """The subsampled pixels of the linear system.

    Attributes:
        normals, directions: float64 [rows, columns, 3], view space; directions have z = 1.
        down: float64 [rows, columns], drop below the camera of the view ray's point at depth 1.
        level: bool [rows, columns], whether the pixel may be floor.
        steps: Horizontal and vertical grid step, in focal lengths.
    """

    normals: NDArray[np.float64]
    directions: NDArray[np.float64]
    down: NDArray[np.float64]
    level: NDArray[np.bool_]
    steps: tuple[float, float]


@dataclass(frozen=True)
class _Differences:
    """Difference equations ``z[neighbour] - z[pixel] = slope`` in log depth, towards one side."""

    pixel: NDArray[np.intp]
    neighbour: NDArray[np.intp]
    slope: NDArray[np.float64]


def depth_from_normals(
    normals: NDArray[np.float64], camera: EnvironmentCamera, camera_height: float
) -> tuple[NDArray[np.float64], str]:
    """Estimate depth.

    Args:
        normals: float64 [height, width, 3], unit, view space.
        camera: The maps' camera.
        camera_height: Height above the floor, metres.

    Returns:
        Depth in metres, float64 [height, width], and a note for the user.

    Raises:
        UserError: The height is not positive, or no pixel is below the camera.
    """
    if not np.isfinite(camera_height) or camera_height <= 0:
        raise UserError(f"the camera's height is {camera_height:g} m: it must be more than 0")
    height, width = normals.shape[:2]
    thin = max(1, int(np.ceil(np.sqrt(height * width / _GRID_PIXELS))))
    directions = camera.directions(width, height)
    rows, columns = np.arange(thin // 2, height, thin), np.arange(thin // 2, width, thin)
    chosen = np.ix_(rows, columns)
    up = camera.to_world[1, :3]
    down = -(directions[chosen] @ up)
    level = (normals[chosen] @ up > _LEVEL) & (down > 0)
    grid = _Grid(normals[chosen], directions[chosen], down, level, (thin / camera.fx, thin / camera.fy))
    sees_floor = np.count_nonzero(level) >= max(4, _MIN_FLOOR_FRACTION * level.size)
    solved = _integrate(grid, camera_height if sees_floor else None)
    if sees_floor:
        how = "the floor"
    else:
        lowest = float(np.percentile(np.exp(solved) * down, 99))
        if lowest <= 0:
            raise UserError("depth cannot be estimated: the camera sees nothing below it; add a depth map to the room")
        solved += np.log(camera_height / lowest)
        how = "its lowest point"

    # Place each pixel on the plane of its own normal through its grid point, within limits
    nearest = np.ix_(*(np.minimum(np.arange(n) // thin, k.size - 1) for n, k in ((height, rows), (width, columns))))
    base = np.exp(solved)
    anchors = (directions[chosen] * base[..., np.newaxis])[nearest]
    facing = np.minimum(np.einsum("yxc,yxc->yx", normals, directions), -0.05)
    depth = np.einsum("yxc,yxc->yx", normals, anchors) / facing
    depth = np.clip(depth, base[nearest] / 1.25, base[nearest] * 1.25)
    note = f"no depth map: depth was estimated from the normals, {how} taken as {camera_height:.2f} m below the camera"
    return depth, note


def _integrate(grid: _Grid, camera_height: float | None) -> NDArray[np.float64]:
    """Solve for log depth: in metres with a floor ``camera_height`` below, else with mean 0."""
    shape = grid.down.shape
    sides = _sides(grid)
    weights = [np.full(side.pixel.size, 0.5) for side in sides]
    target, target_weight = np.zeros(grid.down.size), np.full(grid.down.size, 1e-9)
    solution = np.zeros(grid.down.size)
    spread = sum(grid.steps) / 2
    for completed_rounds in range(_ROUNDS):
        solution = _solve(sides, weights, target, target_weight)
        if camera_height is not None:
            below = (np.exp(solution).reshape(shape) * grid.down)[grid.level]
            floor = float(np.percentile(below, 85))
            solution += np.log(camera_height / floor)
            if completed_rounds >= _FREE_ROUNDS:
                height = np.exp(solution).reshape(shape) * grid.down
                floor_pixels = grid.level & (np.abs(height / camera_height - 1.0) < _FLOOR_TOLERANCE)
                target_weight = np.where(floor_pixels, _FLOOR_WEIGHT, 1e-9).ravel()
                target = np.where(floor_pixels, np.log(camera_height / np.maximum(grid.down, 1e-6)), 0.0).ravel()
        weights = _weights(sides, solution, spread)
    return solution.reshape(shape) if camera_height is not None else solution.reshape(shape) - solution.mean()


def _sides(grid: _Grid) -> list[_Differences]:
    """Difference equations towards the right, the left, below and above."""
    facing = np.minimum(np.einsum("yxc,yxc->yx", grid.normals, grid.directions), -0.05)
    index = np.arange(facing.size).reshape(facing.shape)
    sides = []
    for axis, component in ((1, 0), (0, 1)):
        slope = (-grid.normals[..., component] * grid.steps[component] / facing).ravel()
        size = index.shape[axis]
        first, second = (np.take(index, span, axis=axis).ravel() for span in (np.arange(size - 1), np.arange(1, size)))
        sides += [_Differences(first, second, slope[first]), _Differences(second, first, -slope[second])]
    return sides


def _weights(sides: list[_Differences], solution: NDArray[np.float64], spread: float) -> list[NDArray[np.float64]]:
    """Weights of the equations: of a pixel's two neighbours on an axis, the better fitting one gets more."""
    misfits = np.full((len(sides), solution.size), np.inf)
    for misfit, side in zip(misfits, sides, strict=True):
        misfit[side.pixel] = ((solution[side.neighbour] - solution[side.pixel] - side.slope) / spread) ** 2
    weights = []
    for k, side in enumerate(sides):
        own, other = misfits[k][side.pixel], misfits[k ^ 1][side.pixel]
        weights.append(1.0 / (1.0 + np.exp(-np.clip(_STEEPNESS * (other - own), -60, 60))) + 1e-5)
    return weights


def _solve(
    sides: list[_Differences],
    weights: list[NDArray[np.float64]],
    target: NDArray[np.float64],
    target_weight: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Solve weighted least squares of the differences, and of ``target`` with the weights ``target_weight``."""
    from scipy import sparse
    from scipy.sparse.linalg import splu

    unknowns = target.size
    pixel = np.concatenate([side.pixel for side in sides])
    neighbour = np.concatenate([side.neighbour for side in sides])
    slope, weight = np.concatenate([side.slope for side in sides]), np.concatenate(weights)
    diagonal = target_weight + np.bincount(pixel, weight, unknowns) + np.bincount(neighbour, weight, unknowns)
    off_diagonal = sparse.coo_matrix((-weight, (pixel, neighbour)), (unknowns, unknowns))
    matrix = sparse.diags(diagonal) + off_diagonal + off_diagonal.T
    right_side = np.bincount(neighbour, weight * slope, unknowns) - np.bincount(pixel, weight * slope, unknowns)
    factors = splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    solution: NDArray[np.float64] = factors.solve(right_side + target_weight * target)
    return solution
