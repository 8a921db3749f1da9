"""Whole frames: the RTL under Verilator against the model, bit for bit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from colonnade_lab.evaluation.fuzz.cases import coloured, textured
from colonnade_lab.evaluation.throughput import figures, records_taken
from equal_frames import ALONE, HOLDABLE, NARROW, PIPELINED, equal_frames
from leaves import packed_triangles

from colonnade.common.errors import UserError
from colonnade.design.generator import design_for, manifest_for
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import render_model
from colonnade.device.verilator import Stalls, render_rtl
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.materials import MeshMaterial
from colonnade.registers.frame import frame_registers
from colonnade.render.report import frame_report
from colonnade.scene.model import Background, Camera, Light, Material, MeshSource, Paths, Scene
from colonnade.scene.view import with_overrides
from colonnade.scene_image.packer import pack

pytestmark = pytest.mark.verilator

TEAPOT = Scene(MeshSource(name="teapot:4"))
SKY = Background(colour=(0.2, 0.3, 0.5))


#: Name, configuration, overrides, mesh, stalls of the pixel sink.
CASES = [
    ("tiny", "tiny", (), "teapot:4", Stalls(check_interval=1)),
    ("small, stalled sink", "small", (), "teapot:4", Stalls(40, 7, check_interval=1)),
    ("narrow", "tiny", NARROW, "sphere:2", Stalls()),
]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case[0])
def test_hardware_renders_what_the_model_renders(case: tuple[str, str, tuple[str, ...], str, Stalls]) -> None:
    """Three frames of a scene that is loaded once: smooth, flat from another side, and from inside the object."""
    _, config, overrides, mesh, stalls = case
    design = design_for(config, overrides)
    image = pack(load_mesh(mesh), design.manifest)
    scene = replace(TEAPOT, mesh=MeshSource(name=mesh))
    flat = replace(scene, camera=Camera(direction=(-1.0, -0.2, 0.1)), material=Material(flat=True))
    inside = replace(scene, camera=Camera(position=(0.1, 0.2, 0.3), target=(1.0, 0.5, 0.0)), light=Light(shadows=False))
    views = [(scene, 32, 25), (flat, 33, 20), (inside, 17, 9)]
    registers = [frame_registers(view, image.header, design.manifest, *size) for view, *size in views]
    assert equal_frames(design, image, registers, stalls)[0].is_object.any()


#: Beside `tiny`: what the faces of the next test need.
SHOWN = (
    *("geometry.cornerColours=true", "geometry.textureBytes=16384", "frame.maxBounces=4", "array.rows=2"),
    *("frame.emission=true", "geometry.triangleBits=null"),
)
PIPES = ("precision=24b24s64d", "units.pathContexts=24", "units.rayInterval=1", "units.shadeInterval=3")


@pytest.mark.parametrize(
    ("config", "overrides"),
    [
        ("small", ALONE),
        pytest.param("tiny", SHOWN, marks=pytest.mark.matrix),
        pytest.param("tiny", (*SHOWN, "precision=16b16s32d"), marks=pytest.mark.matrix),
        pytest.param("tiny", (*SHOWN, *PIPES), marks=pytest.mark.matrix),
    ],
    ids=["small", "tiny", "narrow", "pipelines"],
)
def test_corner_colours_textures_and_emission_equal_the_model(config: str, overrides: tuple[str, ...]) -> None:
    """Diffuse, mirroring and clear faces with textures or colours at their corners, and emissive faces with neither."""
    design = design_for(config, overrides)
    mesh = load_mesh("teapot:4")
    kinds = [(kind, shown) for shown in ("texture", "colours") for kind in ("diffuse", "mirror", "glass")]
    materials = tuple(
        MeshMaterial(kind, (0.9, 0.8, 0.7), has_corner_colours=True, texture=0 if shown == "texture" else None)
        for kind, shown in kinds
    )
    materials += (MeshMaterial(albedo=(0.9, 0.8, 0.7), emission=(0.1, 0.6, 0.2)),)
    index = np.arange(len(mesh.faces), dtype=np.uint8) // 8 % 7
    mixed = replace(textured(coloured(mesh)), materials=materials, face_materials=index)
    image = pack(mixed, design.manifest, encoder="live")
    scene = replace(TEAPOT, background=SKY, paths=Paths(bounces=2))
    registers = [
        frame_registers(replace(scene, camera=camera), image.header, design.manifest, 48, 37)
        for camera in (Camera(), Camera(direction=(-1.0, -0.2, 0.1)))
    ]
    frames = equal_frames(design, image, registers, Stalls(10, 3))
    for frame, settings in zip(frames, registers, strict=True):
        for register in ("hasTexture", "hasCornerColours", "emission.g"):
            plain = settings | {f"materials[{i}].{register}": 0 for i in range(7)}
            assert (frame.colour != render_model(design.manifest, image, plain).colour).any(axis=2).mean() > 0.03


@pytest.mark.parametrize("mesh", ["teapot:4", "torus"])
def test_direct_loads_equal_loads_through_the_port(mesh: str) -> None:
    """All counters, including cycles: free-running counters of the hardware have the same state after both loads."""
    design = design_for("tiny")
    image = pack(load_mesh(mesh), design.manifest)
    registers = frame_registers(replace(TEAPOT, mesh=MeshSource(name=mesh)), image.header, design.manifest, 24, 17)
    frames = [
        render_rtl(design, image, [registers, registers], through_port=through_port).frames
        for through_port in (False, True)
    ]
    for past, through in zip(*frames, strict=True):
        np.testing.assert_array_equal(past.colour, through.colour)
        assert past.counters == through.counters


TWO_LIGHTS = (Light(falloff=3.0), Light(offset=(-1.0, 0.5, 2.0), colour=(0.2, 0.4, 0.9)))

#: Name, configuration, overrides, material, lights.
SHINY = [
    ("mirror", "small", (), Material(kind="mirror", albedo=(0.9, 0.8, 0.7)), (Light(),)),
    ("glass", "small", (), Material(kind="glass", albedo=(0.9, 1.0, 0.95), ior=1.45), (Light(),)),
    ("two lights", "small", (), Material(), TWO_LIGHTS),
    ("narrow glass", "tiny", NARROW, Material(kind="glass", ior=2.4), (Light(falloff=0.5),)),
]


@pytest.mark.parametrize(
    "case", [*SHINY[:3], pytest.param(SHINY[3], marks=pytest.mark.matrix)], ids=lambda case: case[0]
)
def test_mirrors_glass_and_lights_equal_the_model(
    case: tuple[str, str, tuple[str, ...], Material, tuple[Light, ...]],
) -> None:
    _, config, overrides, material, lights = case
    design = design_for(config, overrides)
    mesh = load_mesh("teapot:4")
    image = pack(mesh, design.manifest, with_overrides(mesh.materials, material))
    scene = replace(TEAPOT, material=material, light=lights[0], more_lights=lights[1:], background=SKY)
    registers = [
        frame_registers(replace(scene, paths=Paths(bounces=bounces)), image.header, design.manifest, 32, 25)
        for bounces in (4, 1, 0)
    ]
    counters = equal_frames(design, image, registers, Stalls(20, 5))[0].counters
    assert (counters["raysReflection"] > 0) == (material.kind is not None)
    assert (counters["raysRefraction"] > 0) == (material.kind == "glass")


@pytest.mark.parametrize(
    "stalls",
    [
        Stalls(memory_percent=30, seed=1),
        Stalls(percent=40, memory_percent=60, seed=2),
        Stalls(percent=10, memory_percent=50, memory_burst=1, seed=3),
        Stalls(percent=70, memory_percent=80, memory_burst=4, seed=4),
    ],
    ids=str,
)
def test_random_memory_latency_changes_only_time(stalls: Stalls) -> None:
    """With random stalls of banks and sink, frames equal the model's and take longer."""
    holdable = design_for("tiny", HOLDABLE)
    image = pack(load_mesh("teapot:3"), holdable.manifest)
    flat = replace(TEAPOT, camera=Camera(direction=(-1.0, -0.2, 0.1)), material=Material(flat=True))
    registers = [frame_registers(view, image.header, holdable.manifest, 28, 21) for view in (TEAPOT, flat)]
    held = equal_frames(holdable, image, registers, stalls)
    free = render_rtl(holdable, image, list(registers), replace(stalls, memory_percent=0)).frames
    for frame, quicker in zip(held, free, strict=True):
        assert frame.counters["cycles"] > 1.05 * quicker.counters["cycles"]


@pytest.mark.parametrize(
    ("options", "stalls"),
    [(HOLDABLE, Stalls()), (HOLDABLE, Stalls(percent=40, memory_percent=60, seed=2)), (PIPELINED, Stalls())],
    ids=["sequential", "stalled", "pipelines"],
)
def test_counters_account_for_every_cycle_and_record(options: tuple[str, ...], stalls: Stalls) -> None:
    """Each context is in one state, units are busy at most all cycles, and each record taken has a reason."""
    design = design_for("tiny", options)
    image = pack(load_mesh("teapot:3"), design.manifest)
    settings = frame_registers(TEAPOT, image.header, design.manifest, 40, 30)
    frame = render_rtl(design, image, [settings], stalls).frames[0]
    report = frame_report("rtl", design.manifest, image.header, frame).as_json()
    found, counters = figures(report), report["counters"]
    assert all(0 < share < 1 for share in found["stalls"].values()), found["stalls"]
    assert all(0 < share < 1 for share in found["utilisation"].values()), found["utilisation"]
    triangle_records = records_taken(counters) - counters["nodeReads"] - counters["hits"]
    assert triangle_records <= counters["triangleTests"] <= 2 * triangle_records


def test_stalls_of_a_memory_without_stall_input_are_rejected(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rejected before the build."""
    monkeypatch.setattr(
        "colonnade.device.verilator.build_simulator", lambda *_, **__: pytest.fail("a simulator is built")
    )
    design = manifest_for("tiny")
    image = pack(load_mesh("cube"), design.manifest)
    with pytest.raises(UserError, match=r"columnBvhMemory\.holdable=true"):
        render_rtl(design, image, [], Stalls(memory_percent=10))


@pytest.mark.parametrize("stalls", [{"percent": 100}, {"memory_percent": 100}, {"percent": -1}, {"memory_burst": 0}])
def test_stalls_that_never_end_are_refused(stalls: dict[str, int]) -> None:
    with pytest.raises(ValueError, match="0 to 99"):
        Stalls(**stalls)


def test_single_rays_through_the_hardware_slip_through_no_edge() -> None:
    """Frames of one pixel with a ray from inside a closed mesh exactly to a vertex."""
    design = design_for("tiny")
    numbers = design.manifest.numbers
    image = pack(load_mesh("sphere:2"), design.manifest)
    base = frame_registers(replace(TEAPOT, mesh=MeshSource(name="sphere:2")), image.header, design.manifest, 1, 1)
    vertices = packed_triangles(image, design.manifest)[1][:200, 0] << numbers["gridFraction"]
    random = np.random.default_rng(5)
    middle = 1 << (numbers["vertexBits"] - 1 + numbers["gridFraction"])
    registers: list[Mapping[str, int]] = []
    for vertex in vertices:
        origin = middle + random.integers(-middle // 3, middle // 3, size=3)
        view = {"camera.position": origin, "camera.direction": vertex - origin}
        settings = {f"{name}.{axis}": int(value[a]) for name, value in view.items() for a, axis in enumerate("xyz")}
        rectangle = {f"frame.objectRect.{edge}": int(edge[1] == "1") for edge in ("x0", "y0", "x1", "y1")}
        outline = {name: 0 for name in base if name.startswith("frame.objectOutline")}
        registers.append({**base, **settings, **rectangle, **outline, "frame.unitShift": 0, "camera.stepShift": 0})
    frames = render_rtl(design, image, registers).frames
    assert all(frame.is_object[0, 0] for frame in frames)


def test_a_distant_camera_sees_the_object() -> None:
    """The range of t suffices for a distant object."""
    manifest = manifest_for("tiny").manifest
    image = pack(load_mesh("sphere:3"), manifest)
    for distance in (5.0, 60.0):
        scene = Scene(
            MeshSource(name="sphere:3"),
            camera=Camera(position=(0.1, 0.2, distance), target=(0.0, 0.0, 0.0), fov=60.0 / distance),
        )
        frame = render_model(manifest, image, frame_registers(scene, image.header, manifest, 16, 16))
        assert frame.is_object[8, 8]


def nodes_of(manifest: Manifest, pointers: Sequence[tuple[int, int]]) -> npt.NDArray[np.uint8]:
    """Nodes with the cube as box, from their first child and their number of child nodes."""
    layout = manifest.layouts["node"]
    fields = {name: np.zeros(len(pointers), dtype=np.int64) for name in layout.fields}
    fields["first"][:], fields["nodes"][:] = zip(*pointers, strict=True)
    for slot in range(4):
        for axis in "xyz":
            high = f"children[{slot}].high.{axis}"
            fields[high][:] = layout.fields[high].range[1]
    for axis in "xyz":
        fields[f"corner.{axis}"][:] = 1 << manifest.numbers["maxExponent"]
    return layout.pack(fields)


@pytest.mark.parametrize(
    ("pointers", "errors"),
    [
        ([(0, 1)], ["illegalRecord"]),
        ([(1, 2), (1, 1), (0, 1)], ["illegalRecord"]),
        ([*((node + 1, 2) for node in range(30)), (0, 0), (0, 0)], ["watchdog"]),
    ],
    ids=["a root that is its own child", "cycles below the root", "children shared by all nodes"],
)
def test_an_endless_traversal_is_an_error(pointers: list[tuple[int, int]], errors: list[str]) -> None:
    """A node at or before its parent is an error, which ends cycles. Shared children make many paths and no cycle."""
    design = design_for("tiny")
    image = pack(load_mesh("cube"), design.manifest)
    registers = frame_registers(replace(TEAPOT, mesh=MeshSource(name="cube")), image.header, design.manifest, 16, 16)
    nodes = nodes_of(design.manifest, pointers)
    walk = replace(image, records=nodes)
    registers |= {"scene.recordCount": len(nodes), "frame.watchdogCycles": 20_000}
    frame = render_rtl(design, walk, [registers]).frames[0]
    model = render_model(design.manifest, walk, registers)
    assert frame.errors == model.errors == errors
    if errors == ["illegalRecord"]:
        np.testing.assert_array_equal(frame.colour, model.colour)
        assert {name: frame.counters[name] for name in model.counters} == model.counters
