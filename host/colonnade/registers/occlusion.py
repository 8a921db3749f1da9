"""Registers of occlusion by the room: whether it may hide the object, and by how much it must be nearer."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats
from colonnade.registers.shadow_window import MARGIN, surface_points

if TYPE_CHECKING:
    from colonnade.design.manifest import Manifest
    from colonnade.maps.encoded import EncodedEnvironment
    from colonnade.mesh.materials.mesh import Extent
    from colonnade.scene.view import View
    from colonnade.scene_image.header import ImageHeader

#: Surfaces of the room around the object, in edges of its cube from its box: their errors count.
SURROUNDINGS = 0.5
#: Fewer pixels do not tell an error.
MIN_PIXELS = 64
#: The tolerance is this multiple of this percentile of the errors of the plane map.
FACTOR, PERCENTILE = 2.0, 90.0
#: Least tolerance, as a fraction of the distance to the object; largest one, in edges of the object's cube.
MIN_FRACTION, MAX_EDGES = 0.0025, 0.1


def occlusion_registers(
    view: View, encoded: EncodedEnvironment, header: ImageHeader, manifest: Manifest
) -> dict[str, int]:
    """The registers ``environment.occlusion`` and ``environment.occlusionTolerance`` of a frame.

    Arguments are as in `colonnade.registers.environment.environment_registers`.
    """
    tolerance = occlusion_tolerance(view, encoded, header.extent)
    if not view.occlusion or not may_hide(view, encoded, header.extent, tolerance):
        return {"environment.occlusion": 0, "environment.occlusionTolerance": 0}
    return _tolerance_register(tolerance, header, manifest) | {"environment.occlusion": 1}


def tolerance_registers(
    view: View, encoded: EncodedEnvironment, header: ImageHeader, manifest: Manifest
) -> dict[str, int]:
    """The register ``environment.occlusionTolerance``, grid steps; arguments as there."""
    return _tolerance_register(occlusion_tolerance(view, encoded, header.extent), header, manifest)


def _tolerance_register(tolerance: float, header: ImageHeader, manifest: Manifest) -> dict[str, int]:
    steps = header.frame.scale * 2.0 ** manifest.numbers["gridFraction"]
    limit = (1 << manifest.registers["environment.occlusionTolerance"].width) - 1
    return {"environment.occlusionTolerance": min(limit, math.ceil(tolerance * steps))}


def occlusion_tolerance(view: View, encoded: EncodedEnvironment, extent: Extent) -> float:
    """The distance, mesh units, by which a surface of the room must be nearer than the object to hide it.

    Distances are measured along the dominant axis of a ray. The tolerance follows from the error of the plane map at
    the surfaces around the object, which is the error of the surface that it stands on.
    """
    assert view.view_to_mesh is not None
    margin = SURROUNDINGS * extent.edge
    near = np.stack([extent.low - margin, extent.high + margin])
    error = _surface_error(encoded, view.view_to_mesh.tobytes(), near.tobytes())
    distance = float(np.abs(extent.centre - view.origin).max())
    low, high = MIN_FRACTION * distance, max(MAX_EDGES * extent.edge, MIN_FRACTION * distance)
    return high if error is None else float(np.clip(FACTOR * error, low, high))


@lru_cache(maxsize=1)  # frames of a moving camera have the same
def _surface_error(encoded: EncodedEnvironment, pose: bytes, near: bytes) -> float | None:
    """A percentile of the errors of the plane map in a box, mesh units; None if it has few pixels.

    Args:
        encoded: The room.
        pose: `View.view_to_mesh`, float64 [3, 4].
        near: Bounds of the box, mesh space, float64 [2, 3].
    """
    environment, decoded = encoded.environment, encoded.depth
    view_to_mesh, (low, high) = np.frombuffer(pose).reshape(3, 4), np.frombuffer(near).reshape(2, 3)
    linear, origin = view_to_mesh[:, :3], view_to_mesh[:, 3]
    directions = environment.camera.directions(environment.width, environment.height) @ linear.T
    points = directions * environment.depth[..., None] + origin
    counts = _inside(points, low, high)
    with np.errstate(invalid="ignore"):
        errors = np.abs(decoded[counts] - environment.depth[counts]) * np.abs(directions[counts]).max(axis=1)
    return None if errors.size < MIN_PIXELS else float(np.percentile(errors, PERCENTILE))


def may_hide(view: View, encoded: EncodedEnvironment, extent: Extent, tolerance: float) -> bool:
    """Whether in some pixel the room is nearer than the end of the object's box by more than a tolerance."""
    points = surface_points(view, encoded.environment, encoded.depth)
    # What hides the object is between the camera and the end of its box; few points are
    margin = MARGIN * extent.edge
    low, high = np.minimum(view.origin, extent.low) - margin, np.maximum(view.origin, extent.high) + margin
    between = points[_inside(points, low, high)]
    return bool((_margin_of_box_end(view.origin, between, extent) > tolerance).any())


def _inside(points: Floats, low: Floats, high: Floats) -> NDArray[np.bool_]:
    """Whether points, float64 [..., 3], are in a box; axis by axis, since a reduction over an axis of three is slow."""
    inside = np.ones(points.shape[:-1], dtype=bool)
    for axis in range(3):
        inside &= (points[..., axis] >= low[axis]) & (points[..., axis] <= high[axis])
    return inside


def _margin_of_box_end(origin: Floats, points: Floats, extent: Extent) -> Floats:
    """By how much the object's box ends behind points of the room, seen from the camera along the ray's dominant axis.

    Args:
        origin: Mesh space, float64 [3].
        points: Mesh space, float64 [..., 3].
        extent: Bounds of the object.

    Returns:
        float64 [...], mesh units; minus infinity for rays that miss the box.
    """
    directions = points - origin
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = (extent.low - origin) / directions, (extent.high - origin) / directions
    inside = (origin >= extent.low) & (origin <= extent.high)
    parallel = directions == 0
    first = np.where(parallel, np.where(inside, -np.inf, np.inf), np.minimum(low, high))
    last = np.where(parallel, np.where(inside, np.inf, -np.inf), np.maximum(low, high))
    enters = np.maximum(np.maximum(first[..., 0], first[..., 1]), first[..., 2])
    leaves = np.minimum(np.minimum(last[..., 0], last[..., 1]), last[..., 2])
    x, y, z = (np.abs(directions[..., axis]) for axis in range(3))
    margin = (leaves - 1.0) * np.maximum(np.maximum(x, y), z)
    return np.where((leaves >= np.maximum(enters, 0.0)), margin, -np.inf)
