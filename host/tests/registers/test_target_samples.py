"""Passes of a frame that the target computes, against the samples of the host."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from target_views import GOLDEN, HEIGHT, WIDTH

from colonnade.design.manifest import Manifest
from colonnade.registers.target_view import TargetView
from colonnade.registers.view_names import camera_names, gather_names, light_names
from colonnade.scene.model import Light, MeshSource, Paths, Scene
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene.samples import samples_of_frame

COUNTS = (1, 2, 4, 8, 16, 32, 64)
SCENE = Scene(
    MeshSource(name="teapot:3"),
    light=Light(falloff=2.5),
    more_lights=(Light((-0.7, 1.1, 0.4)),),
    paths=Paths(gather=2),
)


@pytest.fixture(scope="module")
def prepared() -> DeviceScene:
    return DeviceScene.of(SCENE, Manifest.load(GOLDEN / "small.json"), size=(WIDTH, HEIGHT))


def test_the_registers_of_all_passes_are_those_of_the_host(prepared: DeviceScene) -> None:
    """Camera and lights within 1, outlines apart; the first frame is the only one of one pass.

    Shifts of other numbers of passes are in `test_target_view.py`, of random poses.
    """
    size = (WIDTH, HEIGHT)
    target = TargetView(prepared.view_file(size), prepared.manifest)
    assert target.registers() == _pass(target, 0, 1)
    moved = {*camera_names(), *light_names(2)}
    for count in (4, 16):
        for index, one in enumerate(prepared.passes(prepared.scene.with_samples(count))):
            found, expected = _pass(target, index, count), prepared.registers(size, one)
            assert found.keys() == expected.keys()
            for name in (name for name in expected if "objectOutline" not in name):
                assert abs(found[name] - expected[name]) <= (name in moved), (name, index, count)


def _pass(target: TargetView, index: int, count: int) -> dict[str, int]:
    target.set_sample(index, count)
    return target.registers()


@pytest.mark.parametrize("lights", range(9))
def test_sample_points_are_those_of_the_host(prepared: DeviceScene, lights: int) -> None:
    """The lights come before the rays in the samples' dimensions, so the points of rays depend on their number."""
    words = np.frombuffer(prepared.view_file((WIDTH, HEIGHT)), dtype="<u4")
    start, light = 85, 11
    content = np.concatenate([words[:start], *[words[start : start + light]] * lights, words[start + 2 * light :]])
    content[3], content[28] = content.nbytes, lights
    target = TargetView(content.tobytes(), prepared.manifest)
    addresses = [prepared.manifest.registers[name].address for name in gather_names()]
    for count in COUNTS:
        for index, sample in enumerate(samples_of_frame(count, lights)):
            target.set_sample(index, count)
            target.forget()
            written = dict(target.writes())
            assert [written[address] for address in addresses] == [value for point in sample.gather for value in point]


def test_a_scene_that_gathers_nothing_has_constant_sample_points(prepared: DeviceScene) -> None:
    scene = dataclasses.replace(SCENE, paths=Paths())
    still = DeviceScene.of(scene, prepared.manifest, size=(WIDTH, HEIGHT))
    target = TargetView(still.view_file((WIDTH, HEIGHT)), still.manifest)
    assert {_pass(target, 3, 16)[name] for name in gather_names()} == {0}
