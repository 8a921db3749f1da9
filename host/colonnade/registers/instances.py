"""The registers of a scene of instances (docs/numbers.md, section 10)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from colonnade.common import fixed_order
from colonnade.common.errors import UserError
from colonnade.common.vectors import cofactors
from colonnade.registers.surface_offset import surface_offset
from colonnade.scene_image.header import Instance, ObjectFrame
from colonnade.scene_image.world import world_bounds

AXES = "xyz"
MATRIX_BITS = 25
NORMAL_FRACTION = 14
CELL_BITS = 7
#: Roundings between world and object, in steps of each: of the ray's origin, its direction and the way back.
OBJECT_STEPS, WORLD_STEPS = 6, 8


def instance_registers(instances: Sequence[Instance], world: ObjectFrame, numbers: Mapping[str, int]) -> dict[str, int]:
    """The registers of instances, of the box that they share, and the offset from their surfaces.

    Args:
        instances: In the order of their numbers.
        world: Frame of the world, which camera and lights are in, too.
        numbers: The manifest's number formats.

    Raises:
        UserError: An instance is flat, or too small for the world.
    """
    low, high = world_bounds(instances, world, numbers)
    registers, offset = {"scene.instances": len(instances)}, 0
    for a, axis in enumerate(AXES):
        registers |= {f"bounds.low.{axis}": low[a], f"bounds.high.{axis}": high[a]}
    for number, instance in enumerate(instances):
        placed, least = _placed(number, instance, world, numbers)
        registers |= {f"instances[{number}].{name}": value for name, value in placed.items()}
        offset = max(offset, least)
        box, (first, last) = f"instances[{number}].box", _box(instance, 2 * least, world, numbers)
        for a, axis in enumerate(AXES):
            registers |= {f"{box}.low.{axis}": first[a], f"{box}.high.{axis}": last[a]}
    return registers | {"shading.offset": offset}


def _box(instance: Instance, margin: int, world: ObjectFrame, numbers: Mapping[str, int]) -> list[list[int]]:
    """The cells of the world that hold an instance, low and high; ``margin``, grid steps, is for roundings of rays."""
    units = (instance.corners - world.offset) * world.scale
    around = margin * 2.0 ** -numbers["gridFraction"]
    cells = 2.0 ** (CELL_BITS - numbers["vertexBits"])
    low, high = (units.min(axis=0) - around) * cells, (units.max(axis=0) + around) * cells
    last = (1 << CELL_BITS) - 1
    return [np.clip(np.floor(side), 0, last).astype(int).tolist() for side in (low, high)]


def _placed(
    number: int, instance: Instance, world: ObjectFrame, numbers: Mapping[str, int]
) -> tuple[dict[str, int], int]:
    """Registers of an instance, and the least offset from its surface, grid steps of the world."""
    transform = np.array(instance.transform)
    frame, linear = instance.frame, transform[:3, :3]
    largest, _, least = fixed_order.stretches(linear)
    if not least > 1e-4 * largest:
        raise UserError(f"object {number + 1} is flat: its transform must not scale an axis to nothing")
    turning = cofactors(linear)
    inverse = turning.T / fixed_order.dot(linear[:, 0], turning[:, 0])
    matrix = frame.scale / world.scale * inverse
    shift = MATRIX_BITS - 1 - math.frexp(np.abs(matrix).max())[1]
    # A ray starts in the reach of the world's cube, and must do so in the object's scene
    reach = 1.5 * np.sqrt(3) * (1 << numbers["vertexBits"]) * frame.scale / world.scale / least
    if not (1 <= shift < 64 and reach * 2.0 ** numbers["gridFraction"] < 1 << (numbers["sceneBits"] - 1)):
        raise UserError(f"object {number + 1} is too small for the scene: make it larger, or the scene smaller")
    limit = (1 << (MATRIX_BITS - 1)) - 1
    steps = world.scale * 2.0 ** numbers["gridFraction"]
    corner = (fixed_order.product(linear, np.array(frame.offset)) + transform[:3, 3] - np.array(world.offset)) * steps
    normal = inverse.T * least
    registers = {"shift": shift, "root": instance.root, "materialBase": instance.material_base}
    for a, axis in enumerate(AXES):
        registers[f"origin.{axis}"] = int(np.rint(corner[a]))
        for b, column in enumerate(AXES):
            registers[f"matrix[{a}].{column}"] = int(np.clip(np.rint(np.ldexp(matrix[a, b], shift)), -limit, limit))
            registers[f"normal[{a}].{column}"] = int(np.rint(np.ldexp(normal[a, b], NORMAL_FRACTION)))
    own = surface_offset(numbers, instance.largest_triangle) + OBJECT_STEPS
    offset = (own * largest * world.scale / frame.scale + WORLD_STEPS) * largest / least
    return registers, math.ceil(offset)
