"""Registers that the target computes in integers, against those that the host computes in floats."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from colonnade.common.errors import UserError
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import render_model
from colonnade.environment.load import load_environment
from colonnade.environment.model import Environment
from colonnade.mesh.load import load_mesh
from colonnade.registers.environment import environment_registers
from colonnade.registers.frame import frame_registers, registers_of
from colonnade.registers.occlusion import may_hide, occlusion_tolerance
from colonnade.registers.shadow_window import EMPTY, shadow_window
from colonnade.registers.target_view import TargetView, rotation_of
from colonnade.registers.view_file import camera_names, light_names, view_file
from colonnade.scene.model import Background, Light, MeshSource, Scene, Transform
from colonnade.scene.object_pose import Pose
from colonnade.scene.view import PlacedLight, View, make_view, place
from colonnade.scene_image.file import SceneImage
from colonnade.scene_image.packer import pack

ROOT = Path(__file__).parents[3]
GOLDEN = ROOT / "configs" / "golden"
#: Random poses for each design; 10000 for all.
POSES = int(os.environ.get("COLONNADE_VIEW_POSES", "300"))
SCENE = Scene(MeshSource(name="teapot:3"), light=Light(falloff=2.5), more_lights=(Light((-0.7, 1.1, 0.4)),))
ONE, METRE, PIXEL = 1 << 30, 1 << 32, 1 << 16
WIDTH, HEIGHT = 160, 120
EDGES = ("x0", "y0", "x1", "y1")


class Design:
    """A golden design with a packed mesh, and the view file of its scene."""

    def __init__(self, name: str) -> None:
        self.manifest = Manifest.load(GOLDEN / f"{name}.json")
        lights = int(self.manifest.config["frame"]["lights"])
        self.scene = dataclasses.replace(SCENE, more_lights=SCENE.more_lights[: lights - 1])
        self.image: SceneImage = pack(load_mesh("teapot:3"), self.manifest)
        self.header = self.image.header
        self.placed = place(self.scene, self.header.extent, WIDTH, HEIGHT)
        self.registers = frame_registers(self.scene, self.header, self.manifest, WIDTH, HEIGHT)
        self.file = view_file(self.placed, self.registers, (WIDTH, HEIGHT), self.header, self.manifest)
        self.view = make_view(self.scene, self.header.extent, WIDTH, HEIGHT, self.header.materials)

    def target(self) -> TargetView:
        return TargetView(self.file, self.manifest)


@pytest.fixture(scope="module", params=["tiny", "lean", "edge"])
def design(request: pytest.FixtureRequest) -> Design:
    return Design(request.param)


@pytest.fixture(scope="module")
def small_design() -> Design:
    return Design("edge")


@dataclasses.dataclass(frozen=True)
class Poses:
    """What the target is given: whole numbers."""

    object: tuple[list[int], list[int]]
    camera: tuple[list[int], list[int]]
    lens: list[int]
    size: tuple[int, int]
    lights: list[tuple[list[int], list[int], int]]

    def give(self, target: TargetView) -> None:
        target.set_object(*self.object)
        target.set_camera(*self.camera, self.lens, self.size)
        for index, light in enumerate(self.lights):
            target.set_light(index, *light)


def rotation(random: np.random.Generator) -> list[int]:
    quaternion = random.normal(size=4)
    quaternion = np.rint(quaternion / np.linalg.norm(quaternion) * ONE).astype(int)
    return list(rotation_of(tuple(quaternion.tolist())))


def looking(position: np.ndarray[Any, Any], target: np.ndarray[Any, Any], random: np.random.Generator) -> list[int]:
    """A camera's rotation; right, down, forward are its columns."""
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross(forward, random.normal(size=3))
    right /= np.linalg.norm(right)
    axes = np.column_stack([right, np.cross(forward, right), forward])
    return np.rint(axes * ONE).astype(int).ravel().tolist()


def random_poses(
    design: Design, random: np.random.Generator, nearest: float = 0.7, size: tuple[int, int] | None = None
) -> Poses:
    """A camera from `nearest` to 40 edges away that sees the object or not, and lights around it."""
    edge = design.header.extent.edge * design.placed.pose.scale
    centre = random.uniform(-2, 2, 3) * edge
    place = centre + random.normal(size=3) * edge * nearest * (40 / nearest) ** random.random()
    focal = max(1.0, 0.5 * HEIGHT / np.tan(np.radians(random.uniform(3, 130)) / 2))
    lens = [focal, focal * random.uniform(0.8, 1.25), *(np.array([WIDTH, HEIGHT]) * random.uniform(0.2, 0.8, 2))]
    lights = [
        (
            whole(random.normal(size=3) * edge * 30 * random.random() ** 3, METRE),
            whole(random.random(3) * 4, PIXEL),
            0 if random.random() < 0.3 else round(edge * 20 * random.random() ** 2 * METRE) + 1,
        )
        for _ in design.view.lights
    ]
    return Poses(
        (whole(centre + random.normal(size=3) * edge * 0.3, METRE), rotation(random)),
        (whole(place, METRE), looking(place, centre + random.normal(size=3) * edge, random)),
        whole(lens, PIXEL),
        size or (int(random.integers(1, WIDTH + 1)), int(random.integers(1, HEIGHT + 1))),
        lights,
    )


def whole(values: Any, unit: int) -> list[int]:
    return [round(float(value) * unit) for value in values]


def float_view(design: Design, poses: Poses) -> View:
    """The view of these whole numbers, as `make_view` computes it."""
    scale = design.placed.pose.scale
    turned = np.array(poses.object[1]).reshape(3, 3) / ONE

    def to_mesh(position: list[int]) -> Any:
        return np.array([(p - o) / METRE for p, o in zip(position, poses.object[0], strict=True)]) / scale @ turned

    right, down, forward = (np.array(poses.camera[1]).reshape(3, 3) / ONE).T
    fx, fy, cx, cy = (value / PIXEL for value in poses.lens)
    direction = forward + (0.5 - cx) / fx * right + (0.5 - cy) / fy * down
    return dataclasses.replace(
        design.view,
        width=poses.size[0],
        height=poses.size[1],
        origin=to_mesh(poses.camera[0]),
        direction=direction @ turned,
        step_x=right / fx @ turned,
        step_y=down / fy @ turned,
        lights=tuple(
            PlacedLight(to_mesh(p), np.array(c) / PIXEL, None if reach == 0 else reach / METRE / scale)
            for p, c, reach in poses.lights
        ),
    )


def both(
    design: Design, count: int, seed: int, nearest: float = 0.7
) -> Iterator[tuple[dict[str, int], dict[str, int]]]:
    """Registers of random poses, by the target and by the host."""
    random, target = np.random.default_rng(seed), design.target()
    for _ in range(count):
        poses = random_poses(design, random, nearest)
        poses.give(target)
        try:
            expected = registers_of(float_view(design, poses), design.header, design.manifest)
        except UserError:
            with pytest.raises(ValueError, match="tooFar"):
                target.writes()
            continue
        yield target.registers(), expected


def test_the_scene_of_the_file_is_that_of_the_host(design: Design) -> None:
    """All registers that poses do not change are the same."""
    found = design.target().registers()
    assert found.keys() == design.registers.keys()
    moved = {*camera_names(), *light_names(len(design.view.lights))}
    same = [name for name in found if name not in moved and "objectOutline" not in name]
    assert {name: found[name] for name in same} == {name: design.registers[name] for name in same}


def test_camera_and_lights_are_within_1_of_the_float_ones(design: Design) -> None:
    """Where one is shifted by a place more than the other, its unit is the larger one."""
    others = 0
    for found, expected in both(design, POSES, 1):
        for name in (*camera_names(), "frame.unitShift", *light_names(len(design.view.lights))):
            kind = "frame.unitShift" if name.endswith(("position.x", "position.y", "position.z")) else None
            kind = "camera.stepShift" if name.startswith("camera.step") and name != "camera.stepShift" else kind
            ours, theirs = (registers[kind] if kind else 0 for registers in (found, expected))
            if kind == "camera.stepShift":
                ours, theirs = -ours, -theirs
            low = min(ours, theirs)
            difference = (found[name] << (ours - low)) - (expected[name] << (theirs - low))
            assert abs(difference) <= 1 << (max(ours, theirs) - low), (name, found[name], expected[name])
            others += difference != 0
    assert others < 0.02 * POSES * 29


def test_the_rectangle_contains_that_of_the_host(design: Design) -> None:
    """It is a pixel larger at most; the host gives the whole frame wherever the target does."""
    for found, expected in both(design, POSES, 2, nearest=0.2):
        ours, theirs = (
            [registers[f"frame.objectRect.{edge}"] for edge in ("x0", "y0", "x1", "y1")]
            for registers in (found, expected)
        )
        if ours == [0, 0, 0, 0] or theirs == [0, 0, 0, 0]:
            assert (ours[2] - ours[0]) <= 4 or (theirs[2] - theirs[0]) <= 4 or ours == theirs
        else:
            assert np.abs(np.subtract(ours, theirs)).max() <= 1, (ours, theirs)


def pixels_of_box(registers: dict[str, int], manifest: Manifest) -> Any:
    """Whether the ray of each pixel enters the object's padded box, bool [height, width], by float slabs."""
    numbers = manifest.numbers
    vector = lambda name: np.array([float(registers[f"{name}.{axis}"]) for axis in "xyz"])  # noqa: E731
    origin = vector("camera.position") * 2.0 ** (registers["frame.unitShift"] - numbers["gridFraction"])
    x, y = np.meshgrid(np.arange(registers["frame.width"]), np.arange(registers["frame.height"]))
    rays = vector("camera.direction") * 2.0 ** registers["camera.stepShift"]
    rays = rays + x[..., None] * vector("camera.stepX") + y[..., None] * vector("camera.stepY")
    pad = 2.0 ** numbers["boxPadLog"]
    with np.errstate(divide="ignore", invalid="ignore"):
        planes = np.stack([(vector("bounds.low") - pad - origin) / rays, (vector("bounds.high") + pad - origin) / rays])
    enters, leaves = planes.min(axis=0).max(axis=-1), planes.max(axis=0).min(axis=-1)
    return np.maximum(enters, 0) <= leaves


def pixels_of_outline(registers: dict[str, int]) -> Any:
    """Whether rectangle and outline admit each pixel, bool [height, width]."""
    x, y = np.meshgrid(np.arange(registers["frame.width"]), np.arange(registers["frame.height"]))
    x0, y0, x1, y1 = (registers[f"frame.objectRect.{edge}"] for edge in EDGES)
    admitted = (x >= x0) & (x < x1) & (y >= y0) & (y < y1)
    for edge in range(6):
        a, b, offset = (registers[f"frame.objectOutline[{edge}].{part}"] for part in ("x", "y", "offset"))
        admitted &= a * x + b * y + offset >= 0
    return admitted


def test_no_ray_that_enters_the_box_is_outside_the_outline(design: Design) -> None:
    """Also where the box reaches behind the camera, or all of it lies there."""
    seen = admitted = whole_frames = 0
    for found, expected in both(design, POSES, 3, nearest=0.05):
        in_box, in_outline = pixels_of_box(found, design.manifest), pixels_of_outline(found)
        assert not (in_box & ~in_outline).any()
        seen, admitted = seen + in_box.sum(), admitted + in_outline.sum()
        whole_frames += pixels_of_outline(expected).all()
    assert 0 < seen <= admitted < 1.5 * seen, "the outline excludes most of the rest"
    assert whole_frames > 0


def test_frames_with_the_outline_are_those_of_the_whole_frame(small_design: Design) -> None:
    """The model's frames are the same, pixel for pixel, with the outline and without."""
    random, target = np.random.default_rng(4), small_design.target()
    manifest, image = small_design.manifest, small_design.image
    objects = admitted = 0
    frames = max(8, POSES // 20)
    for index in range(frames):
        random_poses(small_design, random, (0.7, 0.1)[index % 2], (80, 60)).give(target)
        registers = target.registers()
        whole = registers | {name: 0 for name in registers if "objectOutline" in name}
        whole |= {
            f"frame.objectRect.{name}": value
            for name, value in zip(("x0", "y0", "x1", "y1"), (0, 0, 80, 60), strict=True)
        }
        frame, expected = render_model(manifest, image, registers), render_model(manifest, image, whole)
        np.testing.assert_array_equal(frame.colour, expected.colour)
        np.testing.assert_array_equal(frame.triangle, expected.triangle)
        np.testing.assert_array_equal(frame.is_object, expected.is_object)
        objects += expected.is_object.sum()
        admitted += pixels_of_outline(registers).sum()
    assert 0 < objects <= admitted < 0.9 * 80 * 60 * frames


Move = st.tuples(st.sampled_from(["object", "camera", "light", "all"]), st.booleans(), st.integers(0, 99))


@settings(deadline=None, max_examples=60)
@given(moves=st.lists(Move, max_size=8), forgets=st.integers(0, 8))
def test_changed_words_make_the_whole_frame(small_design: Design, moves: Any, forgets: int) -> None:
    """Whatever moves, and whatever the device has not taken: it has the registers of the last accepted frame."""
    target, current = small_design.target(), random_poses(small_design, np.random.default_rng(100))
    for index, (what, is_taken, seed) in enumerate(moves):
        poses, whole_target = random_poses(small_design, np.random.default_rng(seed)), small_design.target()
        current = poses if what == "all" else dataclasses.replace(current, **_part(poses, what))
        current.give(target)
        if index == forgets:
            target.forget()
        try:
            writes = target.writes()
        except ValueError:
            continue
        if is_taken:
            current.give(whole_target)
            assert target.accept(writes) == whole_target.registers()
            assert target.writes() == []


def _part(poses: Poses, what: str) -> dict[str, Any]:
    if what == "camera":
        return {"camera": poses.camera, "lens": poses.lens, "size": poses.size}
    return {"object": poses.object} if what == "object" else {"lights": poses.lights}


UNIT = [ONE, 0, 0, 0, ONE, 0, 0, 0, ONE]
LENS = [500 * PIXEL, 500 * PIXEL, 80 * PIXEL, 60 * PIXEL]


def test_wrong_poses_are_refused_by_name(small_design: Design) -> None:
    target = small_design.target()
    before = target.writes()
    mirrored, stretched, skewed = list(UNIT), list(UNIT), list(UNIT)
    mirrored[0] = -ONE
    stretched[4] += 1 << 14
    skewed[1] = 1 << 12
    for wrong in (mirrored, stretched, skewed, [0] * 9, [-(1 << 31)] * 9):
        with pytest.raises(ValueError, match="badPose"):
            target.set_object([0, 0, 0], wrong)
    with pytest.raises(ValueError, match="badPose"):
        target.set_object([1 << 60, 0, 0], UNIT)
    with pytest.raises(ValueError, match="badPose"):
        target.set_light(0, [0, -(1 << 62), 0], [0, 0, 0])
    for index, value in ((0, PIXEL - 1), (1, (1 << 31) - 1), (2, (1 << 30) + 1), (3, -(1 << 31))):
        lens = list(LENS)
        lens[index] = value
        with pytest.raises(ValueError, match="badLens"):
            target.set_camera([0, 0, 0], UNIT, lens, (160, 120))
    with pytest.raises(ValueError, match="badLens"):
        target.set_camera([0, 0, 0], UNIT, LENS, (0, 120))
    with pytest.raises(ValueError, match="tooLarge"):
        target.set_camera([0, 0, 0], UNIT, LENS, (1921, 120))
    with pytest.raises(ValueError, match="noLight"):
        target.set_light(2, [0, 0, 0], [0, 0, 0])
    assert target.writes() == before, "a refusal changes nothing"
    target.set_camera([(1 << 60) - 1, 0, 0], UNIT, LENS, (160, 120))
    with pytest.raises(ValueError, match="tooFar"):
        target.writes()


@pytest.mark.parametrize("quaternion", [[0, 0, 0, 0], [ONE, ONE, 0, 0], [-(1 << 31)] * 4, [0, 0, 0, ONE - 2048]])
def test_quaternions_have_the_length_1(quaternion: list[int]) -> None:
    with pytest.raises(ValueError, match="badPose"):
        rotation_of(quaternion)


def test_quaternions_turn_as_they_should() -> None:
    assert rotation_of((0, 0, 0, ONE)) == tuple(UNIT)
    half = round(ONE * 0.5**0.5)
    assert np.abs(np.subtract(rotation_of((0, 0, half, half)), (0, -ONE, 0, ONE, 0, 0, 0, 0, ONE))).max() <= 2


def test_other_files_are_refused_by_name(small_design: Design) -> None:
    file, manifest = small_design.file, small_design.manifest
    words = np.frombuffer(file, dtype="<u4")

    def with_word(index: int, value: int) -> bytes:
        changed = words.copy()
        changed[index] = value
        return changed.tobytes()

    cases = {
        "notAView": (b"CLNDFRAM" + file[8:], with_word(2, 2), with_word(12, 33), with_word(30, 0)),
        "otherFormat": (with_word(5, 0),),
        "truncated": (file[:-4], file + bytes(8), file[:40], with_word(28, int(words[28]) + 1)),
        "badRegister": (with_word(22, 0), with_word(24, 1 << 30)),
        "badPose": (with_word(50, 0),),
    }
    for name, files in cases.items():
        for changed in files:
            with pytest.raises(ValueError, match=name):
                TargetView(changed, manifest)


def test_wide_designs_are_refused(make_manifest: Any) -> None:
    manifest = make_manifest(mac=48)
    image = pack(load_mesh("cube"), manifest)
    scene = Scene(MeshSource(name="cube"))
    registers = frame_registers(scene, image.header, manifest, 64, 48)
    with pytest.raises(UserError, match="lower precision"):
        view_file(place(scene, image.header.extent, 64, 48), registers, (64, 48), image.header, manifest)


class Room:
    """A room with exact and with decoded depth, in place of encoded maps, and the view file of an object in it."""

    def __init__(self) -> None:
        self.manifest = Manifest.load(GOLDEN / "small.json")
        full = load_environment(ROOT / "scenes" / "rooms" / "attic")
        small = (slice(None, None, 4), slice(None, None, 4))
        camera = dataclasses.replace(
            full.camera, **{name: getattr(full.camera, name) / 4 for name in ("fx", "fy", "cx", "cy")}
        )
        self.environment: Environment = dataclasses.replace(
            full,
            albedo=full.albedo[small],
            normals=full.normals[small],
            depth=full.depth[small],
            camera=camera,
            photo=None,
        )
        noise = np.random.default_rng(5).normal(size=self.environment.depth.shape)
        self.depth = self.environment.depth * (1 + 0.002 * noise)
        image = SimpleNamespace(
            depth_unit=float(self.environment.depth.min()) * 0.9,
            decoded_depth=lambda _: self.depth,
            planes=SimpleNamespace(bounding=np.ones((8, 3))),
        )
        self.maps: Any = SimpleNamespace(environment=self.environment, image=image)
        self.header = pack(load_mesh("teapot:3"), self.manifest).header
        self.scale = 0.4 / self.header.extent.edge
        middle = self.environment.points()[90, 80] @ self.to_world[:, :3].T + self.to_world[:, 3]
        scene = Scene(
            MeshSource(name="teapot:3"),
            transform=Transform(scale=self.scale, translate=tuple(middle.tolist())),
            light=Light((0.1, 2.2, 1.2), falloff=1.6),
            more_lights=(Light((-1.0, 1.5, 1.0)),),
            background=Background(room=ROOT / "scenes" / "rooms" / "attic"),
        )
        self.placed = place(scene, self.header.extent, WIDTH, HEIGHT, self.environment)
        self.registers = frame_registers(scene, self.header, self.manifest, WIDTH, HEIGHT, self.maps, relit=False)
        self.view = make_view(scene, self.header.extent, WIDTH, HEIGHT, self.header.materials, self.environment)
        size = (WIDTH, HEIGHT)
        self.file = view_file(self.placed, self.registers, size, self.header, self.manifest, self.maps)
        self.middle = middle

    @property
    def to_world(self) -> Any:
        return self.environment.camera_to_world

    def random_view(self, random: np.random.Generator, target: TargetView) -> View:
        """Move object and lights, in the target and in a view."""
        turned, moved = rotation(random), whole(self.middle + random.normal(size=3) * (0.6, 0.3, 0.6), METRE)
        pose = Pose(np.array(turned).reshape(3, 3) / ONE, self.scale, np.array(moved) / METRE)
        target.set_object(moved, turned)
        lights = []
        for index, light in enumerate(self.view.lights):
            place = whole(self.middle + random.normal(size=3) * (1.5, 1.0, 1.5) + (0, 1, 0), METRE)
            target.set_light(index, place, whole(light.colour, PIXEL))
            lights.append(dataclasses.replace(light, position=pose.to_mesh(np.array(place) / METRE), reach=None))
        return dataclasses.replace(
            self.view,
            origin=pose.to_mesh(self.to_world[:, 3]),
            view_to_mesh=pose.from_view(self.to_world),
            lights=tuple(lights),
        )


@pytest.fixture(scope="module")
def room() -> Room:
    return Room()


def room_views(room: Room, seed: int) -> Iterator[tuple[dict[str, int], View]]:
    """Registers by the target, and the view, of random poses whose camera is in the hardware's range."""
    random, target = np.random.default_rng(seed), TargetView(room.file, room.manifest)
    for _ in range(max(20, POSES // 10)):
        view = room.random_view(random, target)
        yield target.registers(), view


def test_the_projection_to_the_maps_is_the_float_one(room: Room) -> None:
    for found, view in room_views(room, 6):
        expected = environment_registers(view, room.maps, room.header, room.manifest, False)

        def numbers(registers: dict[str, int]) -> tuple[Any, Any, float]:
            unit = 2.0 ** -registers["environment.exponent"]
            step = unit * 2.0 ** registers["environment.offsetShift"]
            matrix = [registers[f"environment.matrix[{i}].{axis}"] * unit for i in range(3) for axis in "xyz"]
            return np.array(matrix), np.array([registers[f"environment.offset.{axis}"] * step for axis in "xyz"]), step

        (matrix, offset, step), (exact_matrix, exact_offset, _) = numbers(found), numbers(expected)
        np.testing.assert_allclose(matrix, exact_matrix, rtol=0, atol=2.0**-26 * np.abs(exact_matrix).max())
        np.testing.assert_allclose(offset, exact_offset, rtol=0, atol=8 * step)
        for name in (name for name in expected if "rotation" in name):
            assert abs(found[name] - expected[name]) <= 1
        for name in ("environment.stepX", "environment.stepY", "environment.boundingPlanes", "environment.enabled"):
            assert found[name] == expected[name]


def test_the_window_contains_that_of_the_pixels(room: Room) -> None:
    shares = []
    for found, view in room_views(room, 7):
        x0, y0, x1, y1 = (found[f"environment.window.{edge}"] for edge in EDGES)
        a0, b0, a1, b1 = shadow_window(view, room.environment, room.depth, room.header.extent)
        if (a0, b0, a1, b1) != EMPTY:
            assert x0 <= a0 and y0 <= b0 and x1 >= a1 and y1 >= b1
        shares.append(((x1 - x0) * (y1 - y0), (a1 - a0) * (b1 - b0)))
    ours, theirs = np.array(shares, dtype=float).mean(axis=0) / (WIDTH * HEIGHT)
    assert theirs < ours < min(0.9, 2.5 * theirs), (ours, theirs)


def test_occlusion_is_on_wherever_the_room_may_hide_the_object(room: Room) -> None:
    on = 0
    for found, view in room_views(room, 8):
        steps = room.header.frame.scale * 2.0 ** room.manifest.numbers["gridFraction"]
        tolerance = found["environment.occlusionTolerance"] / steps
        if found["environment.occlusion"]:
            on += 1
            distance = np.abs(room.header.extent.centre - view.origin).max()
            assert 0.0024 * distance <= tolerance <= max(0.1 * room.header.extent.edge, 0.0026 * distance)
            assert tolerance >= 0.5 * occlusion_tolerance(view, room.maps, room.header.extent)
        else:
            assert not may_hide(view, room.maps, room.header.extent, 0.0025 * room.header.extent.edge)
    assert on > 0


def test_the_camera_of_a_room_is_that_of_its_maps(room: Room) -> None:
    target = TargetView(room.file, room.manifest)
    with pytest.raises(ValueError, match="mapCamera"):
        target.set_camera([0, 0, 0], UNIT, LENS, (WIDTH, HEIGHT))
