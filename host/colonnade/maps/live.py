"""The live encoder: maps of a camera's frames in milliseconds, by ``host/cpp/live`` (docs/captures.md, "Live encoder").

It writes the words of the offline encoder's memories. Each frame starts with palettes, price of a word and planes of
the frame before.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colonnade import _core
from colonnade.common.errors import UserError
from colonnade.common.srgb import srgb_from_linear
from colonnade.environment.model import Environment, EnvironmentCamera
from colonnade.maps.image import AttributeImage
from colonnade.maps.layout import AttributeLayout
from colonnade.maps.two_level import TwoLevelMap

#: Tolerance of planes for exact depth, metres.
EXACT_TOLERANCE = 0.006
#: Distance, metres, at which the noise of a depth sensor gives the tolerance.
_NOISE_DISTANCE = 3.0
#: How often a still is encoded, each time with the palette of the time before.
STILL_ROUNDS = 3
#: Steps of depth in a metre.
_DEPTH_STEPS = 65536.0
#: What the encoder supports: the edge of a tile, and bits of a vector's component.
_TILE, _FIELD_BITS = 16, 12


@dataclass(frozen=True)
class LiveFrame:
    """The maps of a frame in the encoder's codes.

    Attributes:
        albedo: uint8 [height, width, 3], sRGB.
        normals: uint8 [height, width, 3], n * 127.5 + 127.5 in camera space: x right, y up, z towards the viewer.
        depth: uint32 [height, width], steps of 2^-16 m along the optical axis.
        camera: Lens and pose.
    """

    albedo: NDArray[np.uint8]
    normals: NDArray[np.uint8]
    depth: NDArray[np.uint32]
    camera: EnvironmentCamera

    @staticmethod
    def of(environment: Environment) -> LiveFrame:
        """The maps of a room."""
        normals = environment.normals * np.array([127.5, -127.5, -127.5]) + 127.5
        depth = np.rint(environment.depth * _DEPTH_STEPS)
        return LiveFrame(
            colour_codes(environment.albedo),
            np.clip(np.rint(normals), 0, 255).astype(np.uint8),
            np.clip(depth, 0, 2.0**32 - 1).astype(np.uint32),
            environment.camera,
        )


@dataclass(frozen=True)
class LiveMaps:
    """The encoded maps of a frame.

    Attributes:
        image: Contents of the physical-attribute memory.
        tile_error: float32 [rows, columns], of each tile the 90th percentile of the error along the view rays, metres.
        tile_nearest, tile_furthest: float32 [rows, columns], least and largest depth of each tile's planes, metres.
    """

    image: AttributeImage
    tile_error: NDArray[np.float32]
    tile_nearest: NDArray[np.float32]
    tile_furthest: NDArray[np.float32]


class LiveEncoder:
    """Encodes the frames of a camera.

    Args:
        layout: Sizes of the memories: ``twoLevel`` with tiles of 16 pixels.
        depth_noise: Standard deviation of the depth, as a fraction of it; 0 for exact depth.

    Raises:
        UserError: The layout is another.
    """

    def __init__(self, layout: AttributeLayout, depth_noise: float = 0.0) -> None:
        if not self.writes(layout):
            raise UserError(
                f"the live encoder writes twoLevel maps with tiles of {_TILE} pixels, not {layout.encoding} maps with"
                f" tiles of {layout.tile_size}: use the offline encoder"
            )
        self._layout = layout
        self._tolerance = max(EXACT_TOLERANCE, depth_noise * _NOISE_DISTANCE)
        names = ("width", "height", "palette_size", "heap_words", "planes", "plane_heap_words", "bounding_planes")
        self._encoder = _core.LiveRoom({name: getattr(layout, name) for name in names})

    @staticmethod
    def writes(layout: AttributeLayout) -> bool:
        """Whether the encoder writes maps of a layout."""
        return (layout.encoding, layout.tile_size, layout.field_bits) == ("twoLevel", _TILE, _FIELD_BITS)

    def encode(self, frame: LiveFrame) -> LiveMaps:
        """Encode the next frame.

        Raises:
            UserError: The maps are not of the layout's size.
        """
        layout, camera = self._layout, frame.camera
        for array in (frame.albedo, frame.normals, frame.depth):
            if array.shape[:2] != (layout.height, layout.width):
                raise UserError(
                    f"the maps are {array.shape[1]}x{array.shape[0]} pixels, the encoder's layout is"
                    f" {layout.width}x{layout.height}"
                )
        found = self._encoder.encode(
            *(_whole_tiles(array, _TILE) for array in (frame.albedo, frame.normals, frame.depth)),
            (camera.fx, camera.fy, camera.cx, camera.cy),
            np.ascontiguousarray(camera.to_world[:3], dtype=np.float64),
            self._tolerance,
        )
        memories = {name: found[name] for name in ("albedo", "normals", "planes")}
        tiles = (found[name].reshape(layout.tile_rows, -1) for name in ("tile_error", "tile_nearest", "tile_furthest"))
        return LiveMaps(AttributeImage.from_memories(layout, memories, found["depth_unit"]), *tiles)


def encode_still(environment: Environment, layout: AttributeLayout, rounds: int = STILL_ROUNDS) -> AttributeImage:
    """Encode a room as ``rounds`` equal frames.

    Raises:
        UserError: The live encoder does not support the layout.
    """
    encoder, frame = LiveEncoder(layout), LiveFrame.of(environment)
    for _ in range(rounds):
        maps = encoder.encode(frame)
    return maps.image


def encode_colours(colours: NDArray[np.float64], layout: AttributeLayout, rounds: int = STILL_ROUNDS) -> TwoLevelMap:
    """Encode linear colours, float64 [height, width, 3], as ``rounds`` equal frames; tiles of 8, 16 or 32 pixels."""
    if layout.field_bits != _FIELD_BITS:
        raise UserError(f"the live encoder writes fields of {_FIELD_BITS} bits: use the offline encoder")
    encoder = _core.LiveColours(
        layout.tile_columns, layout.tile_rows, layout.tile_size, layout.palette_size, layout.heap_words
    )
    codes = _whole_tiles(colour_codes(colours), layout.tile_size)
    for _ in range(rounds):
        memories = encoder.encode(codes)
    return TwoLevelMap(**memories)


def colour_codes(linear: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Linear colours as sRGB of 8 bits."""
    codes: NDArray[np.uint8] = np.rint(srgb_from_linear(linear) * 255.0).astype(np.uint8)
    return codes


def _whole_tiles(values: NDArray[Any], size: int) -> NDArray[Any]:
    """Repeat the last row and column up to whole tiles."""
    margin = tuple((0, -extent % size) for extent in values.shape[:2]) + ((0, 0),) * (values.ndim - 2)
    return np.ascontiguousarray(np.pad(values, margin, mode="edge"))
