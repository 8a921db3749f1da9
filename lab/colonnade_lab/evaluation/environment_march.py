"""The device's bit-exact ray march through a reconstructed room, as a `RayMarch`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.design.manifest import Manifest, field_places
from colonnade.maps.image import memory_words
from colonnade.maps.planes import SLOPE_PIXELS
from colonnade.reference.environment.ray_march import HIDDEN, HIT, LEFT_VIEW, LOST, MarchHits

if TYPE_CHECKING:
    from colonnade.environment.model import Environment
    from colonnade.maps.image import AttributeImage


#: Grid steps per metre, log2, for rays without an object that defines the grid.
GRID_LOG = 20
#: Kinds of hits of the C++ `EnvironmentModel`.
_MAP, _SHELL = 1, 2


class DeviceMarch:
    """The ray march of ``cpp/model/environment.hpp`` through an attribute image."""

    def __init__(
        self, environment: Environment, image: AttributeImage, manifest: Manifest, is_from_camera: bool = False
    ) -> None:
        """Load the image into a model. The manifest's physical-attribute memory must have the image's layout.

        Args:
            environment: The room.
            image: Its encoded maps.
            manifest: Of the device.
            is_from_camera: Rays come from a camera: they see the maps, or nothing.
        """
        from colonnade import _core

        attributes = manifest.attributes
        if attributes is None:
            raise ValueError("the design has no physical-attribute memory")
        numbers = dict(manifest.numbers) | dict.fromkeys(("stackDepth", "bvh"), 0)
        self._model: Any = _core.EnvironmentModel(numbers, dict(attributes.sizes), field_places(attributes.layouts))
        for memory, words in memory_words(image):
            self._model.load(memory, words)
        self._environment, self._is_from_camera = environment, is_from_camera
        self._component = 1 << (manifest.numbers["shadeBits"] - 1)
        registers = view_registers(projection_of(environment, image) / 2.0**GRID_LOG, np.zeros(3), manifest)
        self._registers = {name.removeprefix("environment."): value for name, value in registers.items()}
        self._registers["boundingPlanes"] = int(image.planes.bounding.any(axis=1).sum())

    def __call__(self, origins: Floats, directions: Floats) -> MarchHits:
        """Hits of rays on the room. Rays are in view space, metres, float64 [n, 3] each."""
        environment, grid = self._environment, 2.0**GRID_LOG
        grid_origins = np.rint(origins * grid).astype(np.int64)
        scaled = directions / np.abs(directions).max(axis=1, keepdims=True)
        fixed = np.ascontiguousarray(np.rint(scaled * self._component).astype(np.int64))
        hits = self._model.march(self._registers, np.ascontiguousarray(grid_origins), fixed, self._is_from_camera)
        points = (grid_origins + hits["travel"][:, None] * fixed) / grid
        kind = np.where(hits["kind"] == _MAP, np.where(hits["is_hidden"], HIDDEN, HIT), LOST)
        kind = np.where(hits["kind"] == _SHELL, LEFT_VIEW, kind)
        z = points[:, 2]
        seen_u, seen_v = hits["x"] + 0.5, hits["y"] + 0.5
        is_ahead = ((kind == HIT) | (kind == HIDDEN)) & (z > 0)
        depth = np.where(is_ahead, z, 1.0)
        u = np.where(is_ahead, points[:, 0] / depth * environment.fx + environment.cx, seen_u)
        v = np.where(is_ahead, points[:, 1] / depth * environment.fy + environment.cy, seen_v)
        return MarchHits(u, v, z, seen_u, seen_v, kind.astype(np.int64), hits["steps"])


def projection_of(environment: Environment, image: AttributeImage) -> Floats:
    """Projection from view space, metres, to p with pixel 1024 · (p0, p1) / p2 and w = 1 / p2: float64 [3, 3]."""
    camera = np.array(
        [[environment.fx, 0.0, environment.cx], [0.0, environment.fy, environment.cy], [0.0, 0.0, SLOPE_PIXELS]]
    )
    return np.asarray(camera / (SLOPE_PIXELS * image.depth_unit), dtype=np.float64)


def view_registers(matrix: Floats, offset: Floats, manifest: Manifest) -> dict[str, int]:
    """Encode a projection of grid positions as ``environment.matrix``, ``environment.offset`` and their exponents."""
    maximum = (1 << (manifest.numbers["macBits"] - 1)) - 1
    exponent = math.floor(math.log2(maximum / float(np.abs(matrix).max())))
    scaled = offset * 2.0**exponent
    shift = max(0, math.ceil(math.log2(float(np.abs(scaled).max()) / maximum + 1e-300)))
    if shift > manifest.numbers["sceneBits"]:
        raise UserError("the object is too small for the room: make it larger")
    whole = np.rint(matrix * 2.0**exponent).astype(np.int64)
    registers = {f"environment.matrix[{i}].{axis}": int(whole[i, a]) for i in range(3) for a, axis in enumerate("xyz")}
    registers |= {f"environment.offset.{axis}": int(np.rint(scaled[a] / 2.0**shift)) for a, axis in enumerate("xyz")}
    return registers | {"environment.offsetShift": shift, "environment.exponent": exponent}
