"""The reference renderer: the unquantised scene, traced in float64 by the shading rules of docs/shading.md."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from colonnade.common.progress import QUIET, Progress
from colonnade.common.types import Floats
from colonnade.reference.object import PlacedObject
from colonnade.reference.path_tracer import PathTracer, TracedPaths
from colonnade.reference.scatter import Bytes, pixel_words

if TYPE_CHECKING:
    from colonnade.mesh.materials.mesh import Mesh
    from colonnade.reference.environment.surface import Backdrop
    from colonnade.scene.view import View


#: Rays traced per batch, in whole rows. Batches bound the memory use and update the progress.
_BATCH_RAYS = 1 << 16


@dataclass(frozen=True)
class ReferenceResult:
    """The reference frame.

    Attributes:
        image: Linear colours, 0.0 to 1.0, float64 [height, width, 3].
        object_mask: The primary ray hits the object, bool [height, width].
        hit_triangles: Face in the mesh's source, -1 for a miss, int64 [height, width].
        t: Depth in mesh units (lengths of the pixel's direction), NaN for a miss, float64 [height, width].
        rays: Ray counts by kind (primary, shadow, reflection, refraction), and `in_box`, rays that enter the object's
            bounding box.
        shadow_ratio: Light on a directly visible background surface over its light without the object; 1 elsewhere and
            without a room, float64 [height, width, 3].
        outside: A part of the colour comes from a background that no map covers, bool [height, width].
    """

    image: Floats
    object_mask: NDArray[np.bool_]
    hit_triangles: NDArray[np.int64]
    t: Floats
    rays: dict[str, int]
    shadow_ratio: Floats
    outside: NDArray[np.bool_]


def render_reference(
    mesh: Mesh, view: View, progress: Progress = QUIET, backdrop: Backdrop | None = None
) -> ReferenceResult:
    """Render a mesh with Embree, without the hardware's rounding.

    Args:
        mesh: The object.
        view: Camera, materials and lights in mesh space.
        progress: Shows the progress.
        backdrop: The room that the view was made for; None: the view's background colour.
    """
    tracer = PathTracer(PlacedObject(mesh, view), view, backdrop)
    batch_rows = max(1, _BATCH_RAYS // view.width)
    batches: list[TracedPaths] = []
    with progress.step("tracing the reference") as report:
        for first in range(0, view.height, batch_rows):
            rows = slice(first, min(first + batch_rows, view.height))
            directions = primary_directions(view, rows)
            origins = np.broadcast_to(view.origin, directions.shape)
            batches.append(
                tracer.trace(origins, directions, _map_pixels(view, rows, backdrop), _pixel_words(view, rows))
            )
            report(rows.stop / view.height)

    def frame(name: str, *channels: int) -> NDArray[np.generic]:
        return np.concatenate([getattr(batch, name) for batch in batches]).reshape(view.height, view.width, *channels)

    faces = np.asarray(frame("faces"), dtype=np.int64)
    return ReferenceResult(
        image=np.asarray(frame("colours", 3), dtype=np.float64),
        object_mask=faces >= 0,
        hit_triangles=np.where(faces >= 0, mesh.source_faces[faces].astype(np.int64), -1),
        t=np.asarray(frame("t"), dtype=np.float64),
        rays=tracer.rays,
        shadow_ratio=np.asarray(frame("shadow_ratio", 3), dtype=np.float64),
        outside=np.asarray(frame("outside"), dtype=np.bool_),
    )


def primary_directions(view: View, rows: slice) -> Floats:
    """Directions of the primary rays of some rows, in row order, float64 [rows * width, 3]."""
    x = np.arange(view.width, dtype=np.float64)[None, :, None]
    y = np.arange(rows.start, rows.stop, dtype=np.float64)[:, None, None]
    return np.asarray(view.direction + x * view.step_x + y * view.step_y).reshape(-1, 3)


def _pixel_words(view: View, rows: slice) -> Bytes:
    """Sample points of the pixels of some rows, uint8 [rows * width, 2]."""
    y, x = np.mgrid[rows, : view.width]
    return pixel_words(x.ravel(), y.ravel())


def _map_pixels(view: View, rows: slice, backdrop: Backdrop | None) -> Floats:
    """Positions (u, v) in the room's maps that the rays of some rows show, float64 [rows * width, 2]."""
    u_scale = v_scale = 1.0
    if backdrop is not None:
        u_scale, v_scale = backdrop.environment.width / view.width, backdrop.environment.height / view.height
    v, u = np.mgrid[rows, : view.width] + 0.5
    return np.stack([(u.ravel() + view.shift[0]) * u_scale, (v.ravel() + view.shift[1]) * v_scale], axis=1)
