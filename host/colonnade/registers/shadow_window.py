"""Which pixels of a room's photo may the object darken? The device renders these; the others are the photo's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from colonnade.common.types import Floats

if TYPE_CHECKING:
    from colonnade.environment.model import Environment
    from colonnade.mesh.mesh import Extent
    from colonnade.scene.view import View

#: x0, y0, x1, y1; the latter two exclusive.
Window = tuple[int, int, int, int]

#: The object's box grows by this share of its edge: more than any rounding of the device.
MARGIN = 0.02
EMPTY: Window = (0, 0, 0, 0)


def whole_frame(view: View) -> Window:
    """Every pixel."""
    return 0, 0, view.width, view.height


def shadow_window(view: View, environment: Environment, depth: Floats, extent: Extent) -> Window:
    """The least rectangle of pixels, and one more on each side, whose way to some light may meet the object's box.

    Args:
        view: The frame, with the room's pose.
        room: The maps' camera.
        depth: What the device takes for depth, float64 [room.height, room.width], metres along the optical axis.
        extent: The object's box.
    """
    if not view.shadows:
        return EMPTY
    points = _points(view, environment, depth)
    margin = MARGIN * extent.edge
    low, high = extent.low - margin, extent.high + margin
    shaded = np.zeros((view.height, view.width), dtype=bool)
    for light in view.lights:
        shaded |= _meets_box(points, light.position - points, low, high)
    if not shaded.any():
        return EMPTY
    columns, rows = np.flatnonzero(shaded.any(axis=0)), np.flatnonzero(shaded.any(axis=1))
    x0, y0 = max(0, int(columns[0]) - 1), max(0, int(rows[0]) - 1)
    return x0, y0, min(view.width, int(columns[-1]) + 2), min(view.height, int(rows[-1]) + 2)


def _points(view: View, environment: Environment, depth: Floats) -> Floats:
    """The room's points in the frame's pixels, mesh space, float64 [height, width, 3]."""
    assert view.view_to_mesh is not None
    u = (np.arange(view.width) + 0.5) * environment.width / view.width
    v = (np.arange(view.height) + 0.5) * environment.height / view.height
    z = depth[np.ix_(v.astype(np.int64), u.astype(np.int64))]
    x, y = (u[None, :] - environment.cx) / environment.fx * z, (v[:, None] - environment.cy) / environment.fy * z
    return np.stack([x, y, z], axis=2) @ view.view_to_mesh[:, :3].T + view.view_to_mesh[:, 3]


def _meets_box(starts: Floats, ways: Floats, low: Floats, high: Floats) -> npt.NDArray[np.bool_]:
    """Whether start + t · way lies in the box for some t from 0 to 1."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.stack([(low - starts) / ways, (high - starts) / ways])
    # Along an axis that a way does not change: everything, or nothing
    inside = (starts >= low) & (starts <= high)
    enters = np.where(ways == 0, np.where(inside, -np.inf, np.inf), ends.min(axis=0)).max(axis=2)
    leaves = np.where(ways == 0, np.where(inside, np.inf, -np.inf), ends.max(axis=0)).min(axis=2)
    meets: npt.NDArray[np.bool_] = np.maximum(enters, 0.0) <= np.minimum(leaves, 1.0)
    return meets
