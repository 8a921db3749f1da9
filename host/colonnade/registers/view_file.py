"""The view file: what a target needs to compute a scene's registers from poses (docs/driver.md), words of 32 bits."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from colonnade.common.types import Floats
from colonnade.registers.view_names import computed_blocks, gather_names
from colonnade.registers.view_room import WINDOW_CONSTANT, WINDOW_WORD, map_words, surface_words
from colonnade.registers.view_words import (
    COLOUR_FRACTION,
    POSITION_FRACTION,
    WORLD_BITS,
    camera_words,
    factor,
    grid_step,
    length,
    light_words,
    object_words,
    position_words,
)
from colonnade.scene.cameras import WorldCamera
from colonnade.scene.object_pose import Pose
from colonnade.scene.view import PlacedLight, WorldView

if TYPE_CHECKING:
    from colonnade.design.manifest import Manifest
    from colonnade.maps.encoded import EncodedEnvironment
    from colonnade.scene.view import View
    from colonnade.scene_image.header import ImageHeader

MAGIC = b"CLNDVIEW"
VERSION = 3

_NUMBERS = ("macBits", "sceneBits", "gridFraction", "coordinateBits", "boxPadLog", "mantissaBits", "vertexBits")


def view_file(
    world: WorldView,
    registers: Mapping[str, int],
    size: tuple[int, int],
    header: ImageHeader,
    manifest: Manifest,
    room: EncodedEnvironment | None = None,
    occlusion: bool = True,
) -> bytes:
    """The file for a scene whose object, lights and camera may move.

    Args:
        world: Poses and lights of the start.
        registers: All registers of the start; registers that the target does not compute stay.
        size: Width and height of the start, pixels.
        header: Header of the mesh's scene image.
        manifest: The design's manifest.
        room: The scene's room and its encoded maps.
        occlusion: The room hides the object where it is nearer.

    Raises:
        UserError: The scene's places are out of the target's range.
    """
    step = grid_step(header, manifest)
    words: list[int] | None = None
    if room is not None:
        metres, pose = world.pose.scale / step, room.environment.camera_to_world
        words = [
            registers["environment.isMapCamera"],
            *map_words(room, metres, pose[:, :3], pose[:, 3]),
            *surface_words(registers, size, room, header, manifest, occlusion),
        ]
    origin = np.array(header.frame.offset) * step
    samples = gather_names() if registers.get("gather.bounces", 0) else []
    return _file(world, registers, size, header, manifest, (step / world.pose.scale, origin), words, samples)


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
        registers: Registers that the target does not compute; in a room also window and occlusion.
        header: Header of the mesh's scene image.
        manifest: The design's manifest.
        room: The room and its encoded maps.

    Raises:
        UserError: The camera's lens is out of the target's range.
    """
    step, numbers = grid_step(header, manifest), manifest.numbers
    cube = header.frame.scale * 2.0 ** -numbers["vertexBits"]
    reach_log = numbers["gridFraction"] - numbers["sceneBits"] + WORLD_BITS - POSITION_FRACTION
    # A power of two: the cube has an edge of about 1, and the range's end is in the world
    unit = math.ldexp(0.5, math.frexp(min(cube, header.frame.scale * 2.0**reach_log))[1])
    offset = np.array(header.frame.offset)

    def in_grid(point: Floats) -> Floats:
        return np.asarray((point - offset) * unit)

    world = WorldView(
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
        metre = length(linear) / math.sqrt(3)
        words = [
            int(view.is_map_camera),
            *map_words(room, 1 / (metre * step), linear / metre, in_grid(view.view_to_mesh[:, 3])),
            *(*[0] * 12, WINDOW_CONSTANT, 0, 0, 0, 1, 0, 0),
        ]
    return _file(world, registers, (view.width, view.height), header, manifest, (step / unit, np.zeros(3)), words, [])


def _camera_of(view: View, position: Floats) -> WorldCamera:
    """A view's camera, at a position of the target's world."""
    right, down = (step / length(step) for step in (view.step_x, view.step_y))
    axes = np.stack([right, -down, -np.cross(right, down)])
    return WorldCamera(position, view.direction, view.step_x, view.step_y, axes)


def _file(
    world: WorldView,
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
    frame, lights = manifest.config["frame"], world.lights
    blocks = computed_blocks(len(lights), room is not None)
    addresses = [_address(manifest, block) for block in blocks]
    is_constant = room is not None and room[WINDOW_WORD] == WINDOW_CONSTANT
    computed = {name for block in (*(blocks[:-1] if is_constant else blocks), samples) for name in block}
    others = {name: value for name, value in registers.items() if name not in computed}
    constants = [pair for name, value in others.items() for pair in manifest.registers[name].encode(value)]
    words = [
        *(numbers[name] for name in _NUMBERS),
        *(int(frame["maxWidth"]), int(frame["maxHeight"]), 1 << COLOUR_FRACTION),
        *(addresses + [0] * 5)[:5],
        _address(manifest, samples) if samples else 0,
        *(len(lights), len(constants)),
        *factor(grid[0]),
        *position_words(grid[1] * 2.0 ** (16 - POSITION_FRACTION), "the mesh's origin"),
        *header.bounds_low,
        *header.bounds_high,
        *object_words(world.pose),
        *camera_words(world.camera, size),
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


def _address(manifest: Manifest, names: Iterable[str]) -> int:
    """Address of the first of registers that follow each other."""
    registers = [manifest.registers[name] for name in names]
    for index, register in enumerate(registers):
        if index > 0 and register.address != registers[index - 1].address + registers[index - 1].words:
            raise ValueError(f"{register.name} does not follow {registers[index - 1].name}")
    return registers[0].address
