"""Frames through the AXI4 shell are the model's, byte by byte, in all formats and at any timing of the bus."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from colonnade.common.accumulation import Accumulation
from colonnade.common.framebuffer_formats import PIXEL_BYTES, framebuffer_bytes
from colonnade.common.image_io import encode_srgb
from colonnade.design import toolchain
from colonnade.design.generator import GeneratedDesign, shell_design_for
from colonnade.device.bit_exact import render_model
from colonnade.device.shell import Bus, ShellFrame, render_shell
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.render.composite import composited
from colonnade.scene.parser import load_scene
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene_image.packer import pack

WIDTH, HEIGHT = 28, 21
UNWRITTEN = 0xA5


@pytest.fixture(scope="module")
def design() -> GeneratedDesign:
    return shell_design_for("tiny", ("array.columns=2",), bus_bytes=16)


def assert_bytes(frame: ShellFrame, expected: np.ndarray, pixel_bytes: int) -> None:
    assert frame.errors == 0
    used = WIDTH * pixel_bytes
    np.testing.assert_array_equal(frame.lines[:, :used], expected)
    assert (frame.lines[:, used:] == UNWRITTEN).all()


@pytest.mark.parametrize(
    "bus",
    [Bus(), *(Bus(latency=60, stall=30, order=order, seed=2 + order) for order in range(5))],
    ids=["fast", "any order", "address after data valid", "data after address", "together", "address after last beat"],
)
def test_frames_in_memory_are_those_of_the_model(design: GeneratedDesign, bus: Bus) -> None:
    manifest = design.manifest
    image = pack(load_mesh("torus"), manifest)
    scene = load_scene(toolchain.project_root() / "scenes" / "object.toml").with_mesh("torus")
    registers = frame_registers(scene, image.header, manifest, WIDTH, HEIGHT)
    expected = render_model(manifest, image, registers)
    assert expected.is_object.any() and not expected.is_object.all()
    frames = render_shell(design, image, [registers] * 3, [0, 1, 2], bus)
    for code, frame in enumerate(frames):
        assert_bytes(frame, framebuffer_bytes(expected, code), PIXEL_BYTES[code])
        assert frame.values["counters.hits"] == expected.counters["hits"]
        assert not any(value for name, value in frame.values.items() if name.startswith("errors."))


@pytest.mark.matrix
def test_a_scene_in_dram_is_read_by_the_second_master() -> None:
    """A frame whose reads fail ends and says so, and the next one is right. Reads overtake each other."""
    cache = {"lines": 8, "ways": 2, "misses": 4, "sharedLines": 16, "sharedWays": 2, "sharedMisses": 8}
    cache |= {"busBytes": 32, "parity": True}
    design = shell_design_for("tiny", ("array.columns=2", f"columnBvhMemory.cache={json.dumps(cache)}"), bus_bytes=16)
    image = pack(load_mesh("torus"), design.manifest)
    scene = load_scene(toolchain.project_root() / "scenes" / "object.toml").with_mesh("torus")
    registers = frame_registers(scene, image.header, design.manifest, WIDTH, HEIGHT)
    expected = render_model(design.manifest, image, registers)
    errors, formats = [0, 4, 0, 30, 0], [0, 1, 1, 0, 2]
    bus = Bus(latency=30, stall=20, seed=5)
    frames = render_shell(design, image, [registers] * len(errors), formats, bus, scene_errors=errors)
    for frame, error, code in zip(frames, errors, formats, strict=True):
        assert (frame.values["errors.memory"] != 0) is (error > 0)
        assert frame.errors == 0 and frame.values["counters.dramReads"] > 0
        if not error:
            assert_bytes(frame, framebuffer_bytes(expected, code), PIXEL_BYTES[code])


@pytest.mark.matrix
def test_a_room_in_memory_is_that_of_the_model() -> None:
    """Its maps are loaded by the shell, too, and its photo is composited as the host does it."""
    design = shell_design_for("small", ("array.columns=2", "array.rows=1"), bus_bytes=16)
    manifest = design.manifest
    scene = load_scene(toolchain.project_root() / "scenes" / "room.toml")
    scene = replace(scene, background=replace(scene.background, shadows="photo"))
    prepared = DeviceScene.of(scene, manifest)
    image, registers = prepared.image, prepared.registers((WIDTH, HEIGHT))
    expected = render_model(manifest, image, registers)
    assert expected.is_object.any()
    (frame,) = render_shell(design, image, [registers], [0], Bus(latency=40, stall=10, seed=3))
    assert_bytes(frame, framebuffer_bytes(expected, 0), PIXEL_BYTES[0])

    photo = prepared.frame_photo((WIDTH, HEIGHT))
    assert photo is not None and photo.shape[2] == 4 and np.ptp(photo[..., 3]) > 50
    frames = render_shell(design, image, [registers] * 3, [0, 1, 2], Bus(latency=40, stall=10, seed=4), photo=photo)
    for code, frame in enumerate(frames):
        assert_bytes(frame, framebuffer_bytes(expected, code, photo), PIXEL_BYTES[code])
    host = encode_srgb(composited(Accumulation.of_frame(expected), prepared.photo, prepared.strength))
    np.testing.assert_array_equal(frames[0].lines[:, : 4 * WIDTH].reshape(HEIGHT, WIDTH, 4)[..., 2::-1], host)
