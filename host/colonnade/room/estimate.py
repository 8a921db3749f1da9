"""Depth of a room that came without a depth map: from its normals, to scale by its floor.

On a smooth surface the normal says how depth changes from a pixel to the next: with the view ray d = (x, y, 1),
``grad log z = -(n_x / fx, n_y / fy) / (n . d)``. Log depth is the least-squares solution of that over all pairs of
neighbours; pairs that contradict it on one side only (an edge before something farther) lose weight in a few rounds, as
in Cao et al., "Bilateral Normal Integration", ECCV 2022. The floor, level and seen from a known height, gives the
scale.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from colonnade.errors import UserError
from colonnade.room.room import RoomCamera

#: Metres above the floor of a camera whose pose does not say.
DEFAULT_CAMERA_HEIGHT = 1.5
#: Pixels of the grid that is solved; larger maps are thinned out to it.
_GRID_PIXELS = 40_000
_ROUNDS = 12
#: Steepness of the choice between a pixel's two neighbours.
_STEEPNESS = 4.0
#: A surface that is level to within this cosine may be floor.
_LEVEL = 0.96
#: The share of the pixels that must be floor for it to give the scale.
_LEAST_FLOOR = 0.005


def depth_from_normals(
    normals: NDArray[np.float64], camera: RoomCamera, camera_height: float
) -> tuple[NDArray[np.float64], str]:
    """Depth in metres, float64 [height, width], and a note of how it came about."""
    if not np.isfinite(camera_height) or camera_height <= 0:
        raise UserError(f"the camera's height is {camera_height:g} m: it must be above the floor")
    height, width = normals.shape[:2]
    thin = max(1, int(np.ceil(np.sqrt(height * width / _GRID_PIXELS))))
    directions = camera.directions(width, height)
    rows, columns = np.arange(thin // 2, height, thin), np.arange(thin // 2, width, thin)
    chosen = np.ix_(rows, columns)
    log_depth = _integrate(normals[chosen], directions[chosen], thin / camera.fx, thin / camera.fy)

    # Each pixel lies in the plane of its grid point's normal, or its own where they agree less
    nearest = np.ix_(_nearest(height, thin, rows.size), _nearest(width, thin, columns.size))
    anchor = (directions[chosen] * np.exp(log_depth)[..., np.newaxis])[nearest]
    own = np.einsum("yxc,yxc->yx", normals, directions)
    own = np.minimum(own, -0.05)
    ratio = np.einsum("yxc,yxc->yx", normals, anchor) / own
    base = np.exp(log_depth)[nearest]
    depth = np.clip(ratio, base / 1.25, base * 1.25)
    scale, floor = _scale(normals, directions * depth[..., np.newaxis], camera, camera_height)
    note = f"no depth map: depth was estimated from the normals, {floor}"
    return depth * scale, note


def _nearest(pixels: int, thin: int, points: int) -> NDArray[np.intp]:
    return np.minimum(np.arange(pixels) // thin, points - 1)


def _integrate(
    normals: NDArray[np.float64], directions: NDArray[np.float64], step_x: float, step_y: float
) -> NDArray[np.float64]:
    """Log depth of a grid, its mean 0; ``step`` is a grid step in units of the focal length."""
    height, width = normals.shape[:2]
    facing = np.minimum(np.einsum("yxc,yxc->yx", normals, directions), -0.05)
    slopes = [-normals[..., 0] * step_x / facing, -normals[..., 1] * step_y / facing]
    index = np.arange(height * width).reshape(height, width)
    # Four one-sided equations a pixel: z(neighbour) - z(pixel) = +-slope(pixel)
    sides = []
    for axis, slope in ((1, slopes[0]), (0, slopes[1])):
        for sign in (1, -1):
            here = np.take(index, np.arange(max(0, -sign), index.shape[axis] - max(0, sign)), axis=axis)
            there = np.take(index, np.arange(max(0, sign), index.shape[axis] - max(0, -sign)), axis=axis)
            sides.append((here.ravel(), there.ravel(), sign * slope.ravel()[here.ravel()]))
    solution = np.zeros(height * width)
    weights = [np.full(here.size, 0.5) for here, _, _ in sides]
    spread = (step_x + step_y) / 2
    for _ in range(_ROUNDS):
        solution = _solve(solution.size, sides, weights)
        misfit = np.full((4, height * width), np.inf)
        for k, (here, there, slope) in enumerate(sides):
            misfit[k, here] = ((solution[there] - solution[here] - slope) / spread) ** 2
        for pair in ((0, 1), (2, 3)):
            first, second = misfit[pair[0]], misfit[pair[1]]
            with np.errstate(invalid="ignore"):
                difference = np.nan_to_num(second - first, posinf=60.0, neginf=-60.0)
            share = 1.0 / (1.0 + np.exp(-np.clip(_STEEPNESS * difference, -60, 60)))
            weights[pair[0]] = share[sides[pair[0]][0]] + 1e-5
            weights[pair[1]] = (1.0 - share)[sides[pair[1]][0]] + 1e-5
    log_depth: NDArray[np.float64] = solution.reshape(height, width) - solution.mean()
    return log_depth


def _solve(
    unknowns: int,
    sides: list[tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]],
    weights: list[NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Weighted least squares of differences; a faint pull to 0 makes it unique."""
    here = np.concatenate([side[0] for side in sides])
    there = np.concatenate([side[1] for side in sides])
    slope = np.concatenate([side[2] for side in sides])
    weight = np.concatenate(weights)
    diagonal = np.full(unknowns, 1e-9) + np.bincount(here, weight, unknowns) + np.bincount(there, weight, unknowns)
    across = sparse.coo_matrix((-weight, (here, there)), (unknowns, unknowns))
    matrix = sparse.diags(diagonal) + across + across.T
    right = np.bincount(there, weight * slope, unknowns) - np.bincount(here, weight * slope, unknowns)
    factors = splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    solution: NDArray[np.float64] = factors.solve(right)
    return solution


def _scale(
    normals: NDArray[np.float64], points: NDArray[np.float64], camera: RoomCamera, camera_height: float
) -> tuple[float, str]:
    """Metres a unit of the points, by the lowest level surface, and how it was found."""
    up = camera.to_world[1, :3]
    below = -(points @ up)
    level = (normals @ up > _LEVEL) & (below > 0)
    if np.count_nonzero(level) < max(8, _LEAST_FLOOR * level.size):
        # No floor in sight: let the lowest point be as low as the floor
        lowest = float(np.percentile(below, 99))
        if lowest <= 0:
            raise UserError("depth cannot be estimated: the camera sees no floor; give the room a depth map")
        return camera_height / lowest, f"its lowest point taken as {camera_height:.2f} m below the camera"
    floor = float(np.percentile(below[level], 85))
    return camera_height / floor, f"the floor taken as {camera_height:.2f} m below the camera"
