"""Designs with view files, and random poses for a target and for the host's floats."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from float_registers import OutOfReach, float_registers

from colonnade.design.manifest import Manifest
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.registers.target_view import TargetView, rotation_of
from colonnade.registers.view_file import view_file
from colonnade.scene.model import Light, MeshSource, Scene
from colonnade.scene.object_pose import Placed
from colonnade.scene.samples import Point, samples_of_frame
from colonnade.scene.view import PlacedLight, View, make_view, world_view
from colonnade.scene_image.file import SceneImage
from colonnade.scene_image.packer import pack

ROOT = Path(__file__).parents[2]
GOLDEN = ROOT / "configs" / "golden"
#: Random poses for each design; 10000 for all.
POSES = int(os.environ.get("COLONNADE_VIEW_POSES", "300"))
SCENE = Scene(MeshSource(name="teapot:3"), light=Light(falloff=2.5), more_lights=(Light((-0.7, 1.1, 0.4)),))
ONE, METRE, PIXEL, COLOUR = 1 << 30, 1 << 32, 1 << 32, 1 << 16
WIDTH, HEIGHT = 160, 120
UNIT = [ONE, 0, 0, 0, ONE, 0, 0, 0, ONE]
LENS = [500 * PIXEL, 500 * PIXEL, 80 * PIXEL, 60 * PIXEL]
EDGES = ("x0", "y0", "x1", "y1")


class Design:
    """A design with a packed mesh, and the view file of its scene."""

    def __init__(self, manifest: Manifest) -> None:
        self.manifest = manifest
        lights = int(self.manifest.config["frame"]["lights"])
        self.scene = dataclasses.replace(SCENE, more_lights=SCENE.more_lights[: lights - 1])
        self.image: SceneImage = pack(load_mesh("teapot:3"), self.manifest)
        self.header = self.image.header
        self.placed = world_view(Placed(self.scene, self.header.extent), WIDTH, HEIGHT)
        self.registers = frame_registers(self.scene, self.header, self.manifest, WIDTH, HEIGHT)
        self.file = view_file(self.placed, self.registers, (WIDTH, HEIGHT), self.header, self.manifest)
        self.view = make_view(Placed(self.scene, self.header.extent), WIDTH, HEIGHT, self.header.materials)

    @classmethod
    def golden(cls, name: str) -> Design:
        return cls(Manifest.load(GOLDEN / f"{name}.json"))

    def target(self) -> TargetView:
        return TargetView(self.file, self.manifest)


@dataclasses.dataclass(frozen=True)
class Poses:
    """What the target is given: whole numbers."""

    object: tuple[list[int], list[int]]
    camera: tuple[list[int], list[int]]
    lens: list[int]
    size: tuple[int, int]
    lights: list[tuple[list[int], list[int], int]]
    sample: tuple[int, int] = (0, 1)

    def give(self, target: TargetView) -> None:
        target.set_object(*self.object)
        target.set_camera(*self.camera, self.lens, self.size)
        for index, light in enumerate(self.lights):
            target.set_light(index, *light)
        target.set_sample(*self.sample)


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
            whole(random.random(3) * 4, COLOUR),
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


def random_sample(random: np.random.Generator) -> tuple[int, int]:
    """Index and number of a frame's passes."""
    count = 1 << int(random.integers(5))
    return int(random.integers(count)), count


def pixel_shift(index: int, count: int) -> Point:
    """The host's shift of the rays in a pass, pixels."""
    return samples_of_frame(count, 0)[index].pixel


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
    shift = pixel_shift(*poses.sample)
    direction = forward + (0.5 + shift[0] - cx) / fx * right + (0.5 + shift[1] - cy) / fy * down
    return dataclasses.replace(
        design.view,
        width=poses.size[0],
        height=poses.size[1],
        origin=to_mesh(poses.camera[0]),
        direction=direction @ turned,
        step_x=right / fx @ turned,
        step_y=down / fy @ turned,
        lights=tuple(
            PlacedLight(to_mesh(p), np.array(c) / COLOUR, None if reach == 0 else reach / METRE / scale)
            for p, c, reach in poses.lights
        ),
    )


def both(
    design: Design, count: int, seed: int, nearest: float = 0.7
) -> Iterator[tuple[dict[str, int], dict[str, int]]]:
    """Registers of random poses, by the target and in floats."""
    random, target = np.random.default_rng(seed), design.target()
    samples = [(index, passes) for passes in (1, 2, 4, 8, 16) for index in range(passes)]
    for number in range(count):
        poses = dataclasses.replace(random_poses(design, random, nearest), sample=samples[number % len(samples)])
        poses.give(target)
        try:
            expected = float_registers(float_view(design, poses), design.header, design.manifest)
        except OutOfReach:
            with pytest.raises(ValueError, match="tooFar"):
                target.writes()
            continue
        yield target.registers(), expected
