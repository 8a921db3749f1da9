"""Frames of a motion: each equals the single frame of its pose on all backends; their output files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from colonnade_lab.evaluation.studies.synthetic_attic import write_attic
from hypothesis import given, settings
from hypothesis import strategies as st
from live_maps import SMALL_MAPS
from numpy.typing import NDArray
from PIL import Image

from colonnade.cli.main import cli
from colonnade.common.errors import UserError
from colonnade.environment.load import load_environment
from colonnade.mesh.load import load_mesh
from colonnade.render.frames import render, render_frames
from colonnade.render.request import RenderRequest
from colonnade.render.result import RenderResult
from colonnade.scene.model import MeshSource, Motion, Scene
from colonnade.scene.object_pose import Placed, rotation_about
from colonnade.scene.parser import load_scene
from colonnade.scene.prepared import device_scene
from colonnade.scene.view import make_view

SIZE = (32, 24)

ALONE = """
mesh.name = "teapot:2"
camera.position = [2.0, 3.0, 8.0]
"""
STANDING = """
mesh.name = "teapot:2"
background = {{room = "rooms/attic", colours = "{colours}"}}
object = {{stand_at = {stand_at}, size = 0.6, turn = {turn}}}
material.kind = "mirror"
paths.bounces = 1
light = {{position = {light}, falloff = 1.5}}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("motion")
    write_attic(folder / "rooms" / "attic", 96, 72)
    return folder


def scene_file(folder: Path, text: str, motion: str = "") -> Path:
    file = folder / "scene.toml"
    file.write_text(text + motion)
    return file


def standing(
    turn: float = 10.0,
    stand_at: tuple[float, ...] = (48, 43),
    light: tuple[float, ...] = (0.6, 2.2, 0.6),
    colours: str = "albedo",
) -> str:
    return STANDING.format(turn=turn, stand_at=list(stand_at), light=list(light), colours=colours)


def same(one: RenderResult, other: RenderResult) -> bool:
    pairs = ((one.image, other.image), (one.hit_triangles, other.hit_triangles), (one.t, other.t))
    return all(np.array_equal(a, b, equal_nan=a.dtype.kind == "f") for a, b in pairs)


def in_environment(file: Path, backend: str, frames: int) -> list[RenderResult]:
    return list(render_frames(RenderRequest(file, "small", SMALL_MAPS, backend, (96, 72), frames, samples=1)))


@pytest.mark.parametrize("backend", ["model", "reference"])
def test_each_frame_equals_the_single_frame_of_its_pose(folder: Path, backend: str) -> None:
    motion = "[motion]\nturn = 60.0\nstand_at = [60, 45.5]\nlight = [-1.0, 2.0, 0.6]\n"
    frames = in_environment(scene_file(folder, standing(), motion), backend, 3)
    assert [frame.report.share for frame in frames] == [0.0, 0.5, 1.0]
    (first,) = in_environment(scene_file(folder, standing()), backend, 1)
    (last,) = in_environment(scene_file(folder, standing(70.0, (60, 45.5), (-1.0, 2.0, 0.6))), backend, 1)
    assert same(frames[0], first) and same(frames[2], last)
    assert not same(frames[0], frames[1]) and not same(frames[1], frames[2])


def test_without_a_motion_the_object_turns_once(folder: Path) -> None:
    frames = in_environment(scene_file(folder, standing()), "model", 4)
    for index, frame in enumerate(frames):
        turned = scene_file(folder, standing(10.0 + 90.0 * index))
        assert same(frame, render(RenderRequest(turned, "small", SMALL_MAPS, "model", (96, 72), samples=1)))


@pytest.mark.parametrize(
    ("text", "motion"),
    [
        (ALONE, "motion.camera = [{position = [1.0, 3.0, 8.0]}]\n"),
        (ALONE, "motion.translate = [1.0, 0.0, 0.0]\n"),
        (standing(), "motion.light = [1.0, 2.0, 0.6]\n"),
        (standing(), "motion.stand_at = [60, 45.5]\n"),
    ],
)
def test_an_object_turns_by_itself_only_where_nothing_else_moves(folder: Path, text: str, motion: str) -> None:
    extent, room = load_mesh("teapot:2").extent, load_environment(folder / "rooms" / "attic")

    def rotations(motion: str) -> list[NDArray[np.float64]]:
        scene = load_scene(scene_file(folder, text, motion))
        return [Placed(scene.at(share), extent, room if text != ALONE else None).pose.rotation for share in (0.0, 0.3)]

    np.testing.assert_array_equal(*rotations(motion))
    for turning in ("", "motion.shutter = 0.5\n", f"motion.turn = 360.0\n{motion}"):
        assert not np.allclose(*rotations(turning))


def test_one_frame_is_the_plain_one(folder: Path) -> None:
    file = scene_file(folder, ALONE, "[motion]\nturn = 90.0\ntranslate = [1.0, 0.0, 0.0]\n")
    (only,) = render_frames(RenderRequest(file, "tiny", (), "model", SIZE, 1))
    assert same(only, render(RenderRequest(scene_file(folder, ALONE), "tiny", (), "model", SIZE)))


def test_the_scene_is_packed_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    packed: list[object] = []
    whole = device_scene.pack_objects
    monkeypatch.setattr(device_scene, "pack_objects", lambda *given: packed.append(given) or whole(*given))
    assert len(list(render_frames(RenderRequest(scene_file(folder, ALONE), "tiny", (), "model", SIZE, 5)))) == 5
    assert len(packed) == 1


@given(frames=st.integers(1, 200), turn=st.sampled_from([360.0, -720.0, 90.0]))
def test_frames_are_evenly_spaced(frames: int, turn: float) -> None:
    shares = Scene(MeshSource("cube"), motion=Motion(turn=turn)).frame_progress(frames)
    assert len(shares) == frames and shares[0] == 0.0
    np.testing.assert_allclose(np.diff(shares), shares[1] if frames > 1 else 0.0, atol=1e-12)
    if frames > 1:
        # A periodic motion omits its end, which equals its start.
        assert shares[-1] == (1.0 if turn == 90.0 else (frames - 1) / frames)


@settings(max_examples=50)
@given(share=st.floats(0, 1), degrees=st.floats(-720, 720), up=st.sampled_from([(0, 1, 0), (0, 0, 1), (1, 2, -1)]))
def test_a_turned_object_keeps_its_middle_and_its_vertical(
    share: float, degrees: float, up: tuple[float, float, float], tmp_path_factory: pytest.TempPathFactory
) -> None:
    text = ALONE + f"camera.up = {list(up)}\ntransform = {{rotate = [10.0, 20.0, 30.0], scale = 2.0}}\n"
    file = scene_file(tmp_path_factory.getbasetemp(), text, f"[motion]\nturn = {degrees}\n")
    scene, extent = load_scene(file), load_mesh("teapot:2").extent
    start, turned = Placed(scene, extent).pose, Placed(scene.at(share), extent).pose
    np.testing.assert_allclose(turned.to_world(extent.centre), start.to_world(extent.centre), atol=1e-9)
    rotation = rotation_about(up, degrees * share)
    np.testing.assert_allclose(turned.rotation, rotation @ start.rotation, atol=1e-12)
    np.testing.assert_allclose(rotation @ up, up, atol=1e-12)
    assert np.isclose(np.trace(rotation), 1 + 2 * np.cos(np.radians(degrees * share)))


def test_camera_and_lights_stay_where_they_are(folder: Path) -> None:
    """A framing camera and a light near the object do not follow its motion."""
    motion = "[motion]\ntranslate = [3.0, 0.0, 1.0]\nturn = 45.0\n"
    scene, mesh = load_scene(scene_file(folder, 'mesh.name = "teapot:2"\n', motion)), load_mesh("teapot:2")
    start, end = (make_view(Placed(scene.at(share), mesh.extent), *SIZE) for share in (0.0, 1.0))
    poses = [Placed(scene.at(share), mesh.extent).pose for share in (0.0, 1.0)]
    np.testing.assert_allclose(poses[0].to_world(start.origin), poses[1].to_world(end.origin), atol=1e-9)
    np.testing.assert_allclose(poses[0].to_world(start.light), poses[1].to_world(end.light), atol=1e-9)
    assert not np.allclose(start.origin, end.origin)


@pytest.mark.parametrize(
    ("text", "motion", "message"),
    [
        (ALONE, "[motion]\n", r"\[motion\] moves nothing: give turn"),
        (ALONE, "[motion]\nturn = 'far'\n", "motion.turn must be a number"),
        (ALONE, "[motion]\nspeed = 2\n", "unknown key motion.speed"),
        (ALONE, "[motion]\nlight = [1, 2, 3]\n", "give light.position"),
        (ALONE, "[motion]\nstand_at = [1, 2]\n", "stands in a room: give motion.translate"),
        (standing(), "[motion]\nstand_at = [1]\n", "motion.stand_at must be two numbers"),
        (standing(), "[motion]\nstand_at = [96, 2]\n", r"motion.stand_at is \(96, 2\), outside the maps of room attic"),
        (standing(), "[motion]\ntranslate = [1, 2, 3]\n", "give motion.stand_at"),
    ],
)
def test_an_invalid_motion_is_one_line(folder: Path, text: str, motion: str, message: str) -> None:
    file = scene_file(folder, text, motion)
    environment = load_environment(folder / "rooms" / "attic") if "rooms/attic" in text else None
    with pytest.raises(UserError, match=message):
        _ = Placed(load_scene(file), load_mesh("teapot:2").extent, environment).pose


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, [str(argument) for argument in arguments])


def picture(path: Path) -> NDArray[np.uint8]:
    with Image.open(path) as opened:
        return np.asarray(opened.convert("RGB"))


def test_files_of_several_frames(folder: Path, tmp_path: Path) -> None:
    common = ("render", scene_file(folder, ALONE), "--config", "tiny", "--backend", "model", "--size", "32x24")
    more = ("--hits", tmp_path / "h.npz", "--json", tmp_path / "r.json")
    result = run(*common, "--frames", 3, "--output", tmp_path / "out.png", *more)
    assert result.exit_code == 0, result.output
    assert "3 frames" in result.output
    assert sorted(file.name for file in tmp_path.iterdir()) == [
        *(f"h_000{index}.npz" for index in range(3)),
        *(f"out_000{index}.png" for index in range(3)),
        "r.json",
    ]
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["rays"]["primary"] == 3 * 32 * 24 and report["size"] == [32, 24]
    assert [frame["share"] for frame in report["frames"]] == pytest.approx([0, 1 / 3, 2 / 3])
    assert report["rays"]["in_box"] == sum(frame["rays"]["in_box"] for frame in report["frames"])

    assert run(*common, "--output", tmp_path / "plain.png").exit_code == 0
    assert (tmp_path / "plain.png").read_bytes() == (tmp_path / "out_0000.png").read_bytes()
    assert run(*common, "--frames", 3, "--output", tmp_path / "film.webp").exit_code == 0
    with Image.open(tmp_path / "film.webp") as film:
        assert film.n_frames == 3
        for index in range(3):
            film.seek(index)
            np.testing.assert_array_equal(np.asarray(film.convert("RGB")), picture(tmp_path / f"out_000{index}.png"))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--frames", 0), "--frames"),
        (("--frames", "many"), "--frames"),
        (("--frames", 2, "--output", "f.gif"), "FILE.png for numbered files, or FILE.webp"),
        (("--frames", 2, "--output", "nowhere/f.png"), "nowhere is not a folder"),
    ],
)
def test_wrong_frames_are_one_line(tmp_path: Path, options: tuple[object, ...], message: str) -> None:
    result = run("render", scene_file(tmp_path, ALONE), *options)
    assert result.exit_code == 2
    assert message in result.stderr and len(result.stderr.splitlines()) == 1
