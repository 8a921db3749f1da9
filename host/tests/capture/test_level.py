"""The vertical of recordings that show no floor, from boxes whose vertical is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from capture_files import Recording, write_transforms
from click.testing import CliRunner
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy import ndimage
from scipy.spatial.transform import Rotation

from colonnade.capture.level import Levelling, level
from colonnade.capture.source import Frame, Lens
from colonnade.cli.main import cli
from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.environment.load import load_environment
from colonnade.scene.standing import Footprint, free_place

#: Boxes, least and largest corner, metres: a table with a box on it, without a floor, and walls before and beside it.
TABLE = [((-1.0, 0.7, -0.6), (1.0, 0.75, 0.6)), ((0.5, 0.75, -0.5), (0.8, 0.95, -0.2))]
FRONT, SIDE = ((-9.0, -9.0, -2.1), (9.0, 9.0, -2.0)), ((-2.6, -9.0, -9.0), (-2.5, 9.0, 9.0))
Boxes = Sequence[tuple[tuple[float, ...], tuple[float, ...]]]


def camera(position: Sequence[float], yaw: float, down: float, roll: float) -> Floats:
    """View space to world, float64 [4, 4]: towards -z, turned to the left, then down, then clockwise, degrees."""
    pose = np.eye(4)
    turn = Rotation.from_euler("YXZ", [yaw, -down, -roll], degrees=True).as_matrix()
    pose[:3, :3], pose[:3, 3] = turn @ np.diag([1.0, -1.0, -1.0]), position
    return pose


def frame(boxes: Boxes, pose: Floats, size: tuple[int, int] = (128, 96)) -> Frame:
    """What a camera sees of boxes, with noise of 0.3 %; where there is none, its depth is a hole."""
    width, height = size
    lens = Lens(0.9 * width, 0.9 * width, width / 2, height / 2)
    v, u = np.mgrid[0:height, 0:width] + 0.5
    seen = np.stack([(u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy, np.ones_like(u)], axis=2)
    rays, depth = seen @ pose[:3, :3].T, np.full((height, width), np.inf)
    for low, high in boxes:
        with np.errstate(divide="ignore"):
            slabs = (np.array([low, high])[:, None, None] - pose[:3, 3]) / rays
        near, far = slabs.min(axis=0).max(axis=2), slabs.max(axis=0).min(axis=2)
        depth = np.where((near < far) & (near > 0), np.minimum(depth, near), depth)
    error = ndimage.gaussian_filter(np.random.default_rng(1).standard_normal((height, width)), 1.0)
    depth = np.where(depth < 9, depth * (1.0 + 0.003 * error / error.std()), 0.0)
    return Frame(0, 0.0, np.full((height, width, 3), 128, np.uint8), depth, lens, pose[:3])


def off(levelling: Levelling, turn: Floats | None = None) -> float:
    """Degrees between the vertical that was found in a turned world and the boxes'."""
    true = np.array([0.0, 1.0, 0.0]) if turn is None else turn[:, 1]
    return float(np.degrees(np.arccos(np.clip(levelling.rotation[1] @ true, -1.0, 1.0))))


def turned(one: Frame, turn: Floats) -> Frame:
    return replace(one, to_world=turn @ one.to_world)


angles = {
    "yaws": st.lists(st.floats(-30, 30), min_size=2, max_size=4),
    "roll": st.floats(-14, 14),
    "world": st.tuples(*[st.floats(-180, 180)] * 3),
}


@settings(max_examples=25, deadline=None)
@given(down=st.floats(25, 60), **angles)
def test_a_table_gives_the_vertical(
    down: float, yaws: list[float], roll: float, world: tuple[float, float, float]
) -> None:
    """Cameras around it look at its middle, are rolled, and give none within their pitch."""
    turn = Rotation.from_euler("xyz", world, degrees=True).as_matrix()
    poses = []
    for yaw in yaws:
        pose = camera((0, 0, 0), yaw, down, roll)
        pose[:3, 3] = np.array([0.0, 0.75, 0.0]) - 1.3 * pose[:3, 2]
        poses.append(pose)
    found = level([turned(frame([*TABLE, FRONT], pose), turn) for pose in poses], None, "it")
    assert off(found, turn) < 1.0
    upright = found.rotation @ turn
    assert np.allclose(upright[:, 1], (0, 1, 0), atol=0.01)


@settings(max_examples=25, deadline=None)
@given(down=st.floats(-15, 45), has_side=st.booleans(), **angles)
@example(down=-7.0, has_side=False, yaws=[0.0, 27.0], roll=0.0, world=(0.0, 0.0, 0.0))
@example(down=42.0, has_side=False, yaws=[0.0, 0.0], roll=0.0, world=(0.0, 0.0, 0.0))
@example(down=29.0, has_side=False, yaws=[25.0, 29.0], roll=0.0, world=(0.0, 0.0, 0.0))
def test_walls_give_the_vertical(
    down: float, has_side: bool, yaws: list[float], roll: float, world: tuple[float, float, float]
) -> None:
    """Whatever the pitch, also of cameras that look up at a wall; the roll of cameras before a single wall is left.

    A wall that all cameras see from one side, at 25 degrees, costs up to 0.7 degrees by the noise of its depth.
    """
    turn = Rotation.from_euler("xyz", world, degrees=True).as_matrix()
    walls = [FRONT, SIDE] if has_side else [FRONT]
    frames = [frame(walls, camera((0, 1.5, 0), yaw + 40 * has_side, down, roll)) for yaw in yaws]
    found = level([turned(one, turn) for one in frames], None, "it")
    assert "cameras without roll" in found.note
    assert off(found, turn) < 1.1 * abs(roll) + 1.0


@pytest.mark.parametrize("roll", [4.0, -10.0])
def test_the_corner_of_two_walls_takes_the_roll_away(roll: float) -> None:
    poses = [camera((0, 1.5, 0), yaw, 10.0, roll) for yaw in (40, 50)]
    corner, wall = (level([frame(walls, pose) for pose in poses], None, "it") for walls in ([FRONT, SIDE], [FRONT]))
    assert off(corner) < 0.1 * abs(roll) < off(wall)


def test_no_surface_leaves_the_cameras() -> None:
    """A pitch of all cameras stays, for pictures alone do not tell it; a roll of one is spread over all."""
    rolls = (-6.0, 6.0, 0.0)
    frames = [frame([], camera((0, 0, 0), 5.0 * number, 0.0, roll)) for number, roll in enumerate(rolls)]
    found = level(frames, None, "it")
    assert off(found) < 6.0 and found.shift == 0.0
    down = level([frame([], camera((0, 0, 0), yaw, 30.0, 0.0)) for yaw in (-60, 0, 60)], None, "it")
    assert off(down) < 2.0  # their rights span the horizontal plane


def test_a_given_vertical_overrides() -> None:
    pose = camera((0, 1.6, 1.2), 0, 35, 0)
    up = np.array([0.0, 0.9, 0.3])
    found = level([frame(TABLE, pose)], up, "it")
    assert np.allclose(found.rotation[1], up / np.linalg.norm(up))
    assert found.note == "no floor was found: the lowest point that was seen is at height 0"
    assert level([frame([], pose)], up, "it").shift == 0.0


def test_cameras_without_a_common_up_are_refused() -> None:
    frames = [frame([FRONT], camera((0, 1.5, 0), 0, 0, roll)) for roll in (0, 180)]
    with pytest.raises(UserError, match=r"it shows no floor, and no direction is up in .* give what points up with"):
        level(frames, None, "it")


def test_an_object_stands_on_the_table_of_a_recording_without_a_floor(tmp_path: Path) -> None:
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_euler("xyz", [70, 20, -30], degrees=True).as_matrix()
    poses = [camera((0.1, 1.6, 1.1), 4, 38, 7)]
    one = frame([*TABLE, FRONT], poses[0], (320, 240))
    lens = one.lens
    recording = Recording(one.photo, one.depth, (lens.fx, lens.fy, lens.cx, lens.cy), [turn @ poses[0]])
    source, output = write_transforms(tmp_path, recording), tmp_path / "out"
    result = CliRunner().invoke(cli, ["capture", str(source), "--output", str(output)])
    assert result.exit_code == 0, result.output
    (note,) = [line for line in result.stderr.splitlines() if "vertical" in line]
    assert "the vertical is that of the largest level plane, on which" in note and "--up X,Y,Z gives another" in note
    room = load_environment(output / "0000")
    assert np.degrees(np.arccos(room.camera_to_world[1, :3] @ poses[0][1, :3])) < 0.5
    assert free_place(room, Footprint(0.12, 0.3)) is not None
