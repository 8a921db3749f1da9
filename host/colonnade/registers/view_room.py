"""A room in a view file: the pose of its maps, and what window and occlusion need (docs/driver.md)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats
from colonnade.maps.planes import SLOPE_PIXELS
from colonnade.registers.occlusion import PERCENTILE
from colonnade.registers.view_names import window_names
from colonnade.registers.view_words import (
    LENS_FRACTION,
    POSITION_FRACTION,
    WORLD_BITS,
    factor,
    grid_step,
    more_grid_bits,
    position_words,
    rotation_values,
    two_words,
)

if TYPE_CHECKING:
    from colonnade.design.manifest import Manifest
    from colonnade.environment.model import Environment
    from colonnade.maps.encoded import EncodedEnvironment
    from colonnade.scene_image.header import ImageHeader

#: Contents of `environment.window`; constant: so is occlusion. Shadows, and surfaces near the object, may be added up.
WINDOW_NONE, WINDOW_SHADOW, WINDOW_WHOLE, WINDOW_CONSTANT, WINDOW_NEAR = range(5)
#: The largest error of a tile, 2^-16 m.
MAX_TILE_ERROR = (1 << 24) - 1
#: Fraction bits of a depth in a tile.
DEPTH_FRACTION = 10
#: Place of the window's contents in the words of a room.
WINDOW_WORD = 1 + 2 * 3 + 4 * 2 + 15 + 12


def map_words(room: EncodedEnvironment, metres: float, rotation: Floats, position: Floats) -> list[int]:
    """Metres in a grid step, lens and pose of the maps."""
    environment = room.environment
    lens = (environment.fx, environment.fy, environment.cx, environment.cy)
    return [
        *factor(metres),
        *factor(metres / (SLOPE_PIXELS * room.image.depth_unit)),
        *(word for value in lens for word in two_words(round(value * 2.0**LENS_FRACTION))),
        *position_words(position, "the room's camera"),
        *rotation_values(rotation),
    ]


def surface_words(
    registers: Mapping[str, int],
    size: tuple[int, int],
    room: EncodedEnvironment,
    header: ImageHeader,
    manifest: Manifest,
    occlusion: bool,
) -> list[int]:
    """What window and occlusion of a moving object need."""
    environment, depth = room.environment, room.depth
    low, high = _bounds(environment, depth, size)
    changed = WINDOW_SHADOW if registers["shading.shadows"] else WINDOW_NONE
    changed += WINDOW_NEAR if registers.get("gather.bounces", 0) else WINDOW_NONE
    window = [registers[name] for name in window_names()[:4]]
    limit = (1 << manifest.registers["environment.occlusionTolerance"].width) - 1 >> more_grid_bits(manifest)
    tile = int(manifest.config["physicalAttributeMemory"]["tileSize"])
    tiles = tile_errors(environment, depth, tile)
    return [
        *position_words(low, "the room"),
        *position_words(high, "the room"),
        WINDOW_WHOLE if window == [0, 0, *size] else changed,
        int(occlusion),
        round(header.extent.edge * grid_step(header, manifest)),
        *(limit, tile, tiles.shape[1], tiles.shape[0]),
        *(int(word) for word in tiles.ravel()),
    ]


def _bounds(environment: Environment, depth: Floats, size: tuple[int, int]) -> tuple[Floats, Floats]:
    """A box around the decoded surface in world space, wider by the way of rays that miss a pixel's middle."""
    directions = environment.camera.directions(environment.width, environment.height)
    seen, to_world = np.isfinite(depth), environment.camera_to_world
    if not seen.any():
        return to_world[:, 3], to_world[:, 3]
    points = (directions[seen] * depth[seen][:, None]) @ to_world[:, :3].T + to_world[:, 3]
    pixel = max(environment.width / size[0], environment.height / size[1]) / min(environment.fx, environment.fy)
    margin, furthest = float(depth[seen].max()) * pixel, 2.0 ** (WORLD_BITS - POSITION_FRACTION - 1)
    return np.maximum(points.min(axis=0) - margin, -furthest), np.minimum(points.max(axis=0) + margin, furthest)


def tile_errors(environment: Environment, depth: Floats, tile: int) -> NDArray[np.uint32]:
    """Depths and errors of each tile of a room's maps: uint32 [rows, columns, 2].

    The first word has the least and the largest depth, 2^-10 m, 16 bits each; the second one the 90th percentile of the
    error along the view rays, 2^-16 m.
    """
    rays = environment.camera.directions(environment.width, environment.height)
    with np.errstate(invalid="ignore"):
        errors = np.abs(depth - environment.depth) * np.linalg.norm(rays, axis=2)
    rows, columns = -(-environment.height // tile), -(-environment.width // tile)
    result = np.zeros((rows, columns, 2), dtype=np.uint32)
    for row in range(rows):
        for column in range(columns):
            part = np.s_[row * tile : (row + 1) * tile, column * tile : (column + 1) * tile]
            near, far = depth[part].min() * 2.0**DEPTH_FRACTION, depth[part].max() * 2.0**DEPTH_FRACTION
            limits = min(0xFFFF, math.floor(min(near, 0xFFFF))), math.ceil(min(far, 0xFFFF))
            error = float(np.percentile(np.nan_to_num(errors[part], posinf=1e6), PERCENTILE))
            result[row, column] = limits[0] | limits[1] << 16, min(MAX_TILE_ERROR, math.ceil(error * 2.0**16))
    return result
