"""The clip file of instances: objects, where they are over time, and clips of objects that bend (docs/driver.md)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.registers.instances import (
    LINEAR_BITS,
    NUMBERS,
    POSITION_FRACTION,
    instance_names,
    object_values,
    unit_transform,
)
from colonnade.registers.view_words import two_words
from colonnade.scene_image.grid_clip import TIME_FRACTION
from colonnade.scene_image.header import Instance, ObjectFrame

if TYPE_CHECKING:
    from colonnade.design.manifest import Manifest
    from colonnade.mesh.clips.keys import Keys

MAGIC = b"CLNDMOVE"
VERSION = 1


@dataclass(frozen=True)
class Motion:
    """Instances over time, as a target has them: ``driver/src/colonnade_motion.c``.

    Attributes:
        instances: At rest.
        keys: Their transforms, from mesh to world, as of bones.
        world: A frame that holds all keys.
        clips: Root and clip file of each mesh that bends.
    """

    instances: tuple[Instance, ...]
    keys: Keys
    world: ObjectFrame
    clips: tuple[tuple[int, bytes], ...]

    def at_key(self, key: int) -> list[Instance]:
        """The instances at a key."""
        return _moved(self.instances, self.keys.matrices[key])

    def file(self, manifest: Manifest, *, sets_offset: bool = True) -> bytes:
        """The file.

        Args:
            manifest: The design's manifest.
            sets_offset: It sets `shading.offset`, which the scene does not.

        Raises:
            UserError: The motion is too long, or an object moves too far.
        """
        times = np.rint(self.keys.times * 2.0**TIME_FRACTION)
        if times[-1] >= 2.0**32:
            raise UserError("the objects move for more than 18 hours: shorten the animation")
        pairs = [[unit_transform(one, self.world) for one in self.at_key(key)] for key in range(len(times))]
        linear, places = (np.array([[pair[i] for pair in pose] for pose in pairs]) for i in range(2))
        exponents = [math.frexp(np.abs(linear[:, i]).max())[1] - LINEAR_BITS for i in range(len(self.instances))]
        shift = min(POSITION_FRACTION, LINEAR_BITS - math.frexp(np.abs(places).max())[1])
        if shift < 0:
            raise UserError("an object moves too far for the scene: make it larger, or the scene smaller")
        linear = np.ldexp(linear, -np.array(exponents)[:, None, None])
        matrices = np.concatenate([linear, np.ldexp(places, shift)[..., None]], axis=3).reshape(len(times), -1)
        limit = (1 << LINEAR_BITS) - 1
        poses = np.clip(np.rint(matrices), -limit, limit).astype(np.int64)
        names = instance_names(manifest, 0)
        registers = manifest.registers
        words = [
            *(manifest.numbers[name] for name in NUMBERS),
            *(registers[name].address for name in (names[0], "bounds.low.x", "shading.offset")),
            sum(registers[name].words for name in names),
            registers["shading.offset"].words if sets_offset else 0,
            *(len(self.instances), len(times), int(times[-1]), shift, len(self.clips)),
            *(
                word
                for one, exponent in zip(self.instances, exponents, strict=True)
                for word in (*_object_words(one, manifest), exponent)
            ),
            *np.column_stack([times.astype(np.int64), poses]).ravel().tolist(),
        ]
        body = (np.array(words) & 0xFFFFFFFF).astype("<u4").tobytes()
        body += b"".join(np.array([root, len(clip)], "<u4").tobytes() + clip for root, clip in self.clips)
        header = np.array([VERSION, 48 + len(body), *manifest.format_words], "<u4").tobytes()
        return MAGIC + header + body


def _object_words(instance: Instance, manifest: Manifest) -> list[int]:
    low, high, offset, root, base = object_values(instance, manifest.numbers)
    return [*low, *high, *two_words(offset), root, base]


def _moved(instances: Sequence[Instance], matrices: Floats) -> list[Instance]:
    """Instances with other transforms, float64 [n, 3, 4]."""
    last = (0.0, 0.0, 0.0, 1.0)
    return [
        replace(one, transform=(*(tuple(row) for row in matrix), last))
        for one, matrix in zip(instances, matrices.tolist(), strict=True)
    ]


@dataclass(frozen=True)
class TargetMotion:
    """A motion as a target plays it, so that registers of the host equal the target's."""

    motion: Motion
    manifest: Manifest

    @cached_property
    def _target(self) -> Any:
        from colonnade import _core

        registers = [one for one in self.manifest.registers.values() if one.access == "rw"]
        first = min(one.address for one in registers)
        end = max(one.address + one.words for one in registers)
        return _core.TargetMotion(self.manifest.format_words, first, end, self.motion.file(self.manifest))

    @property
    def seconds(self) -> float:
        """Duration of the motion."""
        return float(self.motion.keys.times[-1])

    def instances(self, progress: float) -> list[Instance]:
        """The instances at a part of the motion, 0.0 to 1.0."""
        world, matrices = self.motion.world, []
        for one, (linear, exponent, position) in zip(
            self.motion.instances,
            self._target.transforms(round(progress * self.seconds * 2.0**TIME_FRACTION)),
            strict=True,
        ):
            units = np.ldexp(np.array(linear, float).reshape(3, 3), exponent)
            own = units * (one.frame.scale / world.scale)
            corner = np.ldexp(np.array(position, float), -POSITION_FRACTION) / world.scale + np.array(world.offset)
            matrices.append(np.column_stack([own, corner - (own * np.array(one.frame.offset)).sum(axis=1)]))
        return _moved(self.motion.instances, np.array(matrices))
