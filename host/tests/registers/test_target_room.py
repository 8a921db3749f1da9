"""Projection, window and occlusion that the target computes in a room: against the host's floats, and in frames."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from float_registers import float_projection
from target_views import (
    COLOUR,
    EDGES,
    GOLDEN,
    HEIGHT,
    METRE,
    ONE,
    PIXEL,
    POSES,
    ROOT,
    WIDTH,
    looking,
    pixel_shift,
    random_sample,
    rotation,
    whole,
)

from colonnade.design.generator import manifest_for
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import loaded_model, model_frame
from colonnade.environment.load import load_environment
from colonnade.environment.model import Environment
from colonnade.maps.encoded import EncodedEnvironment
from colonnade.maps.planes import PlaneProjection
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.registers.occlusion import may_hide, occlusion_tolerance
from colonnade.registers.shadow_window import EMPTY, shadow_window
from colonnade.registers.target_view import TargetView
from colonnade.registers.view_file import view_file
from colonnade.registers.view_room import WINDOW_NEAR, WINDOW_SHADOW, WINDOW_WORD
from colonnade.scene.model import Background, Light, MeshSource, Scene, Transform
from colonnade.scene.object_pose import Placed, Pose
from colonnade.scene.view import Gather, View, make_view, world_view
from colonnade.scene_image.environment import with_environment
from colonnade.scene_image.packer import pack

ROOMS = ROOT / "scenes" / "rooms"
ENCODED = ["living", "office"]
#: Frames of the model for each encoded room.
FRAMES = max(12, POSES // 100)


def decoded_with_noise(name: str) -> Any:
    """A room of a quarter of its size whose depth has errors, in place of encoded maps."""
    full = load_environment(ROOMS / name)
    small = (slice(None, None, 4), slice(None, None, 4))
    lens = {part: getattr(full.camera, part) / 4 for part in ("fx", "fy", "cx", "cy")}
    environment: Environment = dataclasses.replace(
        full,
        albedo=full.albedo[small],
        normals=full.normals[small],
        depth=full.depth[small],
        camera=dataclasses.replace(full.camera, **lens),
        photo=None,
    )
    depth = environment.depth * (1 + 0.002 * np.random.default_rng(5).normal(size=environment.depth.shape))
    image: Any = SimpleNamespace(
        depth_unit=float(environment.depth.min()) * 0.9,
        decoded_depth=lambda _: depth,
        planes=SimpleNamespace(bounding=np.ones((8, 3))),
    )
    return EncodedEnvironment(environment, image)


class Room:
    """A room with exact and with decoded depth, and the view file of an object in it."""

    def __init__(self, name: str, widths: Sequence[str] = ()) -> None:
        self.manifest = manifest_for("small", widths).manifest if widths else Manifest.load(GOLDEN / "small.json")
        self.maps: Any = (
            EncodedEnvironment.of(load_environment(ROOMS / name), self.manifest, "live")
            if name in ENCODED
            else decoded_with_noise(name)
        )
        self.environment: Environment = self.maps.environment
        projection = PlaneProjection.of(self.environment, self.maps.image.depth_unit)
        self.depth = self.maps.image.decoded_depth(projection)
        self.image = pack(load_mesh("teapot:3"), self.manifest)
        if name in ENCODED:
            self.image = with_environment(self.image, self.maps, self.manifest)
        self.header = self.image.header
        self.scale = 0.4 / self.header.extent.edge
        self.middle = self.surface_point(0.625, 0.55)
        scene = Scene(
            MeshSource(name="teapot:3"),
            transform=Transform(scale=self.scale, translate=tuple(self.middle.tolist())),
            light=Light((0.1, 2.2, 1.2), falloff=1.6),
            more_lights=(Light((-1.0, 1.5, 1.0)),),
            background=Background(room=ROOMS / name),
        )
        size = (WIDTH, HEIGHT)
        placed = world_view(Placed(scene, self.header.extent, self.environment), *size)
        registers = frame_registers(scene, self.header, self.manifest, *size, self.maps, relit=False)
        self.view = make_view(Placed(scene, self.header.extent, self.environment), *size, self.header.materials)
        self.file = view_file(placed, registers, size, self.header, self.manifest, self.maps)

    @property
    def to_world(self) -> Any:
        return self.environment.camera_to_world

    def surface_point(self, down: float, right: float) -> Any:
        """A point of the room, world space, by its place in the picture."""
        row, column = int(down * self.environment.height), int(right * self.environment.width)
        return self.environment.points()[row, column] @ self.to_world[:, :3].T + self.to_world[:, 3]

    def random_view(self, random: np.random.Generator, target: TargetView, moves_camera: bool) -> View:
        """Move object and lights, and the camera if asked, in the target and in a view of one of several passes."""
        sample = random_sample(random)
        target.set_sample(*sample)
        across, below = shift = pixel_shift(*sample)
        middle = self.middle if random.random() < 0.5 else self.surface_point(*random.uniform(0.3, 0.99, 2))
        turned, moved = rotation(random), whole(middle + random.normal(size=3) * (0.6, 0.3, 0.6), METRE)
        pose = Pose(np.array(turned).reshape(3, 3) / ONE, self.scale, np.array(moved) / METRE)
        target.set_object(moved, turned)
        lights = []
        for index, light in enumerate(self.view.lights):
            place = whole(middle + random.normal(size=3) * (1.5, 1.0, 1.5) + (0, 1, 0), METRE)
            target.set_light(index, place, whole(light.colour, COLOUR))
            lights.append(dataclasses.replace(light, position=pose.to_mesh(np.array(place) / METRE), reach=None))
        view = dataclasses.replace(
            self.view,
            origin=pose.to_mesh(self.to_world[:, 3]),
            shift=shift,
            view_to_mesh=pose.from_view(self.to_world),
            lights=tuple(lights),
        )
        if not moves_camera:
            return view
        place = self.to_world[:, 3] + random.normal(size=3) * 0.3
        place, focal = np.array(whole(place, METRE)) / METRE, WIDTH * random.uniform(0.7, 1.5)
        turned = looking(place, middle + random.normal(size=3) * 0.3, random)
        target.set_camera(whole(place, METRE), turned, whole([focal, focal, 80, 60], PIXEL), (WIDTH, HEIGHT))
        right, down, forward = (np.array(turned).reshape(3, 3) / ONE).T
        return dataclasses.replace(
            view,
            origin=pose.to_mesh(place),
            direction=(forward + (across - 79.5) / focal * right + (below - 59.5) / focal * down) @ pose.rotation,
            step_x=right / focal @ pose.rotation,
            step_y=down / focal @ pose.rotation,
            is_map_camera=False,
        )


@pytest.fixture(scope="module", params=["attic", *ENCODED, "attic 24 64", "attic 64 64"])
def room(request: pytest.FixtureRequest) -> Room:
    name, *widths = request.param.split()
    keys = ("precision.mac", "geometry.triangleBits")
    return Room(name, [f"{key}={value}" for key, value in zip(keys, widths, strict=False)])


def room_views(
    room: Room, seed: int, count: int = max(20, POSES // 10), moves_camera: bool = False, gathers: bool = False
) -> Iterator[tuple[dict[str, int], View]]:
    """Registers by the target, and the view, of random poses."""
    words = np.frombuffer(room.file, dtype="<u4").copy()
    window = 85 + 11 * words[28] + WINDOW_WORD
    assert words[window] == WINDOW_SHADOW
    words[window] += WINDOW_NEAR * gathers
    random, target = np.random.default_rng(seed), TargetView(words.tobytes(), room.manifest)
    for _ in range(count):
        view = room.random_view(random, target, moves_camera)
        yield target.registers(), dataclasses.replace(view, gather=Gather(1, ()) if gathers else None)


MOVES = pytest.mark.parametrize("moves_camera", [False, True], ids=["of the maps", "another"])


@MOVES
def test_the_projection_to_the_maps_is_the_float_one(room: Room, moves_camera: bool) -> None:
    """But for rotations that are none, by the rounding of their entries: floats invert them, the target transposes."""
    axes = room.to_world[:, :3]
    error = 2.0**-28 + 2 * np.abs(axes @ axes.T - np.eye(3)).max()
    low_bits = max(0, room.manifest.numbers["macBits"] - 32)
    for found, view in room_views(room, 6, moves_camera=moves_camera):
        expected = float_projection(view, room.environment, room.maps.image, room.header, room.manifest)

        def numbers(registers: dict[str, int]) -> list[tuple[Any, float]]:
            unit = 2.0 ** (low_bits - registers["environment.exponent"])
            step = unit * 2.0 ** registers["environment.offsetShift"]
            names = [f"environment.matrix[{i}].{axis}" for i in range(3) for axis in "xyz"]
            offset = [f"environment.offset.{axis}" for axis in "xyz"]
            return [
                (np.array([registers[name] / 2.0**low_bits for name in group]) * least, least)
                for group, least in ((names, unit), (offset, step))
            ]

        for (ours, least), (theirs, _) in zip(numbers(found), numbers(expected), strict=True):
            np.testing.assert_allclose(ours, theirs, rtol=0, atol=max(least, error * np.abs(theirs).max()))
        for name in (name for name in expected if "rotation" in name):
            assert abs(found[name] - expected[name]) <= 1


@pytest.mark.parametrize("gathers", [False, True])
def test_the_window_contains_that_of_the_pixels(room: Room, gathers: bool) -> None:
    shares = []
    for found, view in room_views(room, 7, gathers=gathers):
        x0, y0, x1, y1 = (found[f"environment.window.{edge}"] for edge in EDGES)
        a0, b0, a1, b1 = shadow_window(view, room.environment, room.depth, room.header.extent)
        if (a0, b0, a1, b1) != EMPTY:
            assert x0 <= a0 and y0 <= b0 and x1 >= a1 and y1 >= b1
        shares.append(((x1 - x0) * (y1 - y0), (a1 - a0) * (b1 - b0)))
    ours, theirs = np.array(shares, dtype=float).mean(axis=0) / (WIDTH * HEIGHT)
    print(f"window: {ours:.3f} of the frame, by pixels {theirs:.3f}")
    assert theirs < ours < min(0.9, 3 * theirs), (ours, theirs)


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


@MOVES
@pytest.mark.parametrize("name", ENCODED)
def test_frames_are_those_of_the_whole_window_and_of_occlusion(name: str, moves_camera: bool) -> None:
    """The object darkens no pixel outside the window, and where occlusion is off it changes no pixel."""
    room = Room(name)
    model, darkened, off = loaded_model(room.manifest, room.image), 0, 0
    for found, _ in room_views(room, 9, FRAMES, moves_camera):
        assert found["environment.isMapCamera"] == (not moves_camera)
        frame = model_frame(model, found)
        edges = zip(EDGES, (0, 0, WIDTH, HEIGHT), strict=True)
        whole_window = found | {f"environment.window.{edge}": value for edge, value in edges}
        whole_frame = model_frame(model, whole_window)
        assert frame.ratio is not None and whole_frame.ratio is not None
        np.testing.assert_array_equal(frame.ratio, whole_frame.ratio)
        np.testing.assert_array_equal(frame.is_object, whole_frame.is_object)
        np.testing.assert_array_equal(frame.colour[frame.is_object], whole_frame.colour[frame.is_object])
        darkened += int(((frame.ratio != frame.ratio.max()).any(axis=2) & ~frame.is_object).sum())
        if not found["environment.occlusion"]:
            hidden = model_frame(model, found | {"environment.occlusion": 1, "environment.occlusionTolerance": 1 << 16})
            np.testing.assert_array_equal(frame.is_object, hidden.is_object)
            off += 1
    print(f"{darkened} pixels of the room darkened; occlusion is off in {off} of {FRAMES} frames")
    assert darkened > 0 and (off == 0 if moves_camera else off > 0)
