"""Frame registers: values that fit, rays of the float camera, and a rectangle that contains the whole object."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from colonnade.common.errors import UserError
from colonnade.design.manifest import Manifest
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.registers.watchdog import TREE_VISITS
from colonnade.scene.model import Camera, Light, Material, MeshSource, Scene, Transform
from colonnade.scene.object_pose import Placed
from colonnade.scene.samples import Sample
from colonnade.scene.view import make_view, with_overrides
from colonnade.scene_image.file import SceneImage
from colonnade.scene_image.packer import pack

MakeManifest = Callable[..., Manifest]

SCENE = Scene(MeshSource(name="teapot:3"))
TEAPOT = load_mesh("teapot:3")


@pytest.fixture(scope="module")
def image(manifest: Manifest) -> SceneImage:
    return pack(TEAPOT, manifest)


def vector(registers: dict[str, int], name: str) -> np.ndarray[Any, Any]:
    return np.array([float(registers[f"{name}.{axis}"]) for axis in "xyz"])


def ray(registers: dict[str, int], x: float, y: float) -> np.ndarray[Any, Any]:
    """The direction of a pixel's ray by the formula of docs/numbers.md."""
    first = vector(registers, "camera.direction") * 2.0 ** registers["camera.stepShift"]
    return first + x * vector(registers, "camera.stepX") + y * vector(registers, "camera.stepY")


def unit(direction: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    return direction / np.linalg.norm(direction)


def placed(position: tuple[float, float, float], **changes: Any) -> Scene:
    return dataclasses.replace(SCENE, camera=Camera(position=position, **changes))


@pytest.mark.parametrize("mac", [16, 24, 32, 48, 64])
@pytest.mark.parametrize(("width", "height"), [(640, 480), (1, 1), (1920, 1080), (7, 300)])
def test_every_register_is_set_and_fits(make_manifest: MakeManifest, mac: int, width: int, height: int) -> None:
    manifest = make_manifest(mac=mac)
    registers = frame_registers(SCENE, pack(TEAPOT, manifest).header, manifest, width, height)
    assert set(registers) == {name for name, register in manifest.registers.items() if register.access == "rw"}
    for name, value in registers.items():
        manifest.registers[name].encode(value)


@pytest.mark.parametrize(("mac", "tolerance"), [(16, 1e-4), (32, 1e-8), (64, 1e-12)])
def test_rays_are_those_of_the_float_camera(make_manifest: MakeManifest, mac: int, tolerance: float) -> None:
    manifest = make_manifest(mac=mac)
    scene = dataclasses.replace(SCENE, transform=Transform((10.0, 120.0, -40.0), 3.0, (1.0, -2.0, 0.5)))
    header = pack(TEAPOT, manifest).header
    registers = frame_registers(scene, header, manifest, 640, 480)
    view = make_view(Placed(scene, header.extent), 640, 480)
    for x, y in ((0, 0), (639, 0), (0, 479), (639, 479), (320, 240)):
        exact = unit(view.direction + x * view.step_x + y * view.step_y)
        np.testing.assert_allclose(unit(ray(registers, x, y)), exact, atol=tolerance)
    scale = 2.0 ** (registers["frame.unitShift"] - manifest.numbers["gridFraction"]) / header.frame.scale
    for name, point in (("camera", view.origin), ("lights[0]", view.light)):
        position = vector(registers, f"{name}.position") * scale + np.array(header.frame.offset)
        np.testing.assert_allclose(position, point, atol=0.51 * scale * 1.001)
    largest = max(np.abs(ray(registers, x, y)).max() for x in (0, 639) for y in (0, 479))
    assert largest == pytest.approx(2.0 ** (mac - 2 + registers["camera.stepShift"]), rel=1e-2)


def test_pixel_0_0_is_at_the_top_left(manifest: Manifest, image: SceneImage) -> None:
    registers = frame_registers(placed((0.0, 1.5, 20.0)), image.header, manifest, 64, 48)
    corner = ray(registers, 0, 0)
    assert corner[0] < 0 < corner[1] and corner[2] < 0
    middle = unit(ray(registers, 31.5, 23.5))
    np.testing.assert_allclose(middle, unit(image.header.extent.centre - np.array([0.0, 1.5, 20.0])), atol=1e-6)


@pytest.mark.parametrize(("width", "height"), [(640, 480), (480, 480), (200, 600)])
def test_a_framed_object_is_centred_with_the_requested_height(width: int, height: int) -> None:
    view = make_view(Placed(SCENE, TEAPOT.extent), width, height)
    basis = np.stack([view.step_x, view.step_y, view.direction], axis=1)
    x, y, depth = np.linalg.solve(basis, (TEAPOT.vertices - view.origin).T)
    x, y = x / depth + 0.5, y / depth + 0.5
    assert (depth > 0).all()
    shares = (np.ptp(y) / height / 0.7, np.ptp(x) / width / 0.9)
    assert max(shares) == pytest.approx(1.0, abs=0.01)
    assert x.max() + x.min() == pytest.approx(width, abs=0.01 * width)
    assert y.max() + y.min() == pytest.approx(height, abs=0.01 * height)


def test_the_light_is_relative_to_cube_and_camera() -> None:
    scene = dataclasses.replace(SCENE, camera=Camera(direction=(0.0, 0.0, 1.0)), light=Light(offset=(1.2, 1.6, 1.5)))
    extent = TEAPOT.extent
    expected = extent.centre + extent.edge * np.array([1.2, 1.6, 1.5])
    np.testing.assert_allclose(make_view(Placed(scene, extent), 64, 48).light, expected)


@settings(max_examples=60)
@given(
    position=st.tuples(*[st.floats(-12, 12)] * 3),
    target=st.tuples(*[st.floats(-3, 3)] * 3),
    fov=st.floats(5, 140),
    mac=st.sampled_from([16, 32]),
    shift=st.tuples(*[st.floats(-0.5, 0.5)] * 2),
    lens=st.tuples(*[st.floats(-0.7, 0.7)] * 2),
)
def test_no_vertex_is_seen_outside_rectangle_and_outline(
    make_manifest: MakeManifest,
    position: tuple[float, float, float],
    target: tuple[float, float, float],
    fov: float,
    mac: int,
    shift: tuple[float, float],
    lens: tuple[float, float],
) -> None:
    """For any camera and sample, also inside the object: each vertex in the frame projects into the rectangle."""
    manifest = make_manifest(mac=mac)
    header = pack(TEAPOT, manifest).header
    if np.linalg.norm(np.subtract(position, target)) < 1e-3:
        return
    scene = placed(position, target=target, fov=fov, aperture=0.5)
    sampled = dataclasses.replace(scene, sample=Sample(pixel=shift, lens=lens))
    registers = frame_registers(sampled, header, manifest, 160, 120)
    origin = vector(registers, "camera.position") * 2.0 ** (
        registers["frame.unitShift"] - manifest.numbers["gridFraction"]
    )
    basis = np.stack(
        [vector(registers, "camera.stepX"), vector(registers, "camera.stepY"), ray(registers, 0, 0)], axis=1
    )
    vertices = (TEAPOT.vertices - np.array(header.frame.offset)) * header.frame.scale
    x, y, depth = np.linalg.solve(basis, (vertices - origin).T)
    ahead = depth > 0
    x, y = x[ahead] / depth[ahead], y[ahead] / depth[ahead]
    seen = (x > -0.5) & (x < 159.5) & (y > -0.5) & (y < 119.5)
    x0, y0, x1, y1 = (registers[f"frame.objectRect.{name}"] for name in ("x0", "y0", "x1", "y1"))
    assert (x[seen] >= x0 - 0.5).all() and (x[seen] <= x1 - 0.5).all()
    assert (y[seen] >= y0 - 0.5).all() and (y[seen] <= y1 - 0.5).all()
    assert 0 <= x0 <= x1 <= 160 and 0 <= y0 <= y1 <= 120
    for edge in range(6):
        a, b, offset = (registers[f"frame.objectOutline[{edge}].{name}"] for name in ("x", "y", "offset"))
        assert (a * np.clip(x[seen], 0, 159) + b * np.clip(y[seen], 0, 119) + offset >= 0).all()


def rectangle(registers: dict[str, int]) -> tuple[int, ...]:
    return tuple(registers[f"frame.objectRect.{name}"] for name in ("x0", "y0", "x1", "y1"))


def test_the_rectangle_within_behind_and_beside(manifest: Manifest, image: SceneImage) -> None:
    within = frame_registers(placed((0.0, 1.5, 0.0), target=(5.0, 1.5, 0.0)), image.header, manifest, 64, 48)
    assert rectangle(within) == (0, 0, 64, 48)
    behind = frame_registers(placed((0.0, 1.5, 20.0), target=(0.0, 1.5, 40.0)), image.header, manifest, 64, 48)
    assert rectangle(behind) == (0, 0, 0, 0)
    beside = frame_registers(placed((40.0, 1.5, 20.0), target=(40.0, 1.5, 0.0)), image.header, manifest, 64, 48)
    assert rectangle(beside) == (0, 0, 0, 0)
    framed = frame_registers(SCENE, image.header, manifest, 640, 480)
    x0, y0, x1, y1 = rectangle(framed)
    assert x1 - x0 < 640 and y1 - y0 < 480


def test_a_camera_far_away_takes_coarser_units(manifest: Manifest, image: SceneImage) -> None:
    shifts = []
    for distance in (10.0, 100.0, 1000.0, 5000.0):
        registers = frame_registers(placed((0.0, 0.0, distance)), image.header, manifest, 64, 48)
        shifts.append(registers["frame.unitShift"])
    assert shifts == sorted(shifts) and shifts[-1] > 0


def test_a_camera_out_of_reach_is_refused(manifest: Manifest, image: SceneImage) -> None:
    with pytest.raises(UserError, match=r"the camera is .* object-cube edges away, the hardware's range is 1,024"):
        frame_registers(placed((0.0, 0.0, 1e5)), image.header, manifest, 64, 48)
    far = dataclasses.replace(SCENE, light=Light(position=(1e9, 0.0, 0.0)))
    with pytest.raises(UserError, match="light 1 is"):
        frame_registers(far, image.header, manifest, 64, 48)


def test_impossible_frame_sizes_are_rejected(manifest: Manifest, image: SceneImage) -> None:
    for size, message in (((0, 4), "no pixels"), ((4, -1), "no pixels"), ((1921, 4), "maxWidth"), ((4, 1081), "maxH")):
        with pytest.raises(UserError, match=message):
            frame_registers(SCENE, image.header, manifest, *size)
    with pytest.raises(UserError, match="camera's position is its target"):
        frame_registers(placed((1.0, 1.0, 1.0), target=(1.0, 1.0, 1.0)), image.header, manifest, 64, 48)


def test_looking_straight_down_works(manifest: Manifest, image: SceneImage) -> None:
    scene = dataclasses.replace(SCENE, camera=Camera(direction=(0.0, 1.0, 0.0)))
    assert rectangle(frame_registers(scene, image.header, manifest, 64, 48)) != (0, 0, 64, 48)


def test_the_watchdog_outlasts_every_legal_frame_and_ends_in_minutes(make_manifest: MakeManifest) -> None:
    """Each ray may visit `TREE_VISITS` nodes; `small` simulates 60,000 cycles per second."""
    manifest, mesh = make_manifest(), load_mesh("teapot")
    header = pack(mesh, manifest).header
    scene = Scene(MeshSource(name="teapot"))
    contexts, cycles_a_visit = int(manifest.config["array"]["contexts"]), 20
    lit = frame_registers(scene, header, manifest, 640, 480)["frame.watchdogCycles"]
    unlit = frame_registers(dataclasses.replace(scene, light=Light(shadows=False)), header, manifest, 640, 480)[
        "frame.watchdogCycles"
    ]
    assert 2 * contexts * TREE_VISITS * cycles_a_visit < lit < 30 * 60_000
    assert contexts * TREE_VISITS * cycles_a_visit < unlit < lit
    mirror = dataclasses.replace(scene, material=Material(kind="mirror"))
    shiny = pack(mesh, manifest, with_overrides(mesh.materials, mirror.material)).header
    assert frame_registers(mirror, shiny, manifest, 640, 480)["frame.watchdogCycles"] > 2 * lit
    assert frame_registers(scene, header, manifest, 8, 8)["frame.watchdogCycles"] == lit
