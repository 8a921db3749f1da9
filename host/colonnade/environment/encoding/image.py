"""A room as the physical-attribute memory holds it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colonnade.common.errors import UserError
from colonnade.environment.encoding.layout import AttributeLayout
from colonnade.environment.encoding.plane_encoder import encode_planes
from colonnade.environment.encoding.plane_map import PlaneMap
from colonnade.environment.encoding.planes import Picture
from colonnade.environment.encoding.slic import SlicMap, encode_slic
from colonnade.environment.encoding.two_level import TwoLevelMap
from colonnade.environment.encoding.two_level_encoder import encode_two_level
from colonnade.environment.encoding.vectors import AlbedoSpace, NormalSpace, VectorSpace
from colonnade.environment.model import Environment

#: Bytes of a pixel in a map as it comes: three of 8 bits.
SOURCE_BYTES_A_PIXEL = 3


@dataclass(frozen=True)
class AttributeImage:
    """Memory contents, and how to read them.

    Attributes:
        layout: Sizes of the memories.
        albedo, normals: The two maps, of the layout's encoding.
        planes: Where the room's surfaces are, and the shell around it.
    """

    layout: AttributeLayout
    albedo: TwoLevelMap | SlicMap
    normals: TwoLevelMap | SlicMap
    planes: PlaneMap

    @property
    def depth_unit(self) -> float:
        """Metres: the plane map's w is this divided by the depth."""
        return self.planes.depth_unit

    def memories(self) -> dict[str, dict[str, NDArray[Any]]]:
        """Words of every memory, by map: each an array whose first axis is the address."""
        return {
            "albedo": dict(self.albedo.memories()),
            "normals": dict(self.normals.memories()),
            "planes": dict(self.planes.memories()),
        }

    @staticmethod
    def from_memories(
        layout: AttributeLayout, memories: dict[str, dict[str, NDArray[Any]]], depth_unit: float
    ) -> AttributeImage:
        """The image whose `memories` these are."""
        kind: type[TwoLevelMap] | type[SlicMap] = SlicMap if layout.encoding == "slic" else TwoLevelMap
        planes = PlaneMap(**memories["planes"], depth_unit=depth_unit)
        return AttributeImage(layout, kind(**memories["albedo"]), kind(**memories["normals"]), planes)

    def byte_counts(self) -> dict[str, int]:
        """Bytes of memory of each map."""
        of_map = self.layout.map_memory_bytes
        return {"albedo": of_map, "normals": of_map, "planes": self.layout.plane_memory_bytes}

    @property
    def source_bytes(self) -> int:
        """Bytes of one map as it came."""
        return self.layout.width * self.layout.height * SOURCE_BYTES_A_PIXEL

    def decoded_albedo(self) -> NDArray[np.float64]:
        """Linear albedo as the hardware reads it, float64 [height, width, 3]."""
        return self.albedo.decoded(self.layout, self.albedo_space)

    def decoded_normals(self) -> NDArray[np.float64]:
        """Normals as the hardware reads them, view space, unit but for rounding: float64 [height, width, 3]."""
        return self.normals.decoded(self.layout, self.normal_space)

    def decoded_depth(self, picture: Picture) -> NDArray[np.float64]:
        """Metres along z of the planes, float64 [height, width]."""
        return self.planes.depth(self.layout, picture)

    @property
    def albedo_space(self) -> VectorSpace:
        """How albedos are stored."""
        return AlbedoSpace(self.layout.field_bits)

    @property
    def normal_space(self) -> VectorSpace:
        """How normals are stored."""
        return NormalSpace(self.layout.field_bits)


def encode_environment(environment: Environment, layout: AttributeLayout) -> AttributeImage:
    """A room's maps, clustered as the layout says."""
    if (environment.width, environment.height) != (layout.width, layout.height):
        raise UserError(
            f"the maps of room {environment.name} are {environment.width}x{environment.height} pixels,"
            f" the hardware holds {layout.width}x{layout.height}: set physicalAttributeMemory.width and height"
        )
    encode = encode_slic if layout.encoding == "slic" else encode_two_level
    return AttributeImage(
        layout,
        encode(environment.albedo, AlbedoSpace(layout.field_bits), layout),
        encode(environment.normals, NormalSpace(layout.field_bits), layout),
        encode_planes(environment, layout),
    )


def memory_words(image: AttributeImage) -> Iterator[tuple[str, NDArray[np.uint8]]]:
    """Name and words, uint8 [words, bytes], low byte first, of each memory."""
    for map_name, words in image.memories().items():
        for name, values in words.items():
            rows = np.ascontiguousarray(values).reshape(len(values), -1)
            yield f"{map_name}.{name}", rows.view(np.uint8).reshape(len(rows), -1)
