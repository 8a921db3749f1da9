"""Poses, cameras and lights as words of 32 bits of a view file (docs/driver.md)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from colonnade.common import fixed_order
from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.scene.cameras import WorldCamera
from colonnade.scene.object_pose import Pose
from colonnade.scene.view import PlacedLight

if TYPE_CHECKING:
    from colonnade.design.manifest import Manifest
    from colonnade.scene_image.header import ImageHeader

#: Fraction bits of positions in metres, of rotations, of lenses, of lights' colours.
POSITION_FRACTION, ROTATION_FRACTION, LENS_FRACTION, COLOUR_FRACTION = 32, 30, 32, 16
WORLD_BITS = 60
#: Of a grid position that the target computes, its low bits are 0 in a wider one.
SCENE_BITS = 40
#: Bounds of focal lengths, pixels; principal points have the upper one.
LEAST_FOCAL, LARGEST_FOCAL = 1 / 16, 1 << 24


def object_words(pose: Pose) -> list[int]:
    """The object's position and rotation; its scale is in the number of grid steps in a metre."""
    return [*position_words(pose.translate, "the object"), *rotation_values(pose.rotation)]


def camera_words(camera: WorldCamera, size: tuple[int, int]) -> list[int]:
    """Position, rotation, lens and size."""
    axes, lens = camera_values(camera)
    wide = (word for value in lens for word in two_words(value))
    return [*position_words(camera.position, "the camera"), *rotation_values(axes), *wide, *size]


def camera_values(camera: WorldCamera) -> tuple[Floats, list[int]]:
    """The rotation from right, down, forward to world space, float64 [3, 3], and fx, fy, cx, cy, 2^-32 pixels."""
    right, up, toward = camera.axes
    x, y = 1 / length(camera.step_x), 1 / length(camera.step_y)
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
    return [*position_words(light.position, "a light"), *colour, *two_words(reach)]


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


def length(values: Floats) -> float:
    """The length of a vector."""
    return math.sqrt(float((values * values).sum()))


def position_words(position: Floats, what: str) -> Iterator[int]:
    """`position_values` as words."""
    return (word for value in position_values(position, what) for word in two_words(value))


def two_words(value: int) -> tuple[int, int]:
    """A number of 64 bits, low word first."""
    return value & 0xFFFFFFFF, value >> 32 & 0xFFFFFFFF


def factor(value: float) -> tuple[int, int, int]:
    """A positive number as mantissa, of two words, and exponent."""
    mantissa, exponent = math.frexp(value)
    return *two_words(int(math.ldexp(mantissa, 64))), exponent - 64


def more_grid_bits(manifest: Manifest) -> int:
    """Low bits of a grid position that the target does not compute."""
    return max(0, manifest.numbers["sceneBits"] - SCENE_BITS)


def grid_step(header: ImageHeader, manifest: Manifest) -> float:
    """The target's grid steps in a mesh unit."""
    return float(header.frame.scale * 2.0 ** (manifest.numbers["gridFraction"] - more_grid_bits(manifest)))
