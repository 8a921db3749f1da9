"""Camera and lights that the target computes in integers, against those that the host computes in floats."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from target_views import LENS, ONE, PIXEL, POSES, UNIT, Design, Poses, both, random_poses

from colonnade.common.errors import UserError
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.registers.target_view import TargetView, rotation_of
from colonnade.registers.view_file import camera_names, light_names, view_file
from colonnade.scene.model import MeshSource, Scene
from colonnade.scene.view import place
from colonnade.scene_image.packer import pack


def test_the_scene_of_the_file_is_that_of_the_host(design: Design) -> None:
    """All registers that poses do not change are the same."""
    found = design.target().registers()
    assert found.keys() == design.registers.keys()
    moved = {*camera_names(), *light_names(len(design.view.lights))}
    same = [name for name in found if name not in moved and "objectOutline" not in name]
    assert {name: found[name] for name in same} == {name: design.registers[name] for name in same}


def test_camera_and_lights_are_within_1_of_the_float_ones(design: Design) -> None:
    """Where one is shifted by a place more than the other, its unit is the larger one."""
    words = others = 0
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
            words, others = words + 1, others + (difference != 0)
    print(f"{others} of {words} words differ, by 1")
    assert others < 0.02 * words


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
