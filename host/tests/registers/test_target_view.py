"""Camera and lights that the target computes in integers, against the host's in floats."""

from __future__ import annotations

import dataclasses
import runpy
import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from target_views import HEIGHT, LENS, ONE, PIXEL, POSES, ROOT, UNIT, WIDTH, Design, Poses, both, random_poses

from colonnade.design.generator import manifest_for
from colonnade.device.bit_exact import loaded_model, model_frame
from colonnade.registers.target_view import TargetView, rotation_of
from colonnade.registers.view_names import camera_names, light_names
from colonnade.registers.view_words import rotation_values


def test_the_scene_of_the_file_is_that_of_the_host(design: Design) -> None:
    """All registers that poses do not change are the same."""
    found = design.target().registers()
    assert found.keys() == design.registers.keys()
    moved = {*camera_names(), *light_names(len(design.view.lights))}
    same = [name for name in found if name not in moved and "objectOutline" not in name]
    assert {name: found[name] for name in same} == {name: design.registers[name] for name in same}


def test_the_soc_finds_the_poses_of_the_file(design: Design) -> None:
    """Camera and light as its scripts read them are the file's: setting them changes nothing."""
    places = runpy.run_path(str(ROOT / "soc" / "litex" / "view_places.py"))
    camera = struct.unpack_from("<3q9i4q2I", design.file, 4 * places["CAMERA"])
    light = struct.unpack_from("<3q3IQ", design.file, 4 * places["LIGHT"])
    target = design.target()
    target.set_object(
        struct.unpack_from("<3q", design.file, 4 * places["OBJECT"]), rotation_values(design.placed.pose.rotation)
    )
    target.set_camera(camera[0:3], camera[3:12], camera[12:16], (camera[16], camera[17]))
    target.set_light(0, light[0:3], light[3:6], light[6])
    assert struct.unpack_from("<2I", design.file, 4 * places["WIDTH"]) == (WIDTH, HEIGHT)
    assert target.writes() == design.target().writes()


#: precision.mac, geometry.triangleBits, geometry.vertexBits.
WIDTHS = [(16, 16, 24), (24, 64, 10), (48, 48, 16), (64, 24, 16), (64, 64, 24)]


@pytest.fixture(scope="module", params=["tiny", "lean", "edge", *WIDTHS], ids=str)
def any_design(request: pytest.FixtureRequest) -> Design:
    if isinstance(request.param, str):
        return Design.golden(request.param)
    keys = ("precision.mac", "geometry.triangleBits", "geometry.vertexBits")
    widths = [f"{key}={value}" for key, value in zip(keys, request.param, strict=True)]
    return Design(manifest_for("small", widths).manifest)


def test_camera_and_lights_are_within_1_of_the_float_ones(any_design: Design) -> None:
    """Where one is shifted by a place more than the other, its unit is the larger one; of wide operands it is that of
    the upper 32 bits."""
    words, others, design = 0, 0, any_design
    more = max(0, design.manifest.numbers["macBits"] - 32)
    for found, expected in both(design, POSES, 1):
        for name in (*camera_names(), "frame.unitShift", *light_names(len(design.view.lights))):
            kind = "frame.unitShift" if name.endswith(("position.x", "position.y", "position.z")) else None
            kind = "camera.stepShift" if name.startswith("camera.step") and name != "camera.stepShift" else kind
            ours, theirs = (registers[kind] if kind else 0 for registers in (found, expected))
            if kind == "camera.stepShift":
                ours, theirs = -ours, -theirs
            low = min(ours, theirs)
            difference = (found[name] << (ours - low)) - (expected[name] << (theirs - low))
            low_bits = more if kind is not None or "direction" in name else 0
            assert abs(difference) <= 1 << (max(ours + low_bits, theirs) - low), (name, found[name], expected[name])
            words, others = words + 1, others + (difference != 0)
    print(f"{others} of {words} words differ, by 1 at most")
    assert more > 0 or others < 0.02 * words


def test_frames_are_those_of_the_floats(any_design: Design) -> None:
    """The model's frames; camera and lights differ by their roundings, which move few pixels."""
    model, objects, others = loaded_model(any_design.manifest, any_design.image), 0, 0
    for found, floats in both(any_design, 8, 5):
        frame, expected = model_frame(model, found), model_frame(model, found | floats)
        others += int((frame.colour != expected.colour).any(axis=2).sum())
        objects += int(expected.is_object.sum())
    assert objects > 50 and others < 0.02 * objects


Move = st.tuples(st.sampled_from(["object", "camera", "light", "all"]), st.booleans(), st.integers(0, 99))


@settings(max_examples=60)
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
    for index, value in ((0, PIXEL // 16 - 1), (1, (1 << 56) + 1), (2, (1 << 56) + 1), (3, -(1 << 63))):
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
    for index, count in ((0, 0), (0, 3), (1, 1), (64, 64), (0, 128), (0, 1 << 31), ((1 << 32) - 1, 8)):
        with pytest.raises(ValueError, match="noSample"):
            target.set_sample(index, count)
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
        "notAView": (
            *(b"CLNDFRAM" + file[8:], with_word(2, 1), with_word(12, 15), with_word(12, 65), with_word(13, 73)),
            *(with_word(14, 52), with_word(14, 1 << 31), with_word(31, 0)),
        ),
        "otherFormat": (with_word(5, 0),),
        "truncated": (file[:-4], file + bytes(8), file[:40], with_word(29, int(words[29]) + 1)),
        "badRegister": (with_word(22, 0), with_word(24, 1 << 30), with_word(27, 1)),
        "badPose": (with_word(51, 0),),
    }
    for name, files in cases.items():
        for changed in files:
            with pytest.raises(ValueError, match=name):
                TargetView(changed, manifest)
