"""Gathered light: the RTL against the model, bit for bit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from equal_frames import ALONE, IN_ROOM, equal_frames
from live_maps import live_maps

from colonnade.design.generator import design_for
from colonnade.device.bit_exact import render_model
from colonnade.device.verilator import Stalls, render_rtl
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.scene.model import Background, Camera, Colour, Light, Material, MeshSource, Paths, Placement, Scene
from colonnade.scene.view import with_overrides
from colonnade.scene_image.environment import with_environment
from colonnade.scene_image.file import LoadSection, SceneImage
from colonnade.scene_image.packer import pack

ROOMS = Path(__file__).parents[3] / "scenes" / "rooms"
#: As in `edge`: shared triangle units, so many paths that a choice among them takes a cycle.
MANY = (
    *("array.rows=4", "units.triangleRows=2", "units.triangleLanes=2", "units.pathContexts=64"),
    "units.extraSlices=true",
)
SCENE = Scene(
    MeshSource(name="teapot:4"),
    camera=Camera(direction=(0.5, 0.6, 1.0)),
    light=Light(falloff=3.0),
    more_lights=(Light((-1.0, 1.5, 1.0), colour=(0.2, 0.5, 0.3)),),
    ambient=Colour((0.3, 0.2, 0.3)),
    background=Background((0.1, 0.3, 0.5)),
)


def with_cube(image: SceneImage, seed: int) -> SceneImage:
    """The image with random light, and lights in one of eight directions."""
    random = np.random.default_rng(seed)
    light = random.integers(0, 1 << 21, 1536) | random.integers(0, 10, 1536) << 21
    marks = (random.integers(0, 8, 1536) == 7).astype(np.int64) << 25
    words = (light | marks).astype("<u4").view(np.uint8).reshape(-1, 4)
    return replace(image, attributes=(*image.attributes, LoadSection("light.cube", words)))


def gathering(registers: dict[str, int], bounces: int, seed: int) -> dict[str, int]:
    """Random sample points and near surfaces; material 3 is rough metal, in some frames mirrors and glass are rough."""
    drawn = np.random.default_rng(seed).integers(0, 256, (4, 2))
    points = {f"gather.points[{i}].{axis}": int(drawn[i, a]) for i in range(4) for a, axis in enumerate("uv")}
    rough = {"kind": 3, "lobe.alpha": 52, "lobe.slope": 743, "lobe.peak": 589}
    metal = {f"materials[3].{name}": value for name, value in rough.items()}
    widths = {1: 0 if bounces == 1 else 40, 2: 0 if bounces == 2 else 120}
    facets = {f"materials[{number}].lobe.alpha": width for number, width in widths.items()}
    return registers | points | metal | facets | {"gather.bounces": bounces, "gather.parallax": seed % 4}


@pytest.mark.verilator
@pytest.mark.parametrize(
    ("options", "in_room"),
    [
        (ALONE, False),
        ((), True),
        pytest.param(IN_ROOM, True, marks=pytest.mark.matrix),
        pytest.param((*IN_ROOM, *MANY), True, marks=pytest.mark.matrix),
    ],
    ids=["one column", "in a room", "pipelines in a room", "many paths in a room"],
)
def test_hardware_gathers_what_the_model_gathers(options: tuple[str, ...], in_room: bool) -> None:
    """All kinds of materials, also where no bounce is traced; no, one and four gathered rays; a stalled sink."""
    design = design_for("small", options)
    mesh = load_mesh("teapot:4")
    placed = replace(SCENE, placement=Placement((322.0, 306.0), 0.58), background=Background(room=ROOMS / "living"))
    scene, held = (placed, live_maps(ROOMS / "living", design.manifest)) if in_room else (SCENE, None)
    # Faces of four materials beside each other, so that rays go from one to the other
    parts = np.arange(len(mesh.faces)) % 4
    mesh = replace(mesh, face_materials=parts.astype(mesh.face_materials.dtype), materials=4 * mesh.materials[:1])
    kinds = [Material(kind="diffuse", albedo=(1.0, 0.7, 0.4)), Material(kind="mirror"), Material(kind="glass")]
    kinds.append(Material(kind="diffuse", albedo=(0.9, 0.6, 0.3)))
    materials = tuple(with_overrides(mesh.materials[:1], kind)[0] for kind in kinds)
    image = with_cube(pack(replace(mesh, materials=materials), design.manifest, materials), 5)
    if held is not None:
        image = with_environment(image, held, design.manifest)
    size = (48, 36) if in_room else (32, 24)
    still = frame_registers(scene, image.header, design.manifest, *size, held)
    untraced, mirrors = (
        frame_registers(replace(scene, paths=Paths(bounces=bounces)), image.header, design.manifest, *size, held)
        for bounces in (0, 1)
    )
    registers = [gathering(still, bounces, bounces) for bounces in (0, 1, 4)]
    registers += [gathering(mirrors, 2, 9), gathering(untraced, 1, 5)]
    if held is not None:
        for settings in registers[1::2]:
            settings["environment.boundingPlanes"] = 0  # Mirrors and glass see the cube
    none, one, four, *_ = equal_frames(design, image, registers, Stalls(20, 5))
    assert none.counters["raysGather"] == 0 < one.counters["raysGather"] < four.counters["raysGather"]
    assert (one.colour != none.colour).any(axis=2)[one.is_object].mean() > 0.3
    if one.ratio is not None and none.ratio is not None and four.ratio is not None:
        assert (one.ratio != none.ratio).any(axis=2).sum() > 5 and (four.ratio != one.ratio).any()
        assert (four.ratio > 4096).any(), "light is reflected onto the room"


@pytest.mark.matrix
def test_hardware_that_does_not_gather_takes_no_cycle() -> None:
    """Frames differ by the phase of their schedules, as from one to the next."""
    mesh, cycles = load_mesh("teapot:4"), []
    for options in ((), ("frame.gather=false",)):
        design = design_for("small", options)
        image = pack(mesh, design.manifest)
        registers = frame_registers(SCENE, image.header, design.manifest, 64, 48)
        (frame,) = render_rtl(design, image, [registers]).frames
        np.testing.assert_array_equal(frame.colour, render_model(design.manifest, image, registers).colour)
        cycles.append(frame.counters["cycles"])
    assert abs(cycles[0] / cycles[1] - 1) < 0.01
