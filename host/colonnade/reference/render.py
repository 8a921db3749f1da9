"""The reference picture: the float scene, unquantised, by the shading rules of docs/shading.md in 64 bits.

With a room the background is a `Backdrop`; unless another is given, that of the full maps and the depth map's mesh.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from colonnade.common.progress import QUIET, Progress
from colonnade.common.types import Floats
from colonnade.reference.object import PlacedObject
from colonnade.reference.path_tracer import PathTracer, Traced

if TYPE_CHECKING:
    from colonnade.mesh.mesh import Mesh
    from colonnade.reference.environment.surface import Backdrop
    from colonnade.scene.view import View


#: Rays traced at once, in whole rows: keeps the arrays small and the progress lively.
_RAYS_AT_ONCE = 1 << 16


@dataclass(frozen=True)
class ReferenceResult:
    """The reference frame.

    Attributes:
        image: linear colours, float64 [height, width, 3], 0.0 to 1.0.
        object_mask: bool [height, width], whether the pixel's ray meets the object.
        hit_triangles: int64 [height, width], face in the mesh's source; -1 where the ray misses.
        t: float64 [height, width], in lengths of the pixel's direction (depth in mesh units); not a number where the
            ray misses.
        rays: counts by kind (primary, shadow, reflection, refraction) and `in_box`, those that enter the object's box.
        shadow_ratio: float64 [height, width, 3]: what is left of the light on a background that is seen directly; 1
            elsewhere and without a room.
        outside: bool [height, width]: a part of the colour is of a background beyond all maps.
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
    """Render the mesh as placed by ``view``, with Embree, without any of the hardware's rounding.

    ``backdrop`` is the room that the placement was made for; without one, what misses the object has one colour.
    """
    tracer = PathTracer(PlacedObject(mesh, view), view, backdrop)
    rows_at_once = max(1, _RAYS_AT_ONCE // view.width)
    parts: list[Traced] = []
    with progress.step("tracing the reference") as report:
        for first in range(0, view.height, rows_at_once):
            rows = slice(first, min(first + rows_at_once, view.height))
            directions = primary_directions(view, rows)
            origins = np.broadcast_to(view.origin, directions.shape)
            parts.append(tracer.trace(origins, directions, _map_pixels(view, rows, backdrop)))
            report(rows.stop / view.height)

    def whole(name: str, *channels: int) -> NDArray[np.generic]:
        return np.concatenate([getattr(part, name) for part in parts]).reshape(view.height, view.width, *channels)

    faces = np.asarray(whole("faces"), dtype=np.int64)
    return ReferenceResult(
        image=np.asarray(whole("colours", 3), dtype=np.float64),
        object_mask=faces >= 0,
        hit_triangles=np.where(faces >= 0, mesh.source_faces[faces].astype(np.int64), -1),
        t=np.asarray(whole("t"), dtype=np.float64),
        rays=tracer.rays,
        shadow_ratio=np.asarray(whole("shadow_ratio", 3), dtype=np.float64),
        outside=np.asarray(whole("outside"), dtype=np.bool_),
    )


def primary_directions(view: View, rows: slice) -> Floats:
    """Directions of the rays through the pixels of some rows, float64 [rows * width, 3], row by row."""
    x = np.arange(view.width, dtype=np.float64)[None, :, None]
    y = np.arange(rows.start, rows.stop, dtype=np.float64)[:, None, None]
    return np.asarray(view.direction + x * view.step_x + y * view.step_y).reshape(-1, 3)


def _map_pixels(view: View, rows: slice, backdrop: Backdrop | None) -> Floats:
    """Where in the room's maps the pixels of some rows look, (u, v), float64 [rows * width, 2]."""
    across = along = 1.0
    if backdrop is not None:
        across, along = backdrop.environment.width / view.width, backdrop.environment.height / view.height
    v, u = np.mgrid[rows, : view.width] + 0.5
    return np.stack([u.ravel() * across, v.ravel() * along], axis=1)
