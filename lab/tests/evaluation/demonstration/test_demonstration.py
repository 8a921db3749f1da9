"""The demonstration: its camera, photos, and what it measures of a frame."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from colonnade.design.generator import design_for
from colonnade.environment.sequence import load_sequence
from colonnade.scene.parser import load_scene
from live_maps import SMALL_MAPS

from colonnade_lab.evaluation.demonstration import measure, moved, walk
from colonnade_lab.evaluation.demonstration.measure import FrameCost
from colonnade_lab.evaluation.studies.synthetic_attic import RoomModel, attic_parts, write_attic
from colonnade_lab.report.live_page import MEGAHERTZ, Energy, Moved, Way, figures, page

SIZE = (96, 72)
SINGLE = ("array.rows=1", "array.columns=1", *SMALL_MAPS)


def test_the_camera_loops_by_30_centimetres_and_10_degrees() -> None:
    poses = [walk.camera_of(number / walk.FRAMES, *SIZE).to_world for number in range(walk.FRAMES)]
    first = poses[0]
    np.testing.assert_allclose(first, walk.camera_of(1.0, *SIZE).to_world, atol=1e-12)
    aside = np.array([(pose[:, 3] - first[:, 3]) @ first[:, 0] for pose in poses])
    turns = np.degrees([np.arctan2(pose[:, 2] @ first[:, 0], pose[:, 2] @ first[:, 2]) for pose in poses])
    for values, maximum in ((aside, 0.3), (turns, 10.0)):
        assert values.max() == pytest.approx(maximum, rel=0.15) and values.min() == pytest.approx(-maximum, rel=0.15)
    assert max(np.linalg.norm(b[:, 3] - a[:, 3]) for a, b in itertools.pairwise(poses)) < 0.03


def test_photos_have_soft_edges_and_exact_maps() -> None:
    model, camera = RoomModel("attic", attic_parts()), walk.camera_of(0.3, *SIZE)
    view, hard = walk.attic_view(model, camera, *SIZE), model.seen_by(camera, *SIZE)
    np.testing.assert_array_equal(view.depth, hard.depth)
    assert view.photo is not None and hard.photo is not None
    assert len(np.unique(view.photo.reshape(-1, 3), axis=0)) > 1.2 * len(np.unique(hard.photo.reshape(-1, 3), axis=0))
    assert np.abs(view.photo.astype(int) - hard.photo).mean() < 25


@pytest.mark.parametrize("rtl", [[], pytest.param([1], marks=pytest.mark.matrix)])
def test_costs_of_frames(tmp_path: Path, rtl: list[int]) -> None:
    sequence = load_sequence(walk.write_walk(tmp_path, SIZE, 3))
    (tmp_path / "scene.toml").write_text(walk.walk_scene(*SIZE))
    scene = load_scene(tmp_path / "scene.toml")
    frames: list[np.ndarray] = []
    demonstration = measure.Demonstration(sequence, scene, design_for("small", SINGLE), 2, rtl)
    costs = measure.run(demonstration, 2, frames.append)
    assert [frame.shape for frame in frames] == [(72, 96, 3)] * 3
    assert [cost.encode_ms > 0 for cost in costs] == [cost.load_cycles > 0 for cost in costs] == [True, False, True]
    assert [cost.registers_ms is None for cost in costs] == [False, True, False]
    assert [cost.cycles is not None for cost in costs] == [number in rtl for number in range(3)]
    assert all(cost.differing == 0 and cost.rays_in_box > 0 for cost in costs)
    assert costs[1].march_steps > costs[0].march_steps, "primary rays march between keyframes"


def test_the_page_adds_up(tmp_path: Path) -> None:
    costs = [FrameCost(30.0, 0.1, 40_000, 1000, 5), FrameCost(0.0, None, 0, 3000, 5, 200_000)]
    found = figures(costs, Energy(1.5, "docs/data/x.json"))
    assert found["load"] == pytest.approx(20_000 / (1e3 * MEGAHERTZ)) and found["frame"] == pytest.approx(1.0)
    assert found["device"] == pytest.approx(0.1 + 0.1 + 1.0) and found["live"] == pytest.approx(15.0 + 1.2)
    assert found["microjoules"] == pytest.approx(3.0)
    assert figures(costs[:1], Energy(1.5, ""))["device"] is None, "no frame of the RTL, no sum"
    (tmp_path / "a.mp4").write_bytes(b"film")
    text = page([Way(2, costs, tmp_path / "a.mp4")], (640, 480), 30.0, ["A <note>."], Energy(1.5, ""))
    assert "data:video/mp4;base64,ZmlsbQ==" in text and "A &lt;note&gt;." in text and "200,000" in text
    assert "http" not in text.replace("http-equiv", ""), "it loads nothing"


@pytest.mark.parametrize("rtl", [[], pytest.param([1], marks=pytest.mark.matrix)])
def test_costs_of_frames_of_objects_that_move(tmp_path: Path, rtl: list[int]) -> None:
    """Before a camera that moves, in maps of each frame."""
    ball = 'mesh = {name = "sphere:2"}\n'
    text = f"[[object]]\n{ball}transform = {{scale = 0.15, translate = [0.1, 0.9, 0.0]}}\n"
    text += "motion = {translate = [0.4, 0.1, 0.0]}\n"
    text += f'[[object]]\n{ball}transform = {{scale = 0.15, translate = [0.5, 0.3, 0.6]}}\nmaterial.kind = "mirror"\n'
    text += '[background]\nroom = "attic"\n[camera]\nposition = [0.9, 1.55, 2.5]\ntarget = [0.2, 0.72, -0.4]\n'
    text += "[[motion.camera]]\nposition = [0.7, 1.5, 2.3]\n[light]\nposition = [0.6, 2.2, 0.6]\n"
    text += "[paths]\ngather = 1\n[frame]\nsamples = 2\n"
    (tmp_path / "scene.toml").write_text(text)
    write_attic(tmp_path / "attic", *SIZE)
    frames: list[np.ndarray] = []
    scene, design = load_scene(tmp_path / "scene.toml"), design_for("small", SINGLE)
    path = moved.cameras(scene, SIZE, 3)
    np.testing.assert_allclose([camera.to_world[:, 3] for camera in path[::2]], [[0.9, 1.55, 2.5], [0.7, 1.5, 2.3]])
    forward = path[0].to_world[:, 2]
    np.testing.assert_allclose(np.cross(forward, [-0.7, -0.83, -2.9]), 0.0, atol=1e-12)
    sequence = load_sequence(walk.write_sequence(tmp_path / "path", SIZE, path))
    triangles, bent, costs = moved.run(scene, sequence, design, frames.append, rtl)
    assert triangles > 0 and bent == 0 and [frame.shape for frame in frames] == [(72, 96, 3)] * 3
    assert not np.array_equal(frames[0], frames[2])
    assert [cost.cycles is not None for cost in costs] == [number in rtl for number in range(3)]
    assert all(cost.differing == 0 and cost.rays_in_box > 0 and cost.refit_ms > 0 for cost in costs)
    assert all(cost.encode_ms > 0 and cost.load_cycles > 0 for cost in costs)


def test_the_page_has_the_objects(tmp_path: Path) -> None:
    (tmp_path / "a.mp4").write_bytes(b"film")
    costs = [
        moved.MovedCost(4, 9.0, 2.0, 50_000, 1000, 3000, 5),
        moved.MovedCost(4, 9.0, 4.0, 150_000, 3000, 7000, 5, 100_000),
    ]
    objects = Moved(9000, 6000, costs, tmp_path / "a.mp4", 30.0)
    found = objects.figures(Energy(1.5, ""))
    assert found["triangles"] == pytest.approx(2000.0) and found["nodes"] == pytest.approx(2.5)
    assert found["worst_nodes"] == pytest.approx(3.0) and found["frame"] == pytest.approx(2.0)
    assert found["load"] == pytest.approx(0.5) and found["encode"] == pytest.approx(9.0)
    assert found["rate"] == pytest.approx(400.0) and found["millijoules"] == pytest.approx(0.012)
    text = page([], (640, 480), 30.0, [], Energy(1.5, ""), objects)
    assert (
        "data:video/mp4;base64,ZmlsbQ==" in text
        and "9,000 triangles" in text
        and "100,000" in text
        and ">8,000<" in text
    )
