"""Frames of columns with a path unit: the RTL under Verilator against the model, bit for bit."""

from __future__ import annotations

from dataclasses import replace

import pytest
from equal_frames import HELD, HOLDABLE, PIPELINED, assert_equal, equal_frames

from colonnade.design.generator import design_for
from colonnade.device.bit_exact import render_model
from colonnade.device.verilator import Stalls, render_rtl
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.scene.model import Background, Camera, Light, Material, MeshSource, Paths, Scene
from colonnade.scene.view import with_overrides
from colonnade.scene_image.packer import pack

pytestmark = pytest.mark.verilator

TEAPOT = Scene(MeshSource(name="teapot:4"), background=Background(colour=(0.2, 0.3, 0.5)), paths=Paths(bounces=3))
LIGHTS = (Light(offset=(-1.0, 0.5, 2.0), colour=(0.2, 0.4, 0.9)),)

#: Name, precision, overrides.
SHAPES = [
    ("shared triangle units, pipelines", "tiny", PIPELINED),
    ("sequential parts", "tiny", HOLDABLE),
    pytest.param(
        (
            "sequential parts, one slow bank",
            "tiny",
            (
                *("array.rows=2", "units.pathContexts=7", "columnBvhMemory.snooping=false"),
                *("columnBvhMemory.banks=1", "columnBvhMemory.readLatency=5", *HELD),
            ),
        ),
        marks=pytest.mark.matrix,
    ),
    pytest.param(
        (
            "one context, no tree, narrow",
            "16b16s32d",
            (
                *("array.rows=1", "array.columns=1", "array.contexts=1", "units.pathContexts=1", "units.marches=1"),
                *("units.rayInterval=1", "units.shadeInterval=3", "geometry.bvh=false", *HELD),
            ),
        ),
        marks=pytest.mark.matrix,
    ),
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape[0])
def test_a_path_unit_renders_what_the_model_renders(shape: tuple[str, str, tuple[str, ...]]) -> None:
    """Diffuse under two lights, mirror, and glass seen from inside, while memory and sink stall at random."""
    _, config, overrides = shape
    design = design_for(config, overrides)
    mesh = load_mesh("teapot:4" if design.manifest.config["geometry"]["bvh"] else "cube")
    for material, camera in [
        (Material(), Camera()),
        (Material(kind="mirror", albedo=(0.9, 0.8, 0.7)), Camera(direction=(-1.0, -0.2, 0.1))),
        (Material(kind="glass", ior=1.45), Camera(position=(0.1, 0.2, 0.3), target=(1.0, 0.5, 0.0))),
    ]:
        image = pack(mesh, design.manifest, with_overrides(mesh.materials, material))
        scene = replace(TEAPOT, material=material, camera=camera, more_lights=LIGHTS)
        registers = [frame_registers(scene, image.header, design.manifest, *size) for size in ((24, 18), (17, 9))]
        stalls = Stalls(percent=20, memory_percent=40, seed=3, check_interval=16)
        assert equal_frames(design, image, registers, stalls)[0].is_object.any()


def test_a_frame_after_an_abort_is_right() -> None:
    """The watchdog aborts frames with rays, lights and bounces in all stages; nothing of them is in the next frame."""
    design = design_for("tiny", PIPELINED)
    for material in (Material(), Material(kind="mirror"), Material(kind="glass", ior=1.45)):
        mesh = load_mesh("teapot:4")
        image = pack(mesh, design.manifest, with_overrides(mesh.materials, material))
        scene = replace(TEAPOT, material=material, more_lights=LIGHTS)
        settings = frame_registers(scene, image.header, design.manifest, 17, 9)
        expected = render_model(design.manifest, image, settings)
        limits = range(30, 270, 15)
        registers = [frame for limit in limits for frame in (settings | {"frame.watchdogCycles": limit}, settings)]
        frames = render_rtl(design, image, registers, Stalls(percent=20, memory_percent=40, seed=3)).frames
        aborted = [frame.errors == ["watchdog"] for frame in frames[::2]]
        assert sum(aborted) > len(aborted) // 2, "the limits are too long"
        for frame in frames[1::2]:
            assert_equal(frame, expected)
