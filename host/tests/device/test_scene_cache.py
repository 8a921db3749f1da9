"""Scenes in DRAM: caches, latency and order of the memory never change a frame, and failed reads never hang it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from colonnade.common.framebuffer import Frame
from colonnade.design import toolchain
from colonnade.design.generator import GeneratedDesign, design_for
from colonnade.device.bit_exact import render_model
from colonnade.device.harness_job import parse_output
from colonnade.device.simulator_build import build_simulator
from colonnade.device.verilator import Stalls, render_rtl, run_program, write_job
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.scene.parser import load_scene
from colonnade.scene_image.dram_image import dram_lines, moved_bytes
from colonnade.scene_image.file import SceneImage
from colonnade.scene_image.packer import pack

#: Counters that do not depend on time.
EVENTS = ("raysPrimary", "raysShadow", "raysInBox", "nodeReads", "triangleTests", "hits")


def design_with(rows: int, columns: int, banks: int, buffers: int, sizes: tuple[int, ...]) -> GeneratedDesign:
    """A design with a cache of these sizes, in the order of its fields."""
    names = ("lines", "ways", "misses", "sharedLines", "sharedWays", "sharedMisses", "busBytes", "parity")
    cache = json.dumps(dict(zip(names, sizes, strict=True)))
    memory = (f"columnBvhMemory.{field}" for field in (f"banks={banks}", f"recordBuffers={buffers}", f"cache={cache}"))
    return design_for("tiny", (f"array.rows={rows}", f"array.columns={columns}", *memory))


def scene_of(design: GeneratedDesign, width: int, height: int) -> tuple[SceneImage, Mapping[str, int]]:
    image = pack(load_mesh("torus"), design.manifest)
    scene = load_scene(toolchain.project_root() / "scenes" / "object.toml").with_mesh("torus")
    return image, frame_registers(scene, image.header, design.manifest, width, height)


def assert_same(frame: Frame, expected: Frame) -> None:
    assert frame.errors == []
    np.testing.assert_array_equal(frame.colour, expected.colour)
    np.testing.assert_array_equal(frame.triangle, expected.triangle)
    assert [frame.counters[name] for name in EVENTS] == [expected.counters[name] for name in EVENTS]


#: Rows, columns, banks, record buffers, cache: from one awaited line at a time to caches of some lines and ways. The
#: shared cache of one design holds all lines; the last design has none.
SHAPES = {
    "one of everything": (1, 1, 1, 1, (1, 1, 1, 1, 1, 1, 4, False)),
    "two columns": (3, 2, 2, 2, (12, 3, 4, 20, 5, 8, 32, False)),
    "four banks and two buses": (1, 5, 4, 3, (16, 4, 16, 1024, 8, 16, 128, True)),
    "no shared cache": (2, 3, 2, 2, (8, 2, 4, 0, 0, 8, 4, True)),
}


@pytest.mark.parametrize(
    "shape",
    [
        pytest.param("one of everything", marks=pytest.mark.matrix),
        pytest.param("two columns", marks=pytest.mark.matrix),
        "four banks and two buses",
        pytest.param("no shared cache", marks=pytest.mark.matrix),
    ],
)
def test_no_frame_depends_on_the_memory(shape: str) -> None:
    rows, columns, banks, buffers, sizes = SHAPES[shape]
    design = design_with(rows, columns, banks, buffers, sizes)
    image, registers = scene_of(design, 10, 8)
    expected = render_model(design.manifest, image, registers)
    for seed, (latency, random, open_rows) in enumerate([(1, 0, 0), (40, 0, 8), (7, 60, 0), (120, 20, 2)]):
        stalls = Stalls(10 * seed, seed, dram_latency=latency, dram_random=random, dram_banks=open_rows)
        first, second = render_rtl(design, image, [registers, registers], stalls).frames
        assert_same(first, expected)
        assert_same(second, expected)
        assert first.counters["dramReads"] > 0
    # A frame with failed reads ends and says so; the next one is right
    stalls = Stalls(seed=1, dram_errors=60, dram_random=30)
    failed, second = render_rtl(design, image, [registers, registers], stalls).frames
    assert "memory" in failed.errors
    assert_same(second, expected)
    # So does a frame whose reads are not answered. The next one waits for the late answers, and forgets them
    late = registers | {"frame.watchdogCycles": 20_000}
    failed, second = render_rtl(design, image, [late, registers], Stalls(seed=2, dram_silent=20)).frames
    assert set(failed.errors) == {"memory", "watchdog"}
    assert_same(second, expected)


@pytest.mark.matrix
def test_frames_of_the_preset_for_fpgas() -> None:
    """Its timing slices change no pixel and no counter of events, with the slow memory of a board."""
    design = design_for("fpga")
    image = pack(load_mesh("torus"), design.manifest)
    scene = load_scene(toolchain.project_root() / "scenes" / "object.toml").with_mesh("torus")
    registers = frame_registers(scene, image.header, design.manifest, 64, 48)
    expected = render_model(design.manifest, image, registers)
    for stalls in (Stalls(dram_latency=15, dram_interval=2), Stalls(percent=20, seed=3, dram_latency=40)):
        for frame in render_rtl(design, image, [registers, registers], stalls).frames:
            assert_same(frame, expected)


@pytest.mark.parametrize(
    "shape",
    [
        "four banks and two buses",
        *(pytest.param(shape, marks=pytest.mark.matrix) for shape in ("one of everything", "no shared cache")),
    ],
)
def test_the_port_moves_the_beats_of_the_lines_that_are_counted(tmp_path: Path, shape: str) -> None:
    """Whole beats: a line of 64 bytes moves 128 over a bus of 128."""
    design = design_with(*SHAPES[shape])
    bus = int(design.manifest.config["columnBvhMemory"]["cache"]["busBytes"])
    image, registers = scene_of(design, 10, 8)
    program = build_simulator(design)
    job, _ = write_job(tmp_path, design.manifest, image, [registers, registers])
    for banks in (0, 8):
        options = Stalls(dram_latency=20, dram_banks=banks).options
        frames = parse_output(run_program([str(program), *options, job.name], tmp_path, lambda share: None))
        for frame in frames:
            reads = frame.values["counters.dramReads"]
            assert frame.values["dram.beats"] * bus == reads * moved_bytes(design.manifest)
        assert frames[0].values["counters.dramReads"] > 0


def test_a_scene_that_fits_is_read_once() -> None:
    """A line that the shared cache holds is never read again, whatever else happens while it is looked up."""
    design = design_with(*SHAPES["four banks and two buses"])
    image, registers = scene_of(design, 32, 24)
    lines = dram_lines(len(image.records), design.manifest)
    assert lines <= 1024
    expected = render_model(design.manifest, image, registers)
    first, second = render_rtl(design, image, [registers, registers], Stalls(dram_latency=20)).frames
    assert_same(first, expected)
    assert_same(second, expected)
    assert 0 < first.counters["dramReads"] <= lines
    assert second.counters["dramReads"] == 0
