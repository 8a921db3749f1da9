"""Frames in a room: the RTL against the model, bit for bit, and the shadow window."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from colonnade_lab.evaluation.environment_march import DeviceMarch
from colonnade_lab.evaluation.studies.ar_losses import PLACEMENTS
from equal_frames import IN_ROOM, assert_equal, equal_frames
from live_maps import live_maps

from colonnade.common.types import Floats
from colonnade.design.generator import design_for, manifest_for
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import render_model
from colonnade.device.verilator import Stalls, render_rtl
from colonnade.environment.load import load_environment
from colonnade.maps.encoded import EncodedEnvironment
from colonnade.maps.encoders import Encoder
from colonnade.maps.planes import PlaneProjection
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.mesh import Extent
from colonnade.reference.environment.ray_march import HIT
from colonnade.registers.frame import frame_registers
from colonnade.registers.occlusion import tolerance_registers
from colonnade.scene.model import (
    Background,
    Camera,
    Colour,
    Light,
    Material,
    MeshSource,
    Paths,
    Placement,
    Scene,
    Transform,
    Vector,
)
from colonnade.scene.object_pose import Placed
from colonnade.scene.samples import CENTRE, Sample
from colonnade.scene.view import make_view, with_overrides
from colonnade.scene_image.environment import with_environment
from colonnade.scene_image.packer import pack

ROOMS = Path(__file__).parents[3] / "scenes" / "rooms"
TABLE = Scene(
    MeshSource(name="teapot:4"),
    placement=Placement((322.0, 306.0), 0.58, 25.0),
    light=Light((0.1, 2.2, 1.2), falloff=1.6),
    ambient=Colour((0.3, 0.3, 0.3)),
    background=Background(room=ROOMS / "living"),
)
SECOND = Light((-1.0, 1.5, 1.0), colour=(0.2, 0.5, 0.3))

#: Beside `small`: maps that two columns share, and two marches.
SHARED = ("physicalAttributeMemory.columnsPerCopy=2", "units.marches=2")
SLIC = ("physicalAttributeMemory.encoding=slic",)

#: Rooms with the encoder of their maps; the offline one needs 20 seconds for each.
STILL_ROOMS = (
    ("living", "live"),
    ("attic", "live"),
    pytest.param("living", "offline", marks=pytest.mark.matrix),
    pytest.param("office", "offline", marks=pytest.mark.matrix),
    pytest.param("attic", "offline", marks=pytest.mark.matrix),
)


@pytest.mark.verilator
@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("diffuse", ()),
        pytest.param("mirror", ("array.rows=3", "array.columns=5"), marks=pytest.mark.matrix),
        pytest.param("glass", SHARED, marks=pytest.mark.matrix),
        pytest.param("mirror", SLIC, marks=pytest.mark.matrix),
    ],
    ids=["diffuse", "mirror, 3×5", "glass, maps shared by two columns", "mirror, SLIC maps"],
)
def test_hardware_renders_the_rooms_of_the_model(kind: str, options: tuple[str, ...]) -> None:
    """The relit room and the shadow window; two lights, one light, no bounces; a sample; a stalled sink."""
    design = design_for("small", options)
    held = live_maps(ROOMS / "living", design.manifest)
    mesh = load_mesh("teapot:4")
    material = Material(kind=kind, albedo=(0.9, 0.95, 0.9))
    image = with_environment(
        pack(mesh, design.manifest, with_overrides(mesh.materials, material)), held, design.manifest
    )
    scene = replace(TABLE, material=material, more_lights=(SECOND,))
    beside = replace(scene, light=replace(scene.light, radius=0.2), sample=Sample((0.3, -0.4), lights=((0.6, 0.8),)))
    still = replace(scene, more_lights=(), paths=Paths(bounces=0))
    views = [(scene, True), (scene, False), (still, False), (beside, False)]
    registers: list[dict[str, int]] = [
        frame_registers(view, image.header, design.manifest, 24, 18, held, relit) for view, relit in views
    ]
    # A large offset shows on which side of the surface a ray starts
    registers.append(registers[1] | {"shading.offset": 64 * registers[1]["shading.offset"]})
    # An object that is half below the table's surface, in frames so large that few pixels differ
    sunk = frame_registers(sunken(scene, held, image.header.extent), image.header, design.manifest, 56, 42, held, False)
    assert sunk["environment.occlusion"] == 1
    registers += [sunk, sunk | {"environment.occlusionTolerance": 0}, sunk | {"environment.occlusion": 0}]
    frames = equal_frames(design, image, registers, Stalls(20, 5))
    first = frames[0]
    assert first.is_object.any()
    assert first.ratio is not None and first.ratio.min() < 4096, "there is a shadow"
    assert (first.counters["marchSteps"] > 0) == (kind != "diffuse")
    hidden, exact, whole = frames[-3:]
    assert 0 < hidden.is_object.sum() < whole.is_object.sum()
    assert not (exact.is_object & ~hidden.is_object).any(), "a smaller tolerance hides more"
    for frame in (hidden, exact, whole):
        assert frame.counters["hits"] == frame.is_object.sum()
        assert (frame.distance[~frame.is_object] == 0).all()
    assert hidden.counters["raysEnvironment"] >= whole.is_object.sum(), "each hit is tested"
    differs = (exact.colour != whole.colour).any(axis=2) & exact.is_object
    assert differs.any() == (kind != "diffuse"), "the room hides hits of later rays"


@pytest.mark.parametrize("options", [(), SLIC], ids=["two-level maps", "SLIC maps"])
def test_ambient_light_shows_the_decoded_albedo(options: tuple[str, ...]) -> None:
    """In every pixel beside the object the model reads the entry that the host has written."""
    manifest = manifest_for("small", options).manifest
    held = live_maps(ROOMS / "living", manifest)
    image = with_environment(pack(load_mesh("cube"), manifest), held, manifest)
    scene = replace(TABLE, light=replace(TABLE.light, colour=(0.0, 0.0, 0.0)), ambient=Colour((1.0, 1.0, 1.0)))
    model = render_model(manifest, image, frame_registers(scene, image.header, manifest, 640, 480, held, relit=True))
    assert model.errors == []
    colours = model.colour / ((1 << manifest.numbers["colourBits"]) - 1)
    assert model.is_object.mean() < 0.2
    assert np.abs(colours - held.image.decoded_albedo())[~model.is_object].max() < 1e-3


def moved(scene: Scene, held: EncodedEnvironment, by: tuple[float, float, float], degrees: float = 0.0) -> Scene:
    """The scene from a camera beside the maps': metres right, down and forward; turned right."""
    to_world = held.environment.camera_to_world
    position = to_world[:, 3] + to_world[:, :3] @ by
    target = position + 2.0 * to_world[:, :3] @ (np.sin(np.radians(degrees)), 0.0, np.cos(np.radians(degrees)))
    camera = Camera(position=vector(position), target=vector(target), up=vector(-to_world[:, 1]))
    return replace(scene, camera=camera)


def vector(values: Floats) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z


#: Cameras beside the maps': at it, before and behind it, far aside, turned away.
MOVES = (
    ((0.0, 0.0, 0.0), 0.0),
    ((0.15, 0.0, 0.2), 3.0),
    ((-0.15, -0.05, -0.2), -3.0),
    ((1.5, 0.3, 0.5), -40.0),
    ((0.1, 0.0, -0.1), 100.0),
)


@pytest.mark.verilator
@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("glass", ()),
        pytest.param("diffuse", IN_ROOM, marks=pytest.mark.matrix),
        pytest.param("glass", IN_ROOM, marks=pytest.mark.matrix),
    ],
)
def test_hardware_sees_the_rooms_of_the_model_from_any_camera(kind: str, options: tuple[str, ...]) -> None:
    """Relit and in the shadow window, with an object that the room hides; and maps whose registers are any bits."""
    design = design_for("small", options)
    held = live_maps(ROOMS / "living", design.manifest)
    mesh, material = load_mesh("teapot:4"), Material(kind=kind)
    image = with_environment(
        pack(mesh, design.manifest, with_overrides(mesh.materials, material)), held, design.manifest
    )
    scene = replace(TABLE, material=material)
    registers: list[dict[str, int]] = [
        frame_registers(moved(scene, held, *move), image.header, design.manifest, 18, 14, held, relit)
        for move in MOVES
        for relit in (True, False)
    ]
    low = moved(sunken(scene, held, image.header.extent), held, *MOVES[1])
    sunk = frame_registers(low, image.header, design.manifest, 32, 24, held, False)
    assert sunk["environment.occlusion"] == 1
    registers += [sunk, sunk | {"environment.occlusion": 0}]
    random = np.random.default_rng(1)
    for _ in range(4):
        wild = {
            name: int(random.integers(-(1 << (register.width - 1)), 1 << (register.width - 1)))
            if register.signed
            else int(random.integers(0, 1 << register.width))
            for name, register in design.manifest.registers.items()
            if name.startswith(("environment.matrix", "environment.offset", "environment.exponent"))
        }
        registers.append(registers[2] | wild)
    frames = equal_frames(design, image, registers, Stalls(20, 5))
    assert all(frame.counters["marchSteps"] > 0 for frame in frames[:8:2])
    hidden, whole = frames[2 * len(MOVES) : 2 * len(MOVES) + 2]
    assert 0 < hidden.is_object.sum() < whole.is_object.sum()


@pytest.mark.verilator
@pytest.mark.parametrize("options", [(), pytest.param(IN_ROOM, marks=pytest.mark.matrix)], ids=["small", "pipelines"])
def test_a_room_after_an_abort_is_right(options: tuple[str, ...]) -> None:
    """Pixels are in all stages when the watchdog aborts: none is in the next frame."""
    design = design_for("small", options)
    held = live_maps(ROOMS / "living", design.manifest)
    mesh, material = load_mesh("teapot:4"), Material(kind="glass")
    image = with_environment(
        pack(mesh, design.manifest, with_overrides(mesh.materials, material)), held, design.manifest
    )
    scene = replace(TABLE, material=material, more_lights=(SECOND,))
    settings = frame_registers(scene, image.header, design.manifest, 24, 18, held, True)
    registers = [
        frame for limit in range(20, 300, 40) for frame in (settings | {"frame.watchdogCycles": limit}, settings)
    ]
    frames = render_rtl(design, image, registers, Stalls(20, 5)).frames
    model = render_model(design.manifest, image, settings)
    assert model.is_object.any() and sum(frame.errors == ["watchdog"] for frame in frames) > 3
    for frame in frames[1::2]:
        assert_equal(frame, model)


def sunken(scene: Scene, held: EncodedEnvironment, extent: Extent) -> Scene:
    """The scene with its object 15 cm lower."""
    pose = Placed(scene, extent, held.environment).pose
    x, y, z = (float(value) for value in pose.translate)
    turn = (0.0, scene.placement.turn if scene.placement else 0.0, 0.0)
    return replace(scene, placement=None, transform=Transform(turn, pose.scale, (x, y - 0.15, z)))


@pytest.mark.parametrize(("room", "encoder"), STILL_ROOMS)
@pytest.mark.parametrize("mesh", ["teapot:8", "bunny"])
def test_a_standing_object_keeps_its_foot(room: str, encoder: Encoder, mesh: str) -> None:
    """No pixel is lost where object and room are in contact."""
    if mesh == "bunny" and not os.environ.get("COLONNADE_MESHES"):
        pytest.skip("COLONNADE_MESHES names no folder with bunny")
    manifest = manifest_for("small").manifest
    held = EncodedEnvironment.of(load_environment(ROOMS / room), manifest, encoder)
    image = with_environment(pack(load_mesh(mesh), manifest), held, manifest)
    scene = replace(TABLE, placement=PLACEMENTS[room], background=Background(room=ROOMS / room))
    registers = frame_registers(scene, image.header, manifest, 640, 480, held, relit=False)
    view = make_view(Placed(scene, image.header.extent, held.environment), 640, 480, image.header.materials)
    tested = registers | tolerance_registers(view, held, image.header, manifest) | {"environment.occlusion": 1}
    without = render_model(manifest, image, registers | {"environment.occlusion": 0})
    assert without.is_object.sum() > 500
    for settings in (registers, tested):
        np.testing.assert_array_equal(render_model(manifest, image, settings).is_object, without.is_object)


def test_occlusion_is_off_where_the_room_cannot_hide_the_object() -> None:
    """On a free table, and with the scene's key."""
    manifest = manifest_for("small").manifest
    held = live_maps(ROOMS / "living", manifest)
    header = with_environment(pack(load_mesh("teapot:4"), manifest), held, manifest).header

    def occlusion(scene: Scene) -> int:
        return frame_registers(scene, header, manifest, 160, 120, held)["environment.occlusion"]

    free = replace(TABLE, placement=PLACEMENTS["living"])
    sunk = sunken(TABLE, held, header.extent)
    assert occlusion(free) == 0 and occlusion(sunk) == 1
    assert occlusion(replace(sunk, background=replace(sunk.background, occlusion=False))) == 0


@pytest.mark.parametrize(("room", "encoder"), STILL_ROOMS)
def test_a_march_from_the_camera_of_the_maps_sees_what_its_pixels_show(room: str, encoder: Encoder) -> None:
    """Points agree within a millimetre; in tiles of several planes few pixels see another plane."""
    manifest = manifest_for("small").manifest
    held = EncodedEnvironment.of(load_environment(ROOMS / room), manifest, encoder)
    march = DeviceMarch(held.environment, held.image, manifest, is_from_camera=True)
    directions = held.environment.camera.directions(held.environment.width, held.environment.height).reshape(-1, 3)
    decoded = held.image.decoded_depth(PlaneProjection.of(held.environment, held.image.depth_unit)).ravel()
    hits = march(np.zeros_like(directions), directions)
    assert (hits.kind == HIT).mean() > 0.999
    with np.errstate(invalid="ignore"):
        near = np.abs(hits.z / decoded - 1.0) < 1e-3
    assert near.mean() > 0.99
    rows, columns = np.divmod(np.arange(len(directions)), held.environment.width)
    assert (np.maximum(np.abs(hits.seen_u - columns - 0.5), np.abs(hits.seen_v - rows - 0.5)) <= 1.0).mean() > 0.999


def assert_shadows_in_window(scene: Scene, held: EncodedEnvironment, manifest: Manifest, share: float) -> None:
    """Pixels of the room are darker, all of them in the shadow window, which is less than this share of the frame."""
    image = with_environment(pack(load_mesh("teapot:4"), manifest), held, manifest)
    registers = frame_registers(scene, image.header, manifest, 320, 240, held, relit=False)
    assert registers["environment.isMapCamera"] == (scene.camera == TABLE.camera)
    x0, y0, x1, y1 = (registers[f"environment.window.{edge}"] for edge in ("x0", "y0", "x1", "y1"))
    assert 0 < (x1 - x0) * (y1 - y0) < share * 320 * 240
    frame = render_model(manifest, image, frame_registers(scene, image.header, manifest, 320, 240, held))
    assert frame.ratio is not None
    darker = (frame.ratio < 4096).any(axis=2)
    assert darker.any()
    darker[y0:y1, x0:x1] = False
    assert not darker.any()


@pytest.mark.parametrize("move", MOVES[1:3])
def test_shadows_lie_within_the_shadow_window_of_another_camera(move: tuple[tuple[float, float, float], float]) -> None:
    manifest = manifest_for("small").manifest
    held = live_maps(ROOMS / "living", manifest)
    assert_shadows_in_window(moved(TABLE, held, *move), held, manifest, 0.5)


@pytest.mark.parametrize("light", [TABLE.light, Light((1.2, 2.0, 2.0)), Light((0.1, 0.9, 2.4), radius=0.3)])
@pytest.mark.parametrize("sample", [CENTRE, Sample((0.49, -0.49), lights=((0.6, 0.8),))], ids=["centre", "corner"])
def test_shadows_lie_within_the_shadow_window(light: Light, sample: Sample) -> None:
    manifest = manifest_for("small").manifest
    held = live_maps(ROOMS / "living", manifest)
    assert_shadows_in_window(replace(TABLE, light=light, sample=sample), held, manifest, 1.0)
