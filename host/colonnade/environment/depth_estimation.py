"""Depth of a room that came without a depth map: from its normals and its floor.

On a smooth surface the normal says how depth changes from a pixel to the next: with the view ray d = (x, y, 1),
``grad log z = -(n_x / fx, n_y / fy) / (n . d)``. Log depth is the least-squares solution of that over all pairs of
neighbours; pairs that contradict it on one side only (an edge before something farther) lose weight in a few rounds, as
in Cao et al., "Bilateral Normal Integration", ECCV 2022. The floor is the lowest level surface; it lies a known height
below the camera, which gives the scale, and after the first rounds holds its pixels where they belong.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from colonnade.common.errors import UserError
from colonnade.environment.model import EnvironmentCamera

#: Metres above the floor of a camera whose pose does not say.
DEFAULT_CAMERA_HEIGHT = 1.5
#: Pixels of the grid that is solved; larger maps are thinned out to it.
_GRID_PIXELS = 40_000
#: Rounds, and how many of them without the floor.
_ROUNDS = 12
_FREE_ROUNDS = 4
#: Steepness of the choice between a pixel's two neighbours.
_STEEPNESS = 4.0
#: A surface that is level to within this cosine may be floor; it is if its height fits to within this share.
_LEVEL = 0.96
_FLOOR_TOLERANCE = 0.12
#: The share of the pixels that must be level for a floor to be seen.
_LEAST_FLOOR = 0.005
#: Weight of a floor pixel's depth beside that of a pair of neighbours.
_ANCHOR = 0.05


@dataclass(frozen=True)
class _Grid:
    """The pixels that are solved for.

    Attributes:
        normals, directions: float64 [rows, columns, 3], view space; directions have z = 1.
        down: float64 [rows, columns], how far below the camera the point at depth 1 lies.
        level: bool [rows, columns], whether it may be floor.
        steps: A grid step across and down, in focal lengths.
    """

    normals: NDArray[np.float64]
    directions: NDArray[np.float64]
    down: NDArray[np.float64]
    level: NDArray[np.bool_]
    steps: tuple[float, float]


@dataclass(frozen=True)
class _Side:
    """One-sided equations ``z[there] - z[here] = slope`` in log depth, one for each pixel with that neighbour."""

    here: NDArray[np.intp]
    there: NDArray[np.intp]
    slope: NDArray[np.float64]


def depth_from_normals(
    normals: NDArray[np.float64], camera: EnvironmentCamera, camera_height: float
) -> tuple[NDArray[np.float64], str]:
    """Depth in metres, float64 [height, width], and a note of how it came about."""
    if not np.isfinite(camera_height) or camera_height <= 0:
        raise UserError(f"the camera's height is {camera_height:g} m: it must be above the floor")
    height, width = normals.shape[:2]
    thin = max(1, int(np.ceil(np.sqrt(height * width / _GRID_PIXELS))))
    directions = camera.directions(width, height)
    rows, columns = np.arange(thin // 2, height, thin), np.arange(thin // 2, width, thin)
    chosen = np.ix_(rows, columns)
    up = camera.to_world[1, :3]
    down = -(directions[chosen] @ up)
    level = (normals[chosen] @ up > _LEVEL) & (down > 0)
    grid = _Grid(normals[chosen], directions[chosen], down, level, (thin / camera.fx, thin / camera.fy))
    sees_floor = np.count_nonzero(level) >= max(4, _LEAST_FLOOR * level.size)
    solved = _integrate(grid, camera_height if sees_floor else None)
    if sees_floor:
        how = "the floor"
    else:
        lowest = float(np.percentile(np.exp(solved) * down, 99))
        if lowest <= 0:
            raise UserError("depth cannot be estimated: the camera sees no floor; give the room a depth map")
        solved += np.log(camera_height / lowest)
        how = "its lowest point"

    # A pixel lies in the plane through its grid point with its own normal, unless that takes it far from there
    nearest = np.ix_(*(np.minimum(np.arange(n) // thin, k.size - 1) for n, k in ((height, rows), (width, columns))))
    base = np.exp(solved)
    anchors = (directions[chosen] * base[..., np.newaxis])[nearest]
    facing = np.minimum(np.einsum("yxc,yxc->yx", normals, directions), -0.05)
    depth = np.einsum("yxc,yxc->yx", normals, anchors) / facing
    depth = np.clip(depth, base[nearest] / 1.25, base[nearest] * 1.25)
    note = f"no depth map: depth was estimated from the normals, {how} taken as {camera_height:.2f} m below the camera"
    return depth, note


def _integrate(grid: _Grid, camera_height: float | None) -> NDArray[np.float64]:
    """Log depth: of metres if there is a floor ``camera_height`` below, else with the mean 0."""
    shape = grid.down.shape
    sides = _sides(grid)
    weights = [np.full(side.here.size, 0.5) for side in sides]
    target, hold = np.zeros(grid.down.size), np.full(grid.down.size, 1e-9)
    solution = np.zeros(grid.down.size)
    spread = sum(grid.steps) / 2
    for turn in range(_ROUNDS):
        solution = _solve(sides, weights, target, hold)
        if camera_height is not None:
            below = (np.exp(solution).reshape(shape) * grid.down)[grid.level]
            floor = float(np.percentile(below, 85))
            solution += np.log(camera_height / floor)
            if turn >= _FREE_ROUNDS:
                height = np.exp(solution).reshape(shape) * grid.down
                floor_pixels = grid.level & (np.abs(height / camera_height - 1.0) < _FLOOR_TOLERANCE)
                hold = np.where(floor_pixels, _ANCHOR, 1e-9).ravel()
                target = np.where(floor_pixels, np.log(camera_height / np.maximum(grid.down, 1e-6)), 0.0).ravel()
        weights = _weights(sides, solution, spread)
    return solution.reshape(shape) if camera_height is not None else solution.reshape(shape) - solution.mean()


def _sides(grid: _Grid) -> list[_Side]:
    """Equations to the right, to the left, downwards, upwards."""
    facing = np.minimum(np.einsum("yxc,yxc->yx", grid.normals, grid.directions), -0.05)
    index = np.arange(facing.size).reshape(facing.shape)
    sides = []
    for axis, component in ((1, 0), (0, 1)):
        slope = (-grid.normals[..., component] * grid.steps[component] / facing).ravel()
        size = index.shape[axis]
        first, second = (np.take(index, span, axis=axis).ravel() for span in (np.arange(size - 1), np.arange(1, size)))
        sides += [_Side(first, second, slope[first]), _Side(second, first, -slope[second])]
    return sides


def _weights(sides: list[_Side], solution: NDArray[np.float64], spread: float) -> list[NDArray[np.float64]]:
    """Of each equation: of a pixel's two neighbours along an axis the one that fits it gets more."""
    misfits = np.full((len(sides), solution.size), np.inf)
    for misfit, side in zip(misfits, sides, strict=True):
        misfit[side.here] = ((solution[side.there] - solution[side.here] - side.slope) / spread) ** 2
    weights = []
    for k, side in enumerate(sides):
        own, other = misfits[k][side.here], misfits[k ^ 1][side.here]
        weights.append(1.0 / (1.0 + np.exp(-np.clip(_STEEPNESS * (other - own), -60, 60))) + 1e-5)
    return weights


def _solve(
    sides: list[_Side],
    weights: list[NDArray[np.float64]],
    target: NDArray[np.float64],
    hold: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Weighted least squares of differences, and of values' distance from ``target`` with the weight ``hold``."""
    unknowns = target.size
    here, there = (np.concatenate([getattr(side, end) for side in sides]) for end in ("here", "there"))
    slope, weight = np.concatenate([side.slope for side in sides]), np.concatenate(weights)
    diagonal = hold + np.bincount(here, weight, unknowns) + np.bincount(there, weight, unknowns)
    across = sparse.coo_matrix((-weight, (here, there)), (unknowns, unknowns))
    matrix = sparse.diags(diagonal) + across + across.T
    pull = np.bincount(there, weight * slope, unknowns) - np.bincount(here, weight * slope, unknowns)
    factors = splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    solution: NDArray[np.float64] = factors.solve(pull + hold * target)
    return solution
