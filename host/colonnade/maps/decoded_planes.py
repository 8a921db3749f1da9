"""The bounding planes of encoded maps, as the device decodes them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.common import fixed_order
from colonnade.environment.model import Environment
from colonnade.maps.image import AttributeImage
from colonnade.maps.planes import PlaneProjection, unpack_planes


@dataclass(frozen=True)
class PlaneHits:
    """Hits of rays on bounding planes, view space.

    Attributes:
        position, normals, albedo: float64 [n, 3]; undefined where `outside`.
        outside: The ray hits no plane, bool [n].
    """

    position: NDArray[np.float64]
    normals: NDArray[np.float64]
    albedo: NDArray[np.float64]
    outside: NDArray[np.bool_]


@dataclass(frozen=True)
class DecodedPlanes:
    """The bounding planes of encoded maps, view space. A ray hits the nearest one that it leaves through.

    Attributes:
        dual_vectors: A plane is the set of the points p with q · p = 1, float64 [n, 3].
        normals, albedos: float64 [n, 3].
    """

    dual_vectors: NDArray[np.float64]
    normals: NDArray[np.float64]
    albedos: NDArray[np.float64]

    @staticmethod
    def of(environment: Environment, image: AttributeImage) -> DecodedPlanes:
        """Decode the bounding planes of an attribute image."""
        words = image.planes.bounding[image.planes.bounding.any(axis=1)]
        vector_bits = 3 * image.layout.field_bits
        high = [int(low) | int(top) << 64 for low, top in words[:, 1:]]
        albedos = np.array([entry & ((1 << vector_bits) - 1) for entry in high], dtype=np.uint64)
        projection = PlaneProjection.of(environment, image.depth_unit)
        planes = unpack_planes(words[:, 0])
        return DecodedPlanes(
            projection.dual_vectors(planes), projection.normals(planes), image.albedo_space.vectors(albedos)
        )

    def intersect(self, origins: NDArray[np.float64], directions: NDArray[np.float64]) -> PlaneHits:
        """Where rays of view space, float64 [n, 3] each, hit the planes."""
        approach = fixed_order.product(directions, self.dual_vectors.T)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (1 - fixed_order.product(origins, self.dual_vectors.T)) / approach
        t = np.where((approach > 0) & (t > 0), t, np.inf)
        nearest = t.argmin(axis=1)
        t_hit = t[np.arange(len(t)), nearest]
        outside = ~np.isfinite(t_hit)
        position = origins + np.where(outside, 0.0, t_hit)[:, None] * directions
        return PlaneHits(position, self.normals[nearest], self.albedos[nearest], outside)
