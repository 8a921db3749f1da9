"""Sizes of the physical-attribute memory: the configured ones, and those derived from them.

| memory | word, bits | words |
|---|---|---|
| descriptors (`twoLevel`) | 32 | tiles |
| palette (`twoLevel`) | three fields | `palette_size` |
| heap (`twoLevel`) | 16 | rest of `map_bytes` |
| seeds (`slic`) | three fields | tiles |
| labels (`slic`) | 16: four labels | blocks / 4 |
| plane descriptors | 16 | tiles |
| planes | 64 | `planes` |
| plane heap | 16 | rest of `plane_bytes` |
| bounding planes | 144 | `bounding_planes` |
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from colonnade.common.errors import UserError

#: Bits of a pointer to 16-bit heap words, of a palette index or plane id, and of the memories' words.
POINTER_BITS = 13
INDEX_BITS = 8
DESCRIPTOR_BITS = 32
PLANE_DESCRIPTOR_BITS = 16
HEAP_WORD_BITS = 16
PLANE_BITS = 64
SHELL_BITS = 144
#: Bits of a `slic` label, which names one of the 3x3 neighbouring seeds.
LABEL_BITS = 4
#: Blocks on a tile's edge; the pixels of a block share a label.
BLOCKS_PER_TILE_EDGE = 4


#: Fields that no configuration has: the hardware decodes components of 12 bits.
HOST_ONLY = ("field_bits",)


@dataclass(frozen=True)
class AttributeLayout:
    """Sizes of the maps and their memories.

    Attributes:
        width, height: Pixels of the maps.
        encoding: Of albedo and normals: ``twoLevel``, or ``slic``, the superpixels of the source paper.
        tile_size: Edge of a tile, pixels: 8, 16 or 32.
        palette_size: Entries of a two-level map's palette, 4 to 256.
        field_bits: Bits of a vector's component, 6 to 13.
        map_bytes: Bytes of the albedo map, and of the normal map; SLIC maps take what they need of them.
        planes: Entries of the plane table, 2 to 128; the last plane is infinitely far away.
        plane_bytes: Bytes of the plane table, the plane map and the bounding planes.
        bounding_planes: Number of bounding planes, for rays that leave the view.

    Raises:
        UserError: A size is out of range, or the bytes are too few for the fixed tables."""

    width: int = 640
    height: int = 480
    encoding: str = "twoLevel"
    tile_size: int = 16
    palette_size: int = 256
    field_bits: int = 12
    map_bytes: int = 16384
    planes: int = 128
    plane_bytes: int = 12288
    bounding_planes: int = 8

    def __post_init__(self) -> None:
        def within(name: str, low: int, high: int) -> None:
            value = getattr(self, name)
            if not low <= value <= high:
                raise UserError(f"background layout: {name} is {value}, it must be from {low} to {high}")

        within("width", 1, 4096)
        within("height", 1, 4096)
        within("palette_size", 4, 1 << INDEX_BITS)
        within("field_bits", 6, 13)
        within("planes", 2, 128)
        within("bounding_planes", 1, 16)
        if self.tile_size not in (8, 16, 32):
            raise UserError(f"background layout: tile_size is {self.tile_size}, it must be 8, 16 or 32")
        if self.encoding not in ("twoLevel", "slic"):
            raise UserError(f"background layout: encoding is {self.encoding!r}, it must be twoLevel or slic")
        if self.encoding == "twoLevel":
            self._enough("map_bytes", self.map_bytes, self.tiles * DESCRIPTOR_BITS + self.palette_bits)
        else:
            self._enough("map_bytes", self.map_bytes, self.tiles * self.vector_bits + self.label_words * HEAP_WORD_BITS)
        self._enough("plane_bytes", self.plane_bytes, self._fixed_plane_bits)

    def _enough(self, name: str, available: int, needed_bits: int) -> None:
        if available * 8 < needed_bits:
            raise UserError(
                f"background layout: {name} is {available:,}, but {self.width}x{self.height} pixels in tiles of"
                f" {self.tile_size} need at least {-(-needed_bits // 8):,}: raise it, or use larger tiles"
            )

    @staticmethod
    def from_config(section: Mapping[str, Any]) -> AttributeLayout:
        """Build the layout of a configuration's section ``physicalAttributeMemory``."""
        names = {"tileSize": "tile_size", "paletteSize": "palette_size", "mapBytes": "map_bytes"}
        names |= {"planeBytes": "plane_bytes", "boundingPlanes": "bounding_planes"}
        return AttributeLayout(
            **{names.get(key, key): value for key, value in section.items() if key != "columnsPerCopy"}
        )

    def to_config(self) -> dict[str, Any]:
        """The configuration section ``physicalAttributeMemory`` with these sizes."""
        names = {"tile_size": "tileSize", "palette_size": "paletteSize", "map_bytes": "mapBytes"}
        names |= {"plane_bytes": "planeBytes", "bounding_planes": "boundingPlanes"}
        sizes = {names.get(name, name): value for name, value in asdict(self).items() if name not in HOST_ONLY}
        return {**sizes, "columnsPerCopy": 1}

    @property
    def tile_columns(self) -> int:
        """Tiles in a row."""
        return -(-self.width // self.tile_size)

    @property
    def tile_rows(self) -> int:
        """Rows of tiles."""
        return -(-self.height // self.tile_size)

    @property
    def tiles(self) -> int:
        """Number of tiles; tile (x, y) has the index y * `tile_columns` + x."""
        return self.tile_columns * self.tile_rows

    @property
    def vector_bits(self) -> int:
        """Bits of a palette entry or a seed."""
        return 3 * self.field_bits

    @property
    def palette_bits(self) -> int:
        """Bits of a palette."""
        return self.palette_size * self.vector_bits

    @property
    def heap_words(self) -> int:
        """Words of a `twoLevel` map's heap: the rest of its bytes, within the pointer's range."""
        left = self.map_bytes * 8 - self.tiles * DESCRIPTOR_BITS - self.palette_bits
        return min(left // HEAP_WORD_BITS, 1 << POINTER_BITS)

    @property
    def block_size(self) -> int:
        """Edge of a block with one label, pixels."""
        return self.tile_size // BLOCKS_PER_TILE_EDGE

    @property
    def block_columns(self) -> int:
        """Blocks in a row."""
        return -(-self.width // self.block_size)

    @property
    def block_rows(self) -> int:
        """Rows of blocks."""
        return -(-self.height // self.block_size)

    @property
    def label_words(self) -> int:
        """Words of a `slic` map's labels."""
        return -(-self.block_columns * self.block_rows * LABEL_BITS // HEAP_WORD_BITS)

    @property
    def _fixed_plane_bits(self) -> int:
        tables = self.planes * PLANE_BITS + self.bounding_planes * SHELL_BITS
        return self.tiles * PLANE_DESCRIPTOR_BITS + tables

    @property
    def plane_heap_words(self) -> int:
        """Words of the plane map's heap: the rest of its bytes, within the pointer's range."""
        return min((self.plane_bytes * 8 - self._fixed_plane_bits) // HEAP_WORD_BITS, 1 << POINTER_BITS)

    @property
    def map_memory_bytes(self) -> int:
        """Size of an albedo or normal map's memories, bytes."""
        if self.encoding == "twoLevel":
            bits = self.tiles * DESCRIPTOR_BITS + self.palette_bits + self.heap_words * HEAP_WORD_BITS
        else:
            bits = self.tiles * self.vector_bits + self.label_words * HEAP_WORD_BITS
        return -(-bits // 8)

    @property
    def plane_memory_bytes(self) -> int:
        """Size of the planes' memories, bytes."""
        return -(-(self._fixed_plane_bits + self.plane_heap_words * HEAP_WORD_BITS) // 8)

    @property
    def infinite_plane(self) -> int:
        """Id of the plane that is infinitely far away."""
        return self.planes - 1
