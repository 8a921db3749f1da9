"""The full matrix (`make verify`): the array shape does not change a picture, and the RTL equals its model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from colonnade.design import toolchain
from colonnade.design.generator import design_for, manifest_for
from colonnade.device.bit_exact import render_model
from colonnade.device.verilator import Stalls, render_rtl
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.registers.watchdog import TREE_VISITS
from colonnade.render.frames import render
from colonnade.render.request import RenderRequest
from colonnade.render.result import RenderResult
from colonnade.scene.parser import load_scene
from colonnade.scene_image.packer import pack

from colonnade_lab.evaluation.bench import MESHES as BENCHMARK

pytestmark = pytest.mark.matrix

SIZE = (96, 72)
MESHES = ("teapot:3", "torus", "cube", "sphere:3")

#: Overrides that may change the cycles of a frame but not its content.
SHAPES = {
    "1 unit, 1 context": ("array.rows=1", "array.columns=1", "array.contexts=1"),
    "1 row, 3 columns": ("array.rows=1", "array.columns=3"),
    "5 rows, 1 column": ("array.rows=5", "array.columns=1"),
    "16 contexts": ("array.contexts=16",),
    "1 bank": ("columnBvhMemory.banks=1",),
    "4 banks": ("columnBvhMemory.banks=4",),
    "no snooping": ("columnBvhMemory.snooping=false",),
    "slow memory": ("columnBvhMemory.readLatency=6",),
    "tiles of 4": ("frame.tileSize=4",),
    "tiles of 32": ("frame.tileSize=32",),
    "no tree": ("geometry.bvh=false",),
}

#: Overrides that change the picture; RTL and model must still be equal.
PRECISIONS = ("16b16s16d", "16b32s64d", "24b24s32d", "32b16s16d", "64b64s64d", "17b19s23d")


def frame(backend: str, mesh: str, overrides: tuple[str, ...] = (), config: str = "small") -> RenderResult:
    scene: Path = toolchain.project_root() / "scenes" / "object.toml"
    return render(RenderRequest(scene, config, overrides, backend, SIZE, mesh=mesh, hits=True))


def assert_equal(first: RenderResult, second: RenderResult) -> None:
    np.testing.assert_array_equal(first.image, second.image)
    np.testing.assert_array_equal(first.hit_triangles, second.hit_triangles)
    np.testing.assert_array_equal(first.t, second.t)


@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape_renders_the_same_frame(shape: str, mesh: str) -> None:
    assert_equal(frame("rtl", mesh, SHAPES[shape]), frame("model", mesh))


@pytest.mark.parametrize("banks", (1, 2, 4))
@pytest.mark.parametrize("snooping", ("false", "true"))
@pytest.mark.parametrize("contexts", (1, 4, 8, 12))
def test_random_memory_latency_changes_no_frame(contexts: int, snooping: str, banks: int) -> None:
    """Five seeds of random stalls of banks and sink, on all kinds of column memory controllers."""
    memory = (f"columnBvhMemory.{field}" for field in (f"snooping={snooping}", f"banks={banks}", "holdable=true"))
    design = design_for("tiny", ("array.rows=3", f"array.contexts={contexts}", *memory))
    image = pack(load_mesh("torus"), design.manifest)
    scene = load_scene(toolchain.project_root() / "scenes" / "object.toml").with_mesh("torus")
    registers = frame_registers(scene, image.header, design.manifest, 48, 36)
    expected = render_model(design.manifest, image, registers)
    for seed in range(1, 6):
        stalls = Stalls(percent=17 * seed, seed=seed, memory_percent=100 - 15 * seed, memory_burst=2**seed)
        frame = render_rtl(design, image, [registers], stalls).frames[0]
        assert frame.errors == []
        np.testing.assert_array_equal(frame.colour, expected.colour)
        np.testing.assert_array_equal(frame.triangle, expected.triangle)
        np.testing.assert_array_equal(frame.distance, expected.distance)
        assert {name: frame.counters[name] for name in expected.counters} == expected.counters


@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("precision", PRECISIONS)
def test_hardware_equals_its_model_at_every_precision(precision: str, mesh: str) -> None:
    hardware, model = frame("rtl", mesh, config=precision), frame("model", mesh, config=precision)
    assert_equal(hardware, model)
    assert hardware.report.rays == model.report.rays


@pytest.mark.parametrize("mesh", ("teapot", "torus"))
def test_edge_array_equals_its_model(mesh: str) -> None:
    assert_equal(frame("rtl", mesh, config="edge"), frame("model", mesh, config="edge"))


@pytest.mark.parametrize("mesh", BENCHMARK)
def test_no_ray_visits_as_many_nodes_as_the_watchdog_allows(mesh: str) -> None:
    """The model sets the error bit when a ray visits more nodes than the register allows."""
    manifest = manifest_for("edge").manifest
    scene = load_scene(toolchain.project_root() / "scenes" / "object.toml").with_mesh(mesh)
    image = pack(load_mesh(mesh), manifest)
    registers = frame_registers(scene, image.header, manifest, 320, 240)
    assert render_model(manifest, image, registers | {"frame.watchdogCycles": TREE_VISITS}).errors == []


@pytest.mark.parametrize("mesh", MESHES)
def test_model_is_near_the_reference(mesh: str) -> None:
    from colonnade.common.image_io import encode_srgb
    from colonnade.quality.image_metrics import compare_hits, compare_pictures

    model, reference = frame("model", mesh), frame("reference", mesh)
    hits = compare_hits(reference.hit_triangles, model.hit_triangles)
    assert hits.hit_disagreement <= 0.001
    assert hits.triangle_disagreement <= 0.002
    assert compare_pictures(encode_srgb(reference.image), encode_srgb(model.image)).psnr >= 40
