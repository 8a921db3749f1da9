"""A clustered room in floats: what the reference can be given in place of full maps, depth mesh and nothing beyond.

Each part of the loss has its `Backdrop`: the maps clustered, the geometry rebuilt, or both, as the device has it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from colonnade.common.types import Floats
from colonnade.environment.encoding.planes import SLOPE_PIXELS, PlaneProjection, unpack_planes
from colonnade.reference.environment.depth_mesh import DepthMesh
from colonnade.reference.environment.ray_march import PlaneMarch, Rebuild, RebuiltGeometry
from colonnade.reference.environment.surface import Backdrop, BackdropPoints

if TYPE_CHECKING:
    from colonnade.environment.encoding.image import AttributeImage
    from colonnade.environment.model import Environment


class PlaneShell:
    """The planes around a room, each in its mean albedo: a ray meets the nearest one that it comes to from inside."""

    def __init__(self, environment: Environment, image: AttributeImage) -> None:
        """The shell that an attribute image holds."""
        words = image.planes.shell[image.planes.shell.any(axis=1)]
        vector_bits = 3 * image.layout.field_bits
        high = [int(low) | int(top) << 64 for low, top in words[:, 1:]]
        albedos = np.array([entry & ((1 << vector_bits) - 1) for entry in high], dtype=np.uint64)
        projection = PlaneProjection.of(environment, image.depth_unit)
        planes = unpack_planes(words[:, 0])
        self._albedo = image.albedo_space.vectors(albedos)
        self._dual_vectors = projection.dual_vectors(planes)
        self._normals = projection.normals(planes)

    def meet(self, origins: Floats, directions: Floats) -> BackdropPoints:
        """Where rays of view space, float64 [n, 3] each, meet it."""
        against = directions @ self._dual_vectors.T
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (1 - origins @ self._dual_vectors.T) / against
        t = np.where((against > 0) & (t > 0), t, np.inf)
        nearest = t.argmin(axis=1)
        reach = t[np.arange(len(t)), nearest]
        outside = ~np.isfinite(reach)
        position = origins + np.where(outside, 0.0, reach)[:, None] * directions
        return BackdropPoints(position, self._normals[nearest], self._albedo[nearest], outside)


def plane_march(environment: Environment, image: AttributeImage) -> PlaneMarch:
    """The march through the planes of an attribute image, in 64 bits and with a map of a plane for each pixel."""
    projection = PlaneProjection.of(environment, image.depth_unit)
    planes = unpack_planes(image.planes.planes)[image.planes.ids(image.layout)]
    w = image.planes.inverse_depth(image.layout, projection) / image.depth_unit
    slopes = np.moveaxis(planes[..., :2], 2, 0) / SLOPE_PIXELS / image.depth_unit
    return PlaneMarch(environment, w, slopes)


def rebuilt_depth(environment: Environment, image: AttributeImage) -> Floats:
    """Metres along the view of what each pixel shows, by the planes: float64 [height, width]."""
    return image.decoded_depth(PlaneProjection.of(environment, image.depth_unit))


def backdrops(environment: Environment, image: AttributeImage, rebuild: Rebuild) -> dict[str, Backdrop]:
    """The room as it is, and with each loss for itself: `full`, `clustering`, `rebuild`, and `both`.

    All have the image's shell around them.
    """
    shell, mesh, depth = PlaneShell(environment, image), DepthMesh(environment), rebuilt_depth(environment, image)
    albedo, normals = image.decoded_albedo(), image.decoded_normals()
    geometry = RebuiltGeometry(environment, rebuild)
    return {
        "full": Backdrop(environment, mesh, environment.albedo, environment.normals, None, shell),
        "clustering": Backdrop(environment, mesh, albedo, normals, None, shell),
        "rebuild": Backdrop(environment, geometry, environment.albedo, environment.normals, depth, shell),
        "both": Backdrop(environment, geometry, albedo, normals, depth, shell),
    }
