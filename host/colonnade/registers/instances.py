"""The registers of a scene of instances, as a target computes them: ``driver/src/colonnade_instances.c``."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from colonnade.common import fixed_order
from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.design.manifest import Manifest
from colonnade.registers.surface_offset import surface_offset
from colonnade.scene_image.header import Instance, ObjectFrame

AXES = "xyz"
#: Bits of the linear part of a transform, fraction bits of its position.
LINEAR_BITS, POSITION_FRACTION = 30, 20
#: Number formats of a target's world.
NUMBERS = ("vertexBits", "gridFraction", "sceneBits")
_REFUSALS = {
    "flat": "object {} is flat: its transform must not scale an axis to nothing",
    "tooSmall": "object {} is too small for the scene: make it larger, or the scene smaller",
    "outside": "object {} is stretched too far for the scene: scale its axes more alike",
}


def instance_registers(instances: Sequence[Instance], world: ObjectFrame, manifest: Manifest) -> dict[str, int]:
    """The registers of instances, of the box that they share, and the offset from their surfaces.

    Args:
        instances: In the order of their numbers.
        world: Frame of the world, which camera and lights are also in.
        manifest: The manifest of a design with instances.

    Raises:
        UserError: An instance is flat, too small for the world, or stretched beyond its range.
    """
    from colonnade import _core

    numbers = manifest.numbers
    target = _core.TargetInstances(*(numbers[name] for name in NUMBERS))
    registers = {"scene.instances": len(instances)}
    for number, instance in enumerate(instances):
        try:
            words = target.add(*object_values(instance, numbers), *transform_values(instance, world))
        except ValueError as error:
            raise UserError(_REFUSALS[str(error)].format(number + 1)) from None
        own = [manifest.registers[name] for name in instance_names(manifest, number)]
        for register in own:
            place = register.address - own[0].address
            registers[register.name] = register.decode(words[place : place + register.words])
    low, high, registers["shading.offset"] = target.shared()
    for a, axis in enumerate(AXES):
        registers |= {f"bounds.low.{axis}": low[a], f"bounds.high.{axis}": high[a]}
    return registers


def instance_names(manifest: Manifest, number: int) -> list[str]:
    """The registers of an instance, in the order of their addresses."""
    return [name for name in manifest.registers if name.startswith(f"instances[{number}].")]


def object_values(
    instance: Instance, numbers: Mapping[str, int]
) -> tuple[tuple[int, int, int], tuple[int, int, int], int, int, int]:
    """`struct colonnade_object` of an instance: low, high, offset, root and material base."""
    offset = surface_offset(numbers, instance.largest_triangle)
    return instance.bounds_low, instance.bounds_high, offset, instance.root, instance.material_base


def transform_values(instance: Instance, world: ObjectFrame) -> tuple[list[int], int, list[int]]:
    """`struct colonnade_transform` of an instance: linear part row by row, its exponent, and position."""
    linear, position = unit_transform(instance, world)
    exponent = math.frexp(np.abs(linear).max())[1] - LINEAR_BITS
    position = np.clip(position, -(2.0**40), 2.0**40)
    return (
        np.rint(np.ldexp(linear, -exponent)).astype(np.int64).ravel().tolist(),
        exponent,
        np.rint(np.ldexp(position, POSITION_FRACTION)).astype(np.int64).tolist(),
    )


def unit_transform(instance: Instance, world: ObjectFrame) -> tuple[Floats, Floats]:
    """From vertex units of an instance to the world's: the linear part and the place of (0, 0, 0)."""
    transform, frame = np.array(instance.transform), instance.frame
    corner = fixed_order.product(transform[:3, :3], np.array(frame.offset)) + transform[:3, 3]
    return world.scale / frame.scale * transform[:3, :3], (corner - np.array(world.offset)) * world.scale
