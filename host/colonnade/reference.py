"""The reference picture: the float scene, unquantised, by the shading rules of docs/numbers.md in 64 bits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from colonnade.embree import RayTracer, SurfacePoints
from colonnade.progress import QUIET, Progress

if TYPE_CHECKING:
    from colonnade.meshes import Mesh
    from colonnade.viewpoint import FloatPlacement

Floats = NDArray[np.float64]

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
    """

    image: Floats
    object_mask: NDArray[np.bool_]
    hit_triangles: NDArray[np.int64]
    t: Floats
    rays: dict[str, int]


def render_reference(mesh: Mesh, view: FloatPlacement, progress: Progress = QUIET) -> ReferenceResult:
    """Render the mesh as placed by ``view``, with Embree, without any of the hardware's rounding."""
    tracer = RayTracer(mesh)
    shape = view.height, view.width
    image = np.empty((*shape, 3))
    triangles = np.full(shape, -1, dtype=np.int64)
    distances = np.full(shape, np.nan)
    rays = {"primary": view.width * view.height, "shadow": 0, "reflection": 0, "refraction": 0, "in_box": 0}
    rows_at_once = max(1, _RAYS_AT_ONCE // view.width)
    with progress.step("tracing the reference") as report:
        for first in range(0, view.height, rows_at_once):
            rows = slice(first, min(first + rows_at_once, view.height))
            directions = primary_directions(view, rows)
            origins = np.broadcast_to(view.origin, directions.shape)
            faces = tracer.first_hits(origins, directions)
            seen = np.flatnonzero(faces >= 0)
            rays["in_box"] += int(np.count_nonzero(tracer.enters_box(origins, directions)[0]))

            colours = np.tile(view.background, (len(directions), 1))
            points = tracer.surface_points(faces[seen], origins[seen], directions[seen])
            colours[seen] = _shade(tracer, mesh, view, faces[seen], directions[seen], points, rays)

            t = np.full(len(directions), np.nan)
            t[seen] = points.t
            source = np.full(len(directions), -1, dtype=np.int64)
            source[seen] = mesh.source_faces[faces[seen]]
            image[rows] = colours.reshape(-1, view.width, 3)
            triangles[rows] = source.reshape(-1, view.width)
            distances[rows] = t.reshape(-1, view.width)
            report(rows.stop / view.height)
    return ReferenceResult(image, triangles >= 0, triangles, distances, rays)


def primary_directions(view: FloatPlacement, rows: slice) -> Floats:
    """Directions of the rays through the pixels of some rows, float64 [rows * width, 3], row by row."""
    x = np.arange(view.width, dtype=np.float64)[None, :, None]
    y = np.arange(rows.start, rows.stop, dtype=np.float64)[:, None, None]
    return np.asarray(view.direction + x * view.step_x + y * view.step_y).reshape(-1, 3)


def _shade(
    tracer: RayTracer,
    mesh: Mesh,
    view: FloatPlacement,
    faces: NDArray[np.int64],
    directions: Floats,
    points: SurfacePoints,
    rays: dict[str, int],
) -> Floats:
    """Linear colours, float64 [n, 3], of the points where rays meet the object; counts the shadow rays."""
    corners = tracer.corners[faces]
    geometric = _unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    back_side = np.einsum("ni,ni->n", geometric, directions) > 0
    turned = np.where(back_side, -1.0, 1.0)[:, None]
    facing = geometric * turned
    normals = facing
    if not view.flat:
        smooth = np.einsum("nj,njk->nk", points.weights, mesh.vertex_normals[mesh.faces[faces]]) * turned
        normals = np.where(smooth.any(axis=1, keepdims=True), smooth, facing)

    # The shadow ray leaves from a little above the surface, on the side that is seen.
    origins = points.position + view.shadow_offset * facing
    to_light = view.light - origins
    cosine = np.einsum("ni,ni->n", _unit(normals), _unit(to_light)).clip(min=0.0)
    if view.shadows:
        asking = np.flatnonzero(cosine > 0)
        rays["shadow"] += len(asking)
        rays["in_box"] += int(np.count_nonzero(tracer.enters_box(origins[asking], to_light[asking], limit=1.0)[0]))
        cosine[asking[tracer.occluded(origins[asking], to_light[asking])]] = 0.0
    lit = view.albedo * (view.ambient + view.light_colour * cosine[:, None])
    return np.asarray(lit.clip(max=1.0), dtype=np.float64)


def _unit(vectors: Floats) -> Floats:
    """Vectors [n, 3] at length 1; zero stays zero."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1.0), dtype=np.float64)
