"""The decoded room in float64, which replaces the full maps and the depth mesh in the reference.

A `Backdrop` for each source of loss: encoded maps, reconstructed geometry, or both as in the device.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from colonnade.common.types import Floats
from colonnade.maps.decoded_planes import DecodedPlanes
from colonnade.maps.planes import SLOPE_PIXELS, PlaneProjection, unpack_planes
from colonnade.reference.environment.depth_mesh import DepthMesh
from colonnade.reference.environment.ray_march import MarchedGeometry, PlaneMarch, RayMarch
from colonnade.reference.environment.surface import Backdrop, BackdropPoints

if TYPE_CHECKING:
    from colonnade.environment.model import Environment
    from colonnade.maps.image import AttributeImage


class BoundingPlanes:
    """The bounding planes of a room, each with its mean albedo. A ray hits the nearest one that it leaves through."""

    def __init__(self, environment: Environment, image: AttributeImage) -> None:
        """Decode the bounding planes of an attribute image."""
        self._planes = DecodedPlanes.of(environment, image)

    def intersect(self, origins: Floats, directions: Floats) -> BackdropPoints:
        """Points where rays of view space, float64 [n, 3] each, hit the planes."""
        hits = self._planes.intersect(origins, directions)
        return BackdropPoints(hits.position, hits.normals, hits.albedo, hits.outside)


def float_plane_march(environment: Environment, image: AttributeImage) -> PlaneMarch:
    """The ray march through the planes of an attribute image, in float64, with one plane per pixel."""
    projection = PlaneProjection.of(environment, image.depth_unit)
    planes = unpack_planes(image.planes.planes)[image.planes.ids(image.layout)]
    w = image.planes.inverse_depth(image.layout, projection) / image.depth_unit
    slopes = np.moveaxis(planes[..., :2], 2, 0) / SLOPE_PIXELS / image.depth_unit
    return PlaneMarch(environment, w, slopes)


def decoded_depth(environment: Environment, image: AttributeImage) -> Floats:
    """Depth of each pixel by its decoded plane, metres along the view, float64 [height, width]."""
    return image.decoded_depth(PlaneProjection.of(environment, image.depth_unit))


def backdrops(environment: Environment, image: AttributeImage, march: RayMarch) -> dict[str, Backdrop]:
    """The source room (`full`), the room with one loss (`clustering`, `rebuild`), and with both losses (`both`).

    All have the bounding planes of the image.
    """
    bounding, mesh = BoundingPlanes(environment, image), DepthMesh(environment)
    depth, albedo, normals = decoded_depth(environment, image), image.decoded_albedo(), image.decoded_normals()
    geometry = MarchedGeometry(environment, march)
    return {
        "full": Backdrop(environment, mesh, environment.albedo, environment.normals, None, bounding),
        "clustering": Backdrop(environment, mesh, albedo, normals, None, bounding),
        "rebuild": Backdrop(environment, geometry, environment.albedo, environment.normals, depth, bounding),
        "both": Backdrop(environment, geometry, albedo, normals, depth, bounding),
    }
