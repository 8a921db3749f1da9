"""Frames of instances: the RTL's equal the model's, in pixels, hits and counters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from equal_frames import HELD, PIPELINED, assert_equal, equal_frames
from instance_worlds import World, transform

from colonnade.design.generator import design_for
from colonnade.device.bit_exact import model_frame
from colonnade.device.verilator import Stalls, render_rtl
from colonnade.scene.model import Material, MeshSource, SceneObject, Transform
from colonnade.scene.parser import load_scene
from colonnade.scene.prepared.device_scene import DeviceScene

LIVE = Path(__file__).parents[3] / "scenes" / "live.toml"
KINDS = ("rigid", "scaled", "mirrored", "sheared")


@pytest.mark.parametrize(
    ("count", "overrides"),
    [pytest.param(2, ("frame.instances=2", *HELD), marks=pytest.mark.matrix), (8, PIPELINED)],
)
def test_frames_of_instances_are_those_of_the_model(count: int, overrides: Sequence[str]) -> None:
    design = design_for("tiny", overrides)
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


@pytest.mark.matrix
def test_sixteen_instances_in_a_room_are_those_of_the_model() -> None:
    """They move, one bends, and gathered light, mirrors and glass meet them."""
    design, size = design_for("small", ("frame.instances=16",)), (64, 48)
    scene = load_scene(LIVE).with_samples(1)
    kinds = (Material(kind="mirror"), Material(albedo=(0.7, 0.6, 0.2)), Material(kind="glass"))
    beads = [
        SceneObject(
            mesh=MeshSource("sphere:80"), material=kinds[i % 3], transform=Transform((0.0, 9.0 * i, 0.0), 0.06, place)
        )
        for i, place in enumerate((-0.6 + 0.15 * i, 0.1 + 0.1 * (i % 4), 0.3) for i in range(12))
    ]
    prepared = DeviceScene.of(replace(scene, objects=(*scene.objects, *beads)), design.manifest, size=size)
    assert len(prepared.image.header.instances) == 16
    for share in (0.0, 0.4):
        pose = prepared.scene.at(share)
        moved = prepared.lit_at(pose)
        (frame,) = equal_frames(design, moved.image, [moved.registers(size, pose)], Stalls())
        assert frame.is_object.mean() > 0.05
