"""Clip files of instances: what a target reads and refuses."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from animated_documents import arm
from instance_worlds import FRAME, instance

from colonnade import _core
from colonnade.common.errors import UserError
from colonnade.design.generator import manifest_for
from colonnade.design.manifest import Manifest
from colonnade.mesh.clips.keys import Keys
from colonnade.mesh.load import load_mesh
from colonnade.registers.motion_file import Motion
from colonnade.scene_image.bending import Bending
from colonnade.scene_image.header import ObjectFrame
from colonnade.scene_image.packer import pack

#: Words before the objects; of an object; words of a key of two objects.
FIXED, OBJECT, KEY = 25, 11, 25
WORLD = ObjectFrame(16000.0, (-2.0, -2.0, -2.0))


@pytest.fixture(scope="module")
def manifest() -> Manifest:
    return manifest_for("small", ("frame.instances=2",)).manifest


def motion(clips: tuple[tuple[int, bytes], ...] = ()) -> Motion:
    """Two objects, the first of which turns by half a turn in 2 s, and jumps then; the second is a third as large."""
    still = np.hstack([np.eye(3) / 3, [[0.5], [0.5], [0.5]]])
    angles = np.radians([0.0, 90.0, 180.0])
    turned = np.zeros((4, 3, 4))
    for matrix, angle in zip(turned, angles, strict=False):
        matrix[:, :3] = [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    turned[3] = np.hstack([np.eye(3), [[0.25], [0.0], [0.0]]])
    matrices = np.stack([turned, np.repeat(still[None], 4, axis=0)], axis=1)
    keys = Keys(np.array([0.0, 1.0, 2.0, 2.0]), matrices, np.zeros((4, 0)))
    instances = (instance(np.eye(3)), replace(instance(np.eye(3)), root=300, material_base=9))
    return Motion(instances, keys, WORLD, clips)


def target(file: bytes, manifest: Manifest) -> Any:
    registers = [one for one in manifest.registers.values() if one.access == "rw"]
    end = max(one.address + one.words for one in registers)
    return _core.TargetMotion(manifest.format_words, min(one.address for one in registers), end, file)


def changed(file: bytes, word: int, value: int) -> bytes:
    words = np.frombuffer(file, "<u4").copy()
    words[word] = value & 0xFFFFFFFF
    return words.tobytes()


def test_transforms_are_those_of_the_keys_and_between_them(manifest: Manifest) -> None:
    read = target(motion().file(manifest), manifest)
    for time, expected in ((0.0, 0), (1.0, 1), (2.0 - 2.0**-16, 2), (2.0, 3)):
        for number, (linear, exponent, position) in enumerate(read.transforms(round(time * 65536))):
            matrix = np.ldexp(np.array(linear, float).reshape(3, 3), exponent)
            whole = motion().keys.matrices[expected][number]
            scale = WORLD.scale / FRAME.scale
            np.testing.assert_allclose(matrix, whole[:, :3] * scale, atol=1e-4)
            corner = (whole[:, :3] @ np.array(FRAME.offset) + whole[:, 3] - np.array(WORLD.offset)) * WORLD.scale
            np.testing.assert_allclose(np.ldexp(np.array(position, float), -20), corner, atol=2.0)
    half = np.ldexp(np.array(read.transforms(32768)[0][0], float), read.transforms(0)[0][1]).reshape(3, 3)
    np.testing.assert_allclose(half[:2, :2], np.array([[0.5, -0.5], [0.5, 0.5]]) * scale, atol=1e-6)
    assert read.transforms(3 * 65536) == read.transforms(65536)  # it repeats


def test_a_file_that_is_cut_or_too_long_is_refused(manifest: Manifest) -> None:
    file = motion().file(manifest)
    for end in range(0, len(file), 4):
        with pytest.raises(ValueError, match="truncated"):
            target(file[:end], manifest)
        if end >= 4 * FIXED:
            with pytest.raises(ValueError, match="truncated"):
                target(changed(file[:end], 3, end), manifest)
    with pytest.raises(ValueError, match="truncated"):
        target(changed(file + bytes(4), 3, len(file) + 4), manifest)
    with pytest.raises(ValueError, match="otherFormat"):
        target(changed(file, 5, 1), manifest)


@pytest.mark.parametrize(
    ("word", "value", "error"),
    [
        (0, 0, "notAClip"),
        (2, 2, "notAClip"),
        (12, 9, "notAClip"),  # bits of vertices
        (13, -12, "notAClip"),  # of fractions
        (14, 73, "notAClip"),
        (15, 1 << 20, "badRegister"),  # addresses
        (16, 0, "badRegister"),
        (17, 0xFFFFFFFF, "badRegister"),
        (18, 0, "notAClip"),  # words of an instance, of the offset
        (18, 31, "notAClip"),
        (19, 3, "notAClip"),
        (20, 0, "notAClip"),  # objects, keys
        (20, 17, "notAClip"),
        (20, 1, "truncated"),
        (21, 0, "notAClip"),
        (21, 1 << 24, "truncated"),
        (22, 1, "notAClip"),  # duration
        (23, 21, "notAClip"),  # fraction of translations
        (24, 1, "truncated"),  # clips
        (24, 17, "notAClip"),
        (FIXED, -1, "notAClip"),  # bounds of an object
        (FIXED + 1, 40001, "notAClip"),
        (FIXED + 3, 1 << 16, "notAClip"),
        (FIXED + 2 * OBJECT, 1, "notAClip"),  # the first time
        (FIXED + 2 * OBJECT + KEY, 2 * 65536 + 1, "notAClip"),
        (FIXED + 2 * OBJECT + 1, 1 << 30, "notAClip"),  # an element of a matrix
        (FIXED + 2 * OBJECT + 1, -(1 << 30), "notAClip"),
    ],
)
def test_numbers_that_no_motion_has_are_refused(word: int, value: int, error: str, manifest: Manifest) -> None:
    with pytest.raises(ValueError, match=error):
        target(changed(motion().file(manifest), word, value), manifest)


@pytest.fixture(scope="module")
def bending(manifest: Manifest, tmp_path_factory: pytest.TempPathFactory) -> Bending:
    file = arm().write(tmp_path_factory.mktemp("clips") / "arm.gltf")
    moves = pack(load_mesh(file, animation="bend"), manifest).moves
    assert isinstance(moves, Bending)
    return moves


def test_clips_fill_the_rest_of_the_file(manifest: Manifest, bending: Bending) -> None:
    clip = bending.file
    assert target(motion(((7, clip), (9, clip))).file(manifest), manifest).meshes() == [
        (7, bending.duration),
        (9, bending.duration),
    ]
    file = motion(((7, clip),)).file(manifest)
    size = len(file) // 4 - len(clip) // 4 - 1
    for value in (0, 4, 9, len(clip) - 4, len(clip) + 4, 0xFFFFFFFC):
        with pytest.raises(ValueError, match="truncated"):
            target(changed(file, size, value), manifest)


@pytest.mark.parametrize(
    ("word", "value", "error"),
    [
        (0, 0, "notAClip"),
        (2, 2, "notAClip"),
        (3, 4, "truncated"),
        (4, 1, "otherFormat"),
        (17, 1, "notAClip"),  # records
        (18, 258, "notAClip"),  # nodes on a path
        (19, 0, "notAClip"),  # vertices
        (20, 1, "truncated"),  # leaves
        (25, 1, "notAClip"),  # duration
    ],
)
def test_clips_that_no_mesh_has_are_refused(
    word: int, value: int, error: str, manifest: Manifest, bending: Bending
) -> None:
    file = motion(((7, bending.file),)).file(manifest)
    first = len(file) // 4 - len(bending.file) // 4
    with pytest.raises(ValueError, match=error):
        target(changed(file, first + word, value), manifest)


def test_objects_that_leave_the_world_are_refused_when_they_do(manifest: Manifest) -> None:
    file = motion().file(manifest)
    place = FIXED + 2 * OBJECT + 2 * KEY + 4
    read = target(changed(file, place, (1 << 30) - 1), manifest)
    read.writes(0)
    with pytest.raises(ValueError, match="outside"):
        read.writes(2 * 65536 - 1)
    with pytest.raises(ValueError, match="flat"):
        target(changed(file, FIXED + 2 * OBJECT + 1, 0), manifest).writes(0)


def test_motions_that_no_file_holds_are_refused(manifest: Manifest) -> None:
    long = motion()
    long = replace(long, keys=replace(long.keys, times=long.keys.times * 40000.0))
    with pytest.raises(UserError, match="more than 18 hours"):
        long.file(manifest)
    far = motion()
    far.keys.matrices[1, 0, 0, 3] = 1e6
    with pytest.raises(UserError, match="moves too far"):
        far.file(manifest)
