"""The shadow window: the pixels of a room's photo whose light the object may change, which the device must render."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from colonnade.common.types import Floats

if TYPE_CHECKING:
    from colonnade.environment.model import Environment
    from colonnade.mesh.materials.mesh import Extent
    from colonnade.scene.view import View

#: x0, y0, x1, y1; x1 and y1 are exclusive.
Window = tuple[int, int, int, int]

#: Margin of the object's box, as a fraction of its edge; larger than the device's rounding errors.
MARGIN = 0.02
#: Surfaces within this many edges of the object's box gather light from it.
GATHER_REACH = 1.0
EMPTY: Window = (0, 0, 0, 0)


def whole_frame(view: View) -> Window:
    """The window of all pixels."""
    return 0, 0, view.width, view.height


def shadow_window(view: View, environment: Environment, depth: Floats, extent: Extent) -> Window:
    """The smallest window of pixels whose shadow rays may hit the object's box, a pixel wider on each side.

    With gathered light it also has the pixels whose surface is near the box.

    Args:
        view: The frame, with the room's pose.
        environment: The room, for its camera.
        depth: The device's decoded depth, float64 [environment.height, environment.width], metres along z.
        extent: Bounds of the object.
    """
    points = surface_points(view, environment, depth)
    margin = MARGIN * extent.edge
    low, high = extent.low - margin, extent.high + margin
    shaded = np.zeros(points.shape[:2], dtype=bool)
    for light in view.lights if view.shadows else ():
        shaded |= _hits_box(points, light.position - points, low, high)
    if view.gather is not None:
        reach = GATHER_REACH * extent.edge
        shaded |= ((points >= extent.low - reach) & (points <= extent.high + reach)).all(axis=2)
    if not shaded.any():
        return EMPTY
    if not view.is_map_camera:
        return _window_of(view, environment, points, shaded)
    columns, rows = np.flatnonzero(shaded.any(axis=0)), np.flatnonzero(shaded.any(axis=1))
    x0, y0 = max(0, int(columns[0]) - 1), max(0, int(rows[0]) - 1)
    return x0, y0, min(view.width, int(columns[-1]) + 2), min(view.height, int(rows[-1]) + 2)


@np.errstate(invalid="ignore")
def surface_points(view: View, environment: Environment, depth: Floats) -> Floats:
    """Points where the device takes the room's surface, mesh space, float64 [rows, columns, 3]; NaN at infinite depth.

    Of the frame's pixels, with the depth of a pixel's centre, also where its ray is shifted; for a camera that is
    not the maps', of the maps' pixels.
    """
    assert view.view_to_mesh is not None
    if not view.is_map_camera:
        seen = environment.camera.directions(environment.width, environment.height) * depth[..., None]
        return np.asarray(seen @ view.view_to_mesh[:, :3].T + view.view_to_mesh[:, 3])
    u = (np.arange(view.width) + 0.5) * environment.width / view.width
    v = (np.arange(view.height) + 0.5) * environment.height / view.height
    z = depth[np.ix_(v.astype(np.int64), u.astype(np.int64))]
    u += view.shift[0] * environment.width / view.width
    v += view.shift[1] * environment.height / view.height
    x, y = (u[None, :] - environment.cx) / environment.fx * z, (v[:, None] - environment.cy) / environment.fy * z
    return np.stack([x, y, z], axis=2) @ view.view_to_mesh[:, :3].T + view.view_to_mesh[:, 3]


def _window_of(view: View, environment: Environment, points: Floats, shaded: npt.NDArray[np.bool_]) -> Window:
    """The window of the shaded pixels of the maps in a frame of another camera.

    It is wider by twice the size of a pixel of the maps in the frame. It is the whole frame where a shaded surface
    reaches behind the camera.
    """
    assert view.view_to_mesh is not None
    basis = np.stack([view.step_x, view.step_y, view.direction], axis=1)
    seen = points[shaded & np.isfinite(points).all(axis=2)]
    solved = (seen - view.origin) @ np.linalg.inv(basis).T
    if len(seen) == 0:
        return EMPTY
    if (solved[:, 2] <= 0).any():
        return whole_frame(view)
    pixels = solved[:, :2] / solved[:, 2:]
    ways = np.linalg.norm(seen - view.view_to_mesh[:, 3], axis=1) / min(environment.fx, environment.fy)
    step = min(np.linalg.norm(view.step_x), np.linalg.norm(view.step_y))
    margin = 2.0 + 2.0 * float((ways / (solved[:, 2] * step)).max())
    limits = np.array([view.width, view.height])
    first = np.clip(np.floor(pixels.min(axis=0) - margin), 0, limits).astype(int)
    end = np.clip(np.ceil(pixels.max(axis=0) + margin) + 1, 0, limits).astype(int)
    if (first >= end).any():
        return EMPTY
    return int(first[0]), int(first[1]), int(end[0]), int(end[1])


def _hits_box(origins: Floats, directions: Floats, low: Floats, high: Floats) -> npt.NDArray[np.bool_]:
    """Whether origin + t · direction is in the box for some t from 0 to 1."""
    with np.errstate(divide="ignore", invalid="ignore"):
        crossings = np.stack([(low - origins) / directions, (high - origins) / directions])
    # A direction of 0 on an axis: the ray is in the slab for all t, or for none
    inside = (origins >= low) & (origins <= high)
    enters = np.where(directions == 0, np.where(inside, -np.inf, np.inf), crossings.min(axis=0)).max(axis=2)
    leaves = np.where(directions == 0, np.where(inside, np.inf, -np.inf), crossings.max(axis=0)).min(axis=2)
    hits: npt.NDArray[np.bool_] = np.maximum(enters, 0.0) <= np.minimum(leaves, 1.0)
    return hits
