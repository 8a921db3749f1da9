"""The attribute image: an environment's maps as contents of the physical-attribute memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colonnade.common.errors import UserError
from colonnade.environment.model import Environment
from colonnade.maps.layout import AttributeLayout
from colonnade.maps.plane_encoder import depth_unit_of, encode_bounding, encode_surfaces
from colonnade.maps.plane_map import PlaneMap
from colonnade.maps.planes import PlaneProjection
from colonnade.maps.slic import SlicMap, encode_slic
from colonnade.maps.two_level import TwoLevelMap
from colonnade.maps.two_level_encoder import encode_two_level
from colonnade.maps.vectors import AlbedoSpace, NormalSpace, VectorSpace

#: The words of a part of the maps by memory, and what makes them or takes them from a cache, by the name of the part.
Words = dict[str, NDArray[Any]]
Keep = Callable[[str, Callable[[], Words]], Words]

#: Bytes per pixel of a source map: three components of 8 bits.
SOURCE_BYTES_PER_PIXEL = 3


@dataclass(frozen=True)
class AttributeImage:
    """Contents of the physical-attribute memory, and their decoder.

    Attributes:
        layout: Sizes of the memories.
        albedo, normals: The two maps, in the layout's encoding.
        planes: The plane map and the bounding planes.
    """

    layout: AttributeLayout
    albedo: TwoLevelMap | SlicMap
    normals: TwoLevelMap | SlicMap
    planes: PlaneMap

    @property
    def depth_unit(self) -> float:
        """Depth of w = 1 in the plane map, metres: w = depth_unit / depth."""
        return self.planes.depth_unit

    def memories(self) -> dict[str, dict[str, NDArray[Any]]]:
        """Words of each memory by map and name; the first axis of an array is the address."""
        return {
            "albedo": dict(self.albedo.memories()),
            "normals": dict(self.normals.memories()),
            "planes": dict(self.planes.memories()),
        }

    @staticmethod
    def from_memories(
        layout: AttributeLayout, memories: dict[str, dict[str, NDArray[Any]]], depth_unit: float
    ) -> AttributeImage:
        """Rebuild an image from its `memories`."""
        kind: type[TwoLevelMap] | type[SlicMap] = SlicMap if layout.encoding == "slic" else TwoLevelMap
        planes = PlaneMap(**memories["planes"], depth_unit=depth_unit)
        return AttributeImage(layout, kind(**memories["albedo"]), kind(**memories["normals"]), planes)

    def byte_counts(self) -> dict[str, int]:
        """Memory size of each map, bytes."""
        map_bytes = self.layout.map_memory_bytes
        return {"albedo": map_bytes, "normals": map_bytes, "planes": self.layout.plane_memory_bytes}

    @property
    def source_bytes(self) -> int:
        """Size of one source map, bytes."""
        return self.layout.width * self.layout.height * SOURCE_BYTES_PER_PIXEL

    def decoded_albedo(self) -> NDArray[np.float64]:
        """Linear albedo decoded as in the hardware, float64 [height, width, 3]."""
        return self.albedo.decoded(self.layout, self.albedo_space)

    def decoded_normals(self) -> NDArray[np.float64]:
        """View-space normals decoded as in the hardware, unit length up to rounding: float64 [height, width, 3]."""
        return self.normals.decoded(self.layout, self.normal_space)

    def decoded_depth(self, projection: PlaneProjection) -> NDArray[np.float64]:
        """Depth of the plane map, metres along z: float64 [height, width]."""
        return self.planes.depth(self.layout, projection)

    @property
    def albedo_space(self) -> VectorSpace:
        """Storage format of albedos."""
        return AlbedoSpace(self.layout.field_bits)

    @property
    def normal_space(self) -> VectorSpace:
        """Storage format of normals."""
        return NormalSpace(self.layout.field_bits)


def encode_environment(
    environment: Environment, layout: AttributeLayout, keep: Keep = lambda _, make: make()
) -> AttributeImage:
    """Encode an environment's maps in the layout's encoding.

    Args:
        environment: The environment.
        layout: Sizes of the memories.
        keep: Makes the words of ``albedo``, ``normals``, ``planes`` and ``bounding``.

    Raises:
        UserError: The maps' size differs from the layout's.
    """
    if (environment.width, environment.height) != (layout.width, layout.height):
        raise UserError(
            f"the maps of room {environment.name} are {environment.width}x{environment.height} pixels,"
            f" the hardware holds {layout.width}x{layout.height}: set physicalAttributeMemory.width and height"
        )
    encode = encode_slic if layout.encoding == "slic" else encode_two_level

    def encoded(values: NDArray[np.float64], space: VectorSpace) -> Words:
        return dict(encode(values, space, layout).memories())

    albedo = keep("albedo", lambda: encoded(environment.albedo, AlbedoSpace(layout.field_bits)))
    normals = keep("normals", lambda: encoded(environment.normals, NormalSpace(layout.field_bits)))
    planes = keep("planes", lambda: encode_surfaces(environment, layout))
    bounding = keep("bounding", lambda: encode_bounding(environment, layout, planes["planes"]))
    memories = {"albedo": albedo, "normals": normals, "planes": planes | bounding}
    return AttributeImage.from_memories(layout, memories, depth_unit_of(environment))


def memory_words(image: AttributeImage) -> Iterator[tuple[str, NDArray[np.uint8]]]:
    """Yield the name and the words of each memory, uint8 [words, bytes], low byte first."""
    for map_name, words in image.memories().items():
        for name, values in words.items():
            yield f"{map_name}.{name}", words_of(values)


def words_of(values: NDArray[Any]) -> NDArray[np.uint8]:
    """The words of one memory, whose address is the first axis, as uint8 [words, bytes], low byte first."""
    rows = np.ascontiguousarray(values).reshape(len(values), -1)
    return rows.view(np.uint8).reshape(len(rows), -1)
