"""The view file: what a target needs to compute a scene's registers from poses (docs/view.md), words of 32 bits."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from colonnade.common import fixed_order
from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.maps.planes import SLOPE_PIXELS
from colonnade.registers.occlusion import PERCENTILE
from colonnade.scene.cameras import WorldCamera
from colonnade.scene.object_pose import Pose
from colonnade.scene.samples import MAX_GATHERED
from colonnade.scene.view import PlacedLight, PlacedScene

if TYPE_CHECKING:
    from colonnade.design.manifest import Manifest
    from colonnade.environment.model import Environment
    from colonnade.maps.encoded import EncodedEnvironment
    from colonnade.scene.view import View
    from colonnade.scene_image.header import ImageHeader

MAGIC = b"CLNDVIEW"
VERSION = 3
AXES = "xyz"

#: Fraction bits of positions in metres, of rotations, of lenses, of lights' colours, of depths in a tile.
POSITION_FRACTION, ROTATION_FRACTION, LENS_FRACTION, COLOUR_FRACTION, DEPTH_FRACTION = 32, 30, 32, 16, 10
WORLD_BITS = 60
#: Of a grid position that the target computes, its low bits are 0 in a wider one.
SCENE_BITS = 40
#: Bounds of focal lengths, pixels; principal points have the upper one.
LEAST_FOCAL, LARGEST_FOCAL = 1 / 16, 1 << 24
#: Contents of `environment.window`; the last one: it and occlusion are constant. The largest error of a tile, 2^-16 m.
WINDOW_NONE, WINDOW_SHADOW, WINDOW_WHOLE, WINDOW_CONSTANT = range(4)
MAX_TILE_ERROR = (1 << 24) - 1

_NUMBERS = ("macBits", "sceneBits", "gridFraction", "coordinateBits", "boxPadLog", "mantissaBits", "vertexBits")


def frame_names() -> list[str]:
    """Registers that the target computes, in the order of their addresses: those of ``frame``."""
    rectangle = [f"frame.objectRect.{edge}" for edge in ("x0", "y0", "x1", "y1")]
    outline = [f"frame.objectOutline[{i}].{part}" for i in range(6) for part in ("x", "y", "offset")]
    return ["frame.width", "frame.height", *rectangle, *outline, "frame.unitShift"]


def camera_names() -> list[str]:
    """As `frame_names`, those of ``camera``."""
    vectors = [f"camera.{name}.{axis}" for name in ("position", "direction", "stepX", "stepY") for axis in AXES]
    return [*vectors, "camera.stepShift"]


def light_names(count: int) -> list[str]:
    """As `frame_names`, those of the first lights."""
    parts = [*(f"position.{axis}" for axis in AXES), *(f"colour.{channel}" for channel in "rgb")]
    return [f"lights[{i}].{part}" for i in range(count) for part in (*parts, "reachMantissa", "reachExponent")]


def environment_names() -> list[str]:
    """As `frame_names`, those of the projection to a room's maps."""
    rows = {
        name: [f"environment.{name}[{i}].{axis}" for i in range(3) for axis in AXES] for name in ("matrix", "rotation")
    }
    offset = [f"environment.offset.{axis}" for axis in AXES]
    return [*rows["matrix"], *offset, "environment.offsetShift", "environment.exponent", *rows["rotation"]]


def window_names() -> list[str]:
    """As `frame_names`, those of a room's window and occlusion."""
    window = [f"environment.window.{edge}" for edge in ("x0", "y0", "x1", "y1")]
    return [*window, *(f"environment.{name}" for name in ("occlusion", "occlusionTolerance", "isMapCamera"))]


def gather_names() -> list[str]:
    """As `frame_names`, the sample points of gathered rays."""
    return [f"gather.points[{i}].{axis}" for i in range(MAX_GATHERED) for axis in "uv"]


def computed_blocks(lights: int, has_room: bool) -> list[list[str]]:
    """The registers that the target computes from poses, in blocks without a gap."""
    room = [environment_names(), window_names()] if has_room else []
    return [frame_names(), camera_names(), light_names(lights), *room]


def view_file(
    placed: PlacedScene,
    registers: Mapping[str, int],
    size: tuple[int, int],
    header: ImageHeader,
    manifest: Manifest,
    room: EncodedEnvironment | None = None,
    occlusion: bool = True,
) -> bytes:
    """The file for a scene whose object, lights and camera may move.

    Args:
        placed: Poses and lights of the start.
        registers: All registers of the start; those that the target does not compute stay.
        size: Width and height of the start, pixels.
        header: Header of the mesh's scene image.
        manifest: The design's manifest.
        room: The scene's room and its encoded maps.
        occlusion: The room hides the object where it is nearer.

    Raises:
        UserError: The scene's places are out of the target's range.
    """
    step = _step(header, manifest)
    words: list[int] | None = None
    if room is not None:
        metres, pose = placed.pose.scale / step, room.environment.camera_to_world
        words = [
            registers["environment.isMapCamera"],
            *_map_words(room, metres, pose[:, :3], pose[:, 3]),
            *_surface_words(registers, size, room, header, manifest, occlusion),
        ]
    origin = np.array(header.frame.offset) * step
    samples = gather_names() if registers.get("gather.bounces", 0) else []
    return _file(placed, registers, size, header, manifest, (step / placed.pose.scale, origin), words, samples)


def still_file(
    view: View,
    registers: Mapping[str, int],
    header: ImageHeader,
    manifest: Manifest,
    room: EncodedEnvironment | None = None,
) -> bytes:
    """The file of one frame, in which nothing moves: the object's grid is its world.

    Args:
        view: The frame.
        registers: Those that the target does not compute; in a room, window and occlusion too.
        header: Header of the mesh's scene image.
        manifest: The design's manifest.
        room: The room and its encoded maps.

    Raises:
        UserError: The camera's lens is out of the target's range.
    """
    step, numbers = _step(header, manifest), manifest.numbers
    cube = header.frame.scale * 2.0 ** -numbers["vertexBits"]
    reach_log = numbers["gridFraction"] - numbers["sceneBits"] + WORLD_BITS - POSITION_FRACTION
    # A power of two: the cube has an edge of about 1, and the range's end is in the world
    unit = math.ldexp(0.5, math.frexp(min(cube, header.frame.scale * 2.0**reach_log))[1])
    offset = np.array(header.frame.offset)

    def in_grid(point: Floats) -> Floats:
        return np.asarray((point - offset) * unit)

    placed = PlacedScene(
        Pose(np.eye(3), 1.0, np.zeros(3)),
        _camera_of(view, in_grid(view.origin)),
        tuple(
            PlacedLight(in_grid(light.position), light.colour, None if light.reach is None else light.reach * unit)
            for light in view.lights
        ),
    )
    words: list[int] | None = None
    if room is not None:
        assert view.view_to_mesh is not None
        linear = view.view_to_mesh[:, :3]
        metre = _length(linear) / math.sqrt(3)
        words = [
            int(view.is_map_camera),
            *_map_words(room, 1 / (metre * step), linear / metre, in_grid(view.view_to_mesh[:, 3])),
            *(*[0] * 12, WINDOW_CONSTANT, 0, 0, 0, 1, 0, 0),
        ]
    return _file(placed, registers, (view.width, view.height), header, manifest, (step / unit, np.zeros(3)), words, [])


def _camera_of(view: View, position: Floats) -> WorldCamera:
    """A view's camera, at a position of the target's world."""
    right, down = (step / _length(step) for step in (view.step_x, view.step_y))
    axes = np.stack([right, -down, -np.cross(right, down)])
    return WorldCamera(position, view.direction, view.step_x, view.step_y, axes)


def _file(
    placed: PlacedScene,
    registers: Mapping[str, int],
    size: tuple[int, int],
    header: ImageHeader,
    manifest: Manifest,
    grid: tuple[float, Floats],
    room: list[int] | None,
    samples: list[str],
) -> bytes:
    """The file.

    `grid`: the target's grid steps in a metre, and its offset; `room`: words from ``isMapCamera`` on; `samples`: the
    registers of sample points, if passes set them.
    """
    numbers = manifest.numbers
    frame, lights = manifest.config["frame"], placed.lights
    blocks = computed_blocks(len(lights), room is not None)
    addresses = [_address(manifest, block) for block in blocks]
    is_constant = room is not None and room[_WINDOW_WORD] == WINDOW_CONSTANT
    computed = {name for block in (*(blocks[:-1] if is_constant else blocks), samples) for name in block}
    others = {name: value for name, value in registers.items() if name not in computed}
    constants = [pair for name, value in others.items() for pair in manifest.registers[name].encode(value)]
    words = [
        *(numbers[name] for name in _NUMBERS),
        *(int(frame["maxWidth"]), int(frame["maxHeight"]), 1 << COLOUR_FRACTION),
        *(addresses + [0] * 5)[:5],
        _address(manifest, samples) if samples else 0,
        *(len(lights), len(constants)),
        *_factor(grid[0]),
        *_position(grid[1] * 2.0 ** (16 - POSITION_FRACTION), "the mesh's origin"),
        *header.bounds_low,
        *header.bounds_high,
        *object_words(placed.pose),
        *camera_words(placed.camera, size),
        *(word for light in lights for word in light_words(light)),
        *([] if room is None else room),
        *(word for pair in constants for word in pair),
    ]
    content = np.zeros(12 + len(words), dtype="<u4")
    content[:2] = np.frombuffer(MAGIC, dtype="<u4")
    content[2:4] = VERSION, content.nbytes
    content[4:12] = manifest.format_words
    content[12:] = [word & 0xFFFFFFFF for word in words]
    return content.tobytes()


def object_words(pose: Pose) -> list[int]:
    """The object's position and rotation; its scale is in the number of grid steps in a metre."""
    return [*_position(pose.translate, "the object"), *rotation_values(pose.rotation)]


def camera_words(camera: WorldCamera, size: tuple[int, int]) -> list[int]:
    """Position, rotation, lens and size."""
    axes, lens = camera_values(camera)
    wide = (word for value in lens for word in _wide(value))
    return [*_position(camera.position, "the camera"), *rotation_values(axes), *wide, *size]


def camera_values(camera: WorldCamera) -> tuple[Floats, list[int]]:
    """The rotation from right, down, forward to world space, float64 [3, 3], and fx, fy, cx, cy, 2^-32 pixels."""
    right, up, toward = camera.axes
    x, y = 1 / _length(camera.step_x), 1 / _length(camera.step_y)
    along_x, along_y, depth = (float(value) for value in fixed_order.dot(camera.axes, camera.corner))
    lens = (x * -depth, y * -depth, 0.5 - x * along_x, 0.5 + y * along_y)
    values = [round(value * 2.0**LENS_FRACTION) for value in lens]
    if not all(LEAST_FOCAL <= value <= LARGEST_FOCAL for value in lens[:2]):
        raise UserError("the camera's focal length is out of the target's range, 1/16 to 16777216 pixels")
    if not all(abs(value) <= LARGEST_FOCAL for value in lens[2:]):
        raise UserError("the picture's centre is out of the target's range, 16777216 pixels")
    return np.column_stack([right, -up, -toward]), values


def light_words(light: PlacedLight) -> list[int]:
    """Position, colour and reach."""
    colour = [min(0xFFFFFFFF, round(float(value) * 2.0**COLOUR_FRACTION)) for value in light.colour]
    reach = 0 if light.reach is None else min(max(1, round(light.reach * 2.0**POSITION_FRACTION)), (1 << 64) - 1)
    return [*_position(light.position, "a light"), *colour, *_wide(reach)]


def position_values(position: Floats, what: str) -> list[int]:
    """A position in world space, 2^-32 m."""
    values = [round(float(value) * 2.0**POSITION_FRACTION) for value in position]
    if not all(abs(value) < 1 << WORLD_BITS for value in values):
        raise UserError(f"{what} is out of the target's range, 2^28 metres")
    return values


def rotation_values(rotation: Floats) -> list[int]:
    """A rotation, or a matrix within 2^-10 of one, row by row, 2^-30."""
    for _ in range(2):
        square = fixed_order.product(rotation, rotation.T)
        rotation = np.asarray(1.5 * rotation - 0.5 * fixed_order.product(square, rotation))
    return [round(float(value) * 2.0**ROTATION_FRACTION) for value in rotation.ravel()]


def _length(values: Floats) -> float:
    return math.sqrt(float((values * values).sum()))


def _position(position: Floats, what: str) -> Iterator[int]:
    return (word for value in position_values(position, what) for word in _wide(value))


def _wide(value: int) -> tuple[int, int]:
    return value & 0xFFFFFFFF, value >> 32 & 0xFFFFFFFF


def _factor(value: float) -> tuple[int, int, int]:
    """A positive number as mantissa, of two words, and exponent."""
    mantissa, exponent = math.frexp(value)
    return *_wide(int(math.ldexp(mantissa, 64))), exponent - 64


def _address(manifest: Manifest, names: Iterable[str]) -> int:
    """Address of the first of registers that follow each other."""
    registers = [manifest.registers[name] for name in names]
    for index, register in enumerate(registers):
        if index > 0 and register.address != registers[index - 1].address + registers[index - 1].words:
            raise ValueError(f"{register.name} does not follow {registers[index - 1].name}")
    return registers[0].address


def _more_grid_bits(manifest: Manifest) -> int:
    """Low bits of a grid position that the target does not compute."""
    return max(0, manifest.numbers["sceneBits"] - SCENE_BITS)


def _step(header: ImageHeader, manifest: Manifest) -> float:
    """The target's grid steps in a mesh unit."""
    return float(header.frame.scale * 2.0 ** (manifest.numbers["gridFraction"] - _more_grid_bits(manifest)))


#: Place of the window's contents in the words of a room.
_WINDOW_WORD = 1 + 2 * 3 + 4 * 2 + 15 + 12


def _map_words(room: EncodedEnvironment, metres: float, rotation: Floats, position: Floats) -> list[int]:
    """Metres in a grid step, lens and pose of the maps."""
    environment = room.environment
    lens = (environment.fx, environment.fy, environment.cx, environment.cy)
    return [
        *_factor(metres),
        *_factor(metres / (SLOPE_PIXELS * room.image.depth_unit)),
        *(word for value in lens for word in _wide(round(value * 2.0**LENS_FRACTION))),
        *_position(position, "the room's camera"),
        *rotation_values(rotation),
    ]


def _surface_words(
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
    shadowed = WINDOW_SHADOW if registers["shading.shadows"] else WINDOW_NONE
    window = [registers[name] for name in window_names()[:4]]
    limit = (1 << manifest.registers["environment.occlusionTolerance"].width) - 1 >> _more_grid_bits(manifest)
    tile = int(manifest.config["physicalAttributeMemory"]["tileSize"])
    tiles = tile_errors(environment, depth, tile)
    return [
        *_position(low, "the room"),
        *_position(high, "the room"),
        WINDOW_WHOLE if window == [0, 0, *size] or registers.get("gather.bounces", 0) else shadowed,
        int(occlusion),
        round(header.extent.edge * _step(header, manifest)),
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
