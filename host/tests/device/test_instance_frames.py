"""Frames of instances: the RTL's are those of the model, in pixels, hits and counters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from equal_frames import HELD, assert_equal
from instance_worlds import World, transform

from colonnade.design.generator import design_for
from colonnade.device.bit_exact import model_frame
from colonnade.device.verilator import Stalls, render_rtl

KINDS = ("rigid", "scaled", "mirrored", "sheared")


@pytest.mark.parametrize(
    ("count", "overrides"),
    [
        (2, HELD),
        (8, (*HELD, "array.rows=3", "units.pathContexts=24", "units.rayInterval=1", "units.shadeInterval=3")),
    ],
)
def test_frames_of_instances_are_those_of_the_model(count: int, overrides: Sequence[str]) -> None:
    design = design_for("tiny", (f"frame.instances={count}", *overrides))
    random = np.random.default_rng(count)
    transforms = [transform(random, KINDS[i % 4], 1.0) for i in range(count)]
    world = World(design.manifest, transforms, size=24)
    frames = [world.registers | {"shading.flat": 1}, world.registers, world.base]
    frames.append(world.registers | {"scene.instances": 1})
    for kind in (1, 2):  # mirrors, glass
        materials = {f"materials[{i}].kind": kind * (i % 2) for i in range(8)}
        frames.append(world.registers | materials | {f"materials[{i}].reflectance": 200 for i in range(8)})
        frames[-1] |= {f"materials[{i}].{eta}": 12000 for i in range(8) for eta in ("etaFront", "etaBack")}
        frames[-1] |= {"shading.bounces": 3}
    stalls = Stalls(percent=20, seed=count, memory_percent=30)
    for frame, registers in zip(render_rtl(design, world.image, frames, stalls).frames, frames, strict=True):
        assert_equal(frame, model_frame(world.model, registers))
