"""Captures of four formats, written to the published layouts from a room whose depth and cameras are known."""

from __future__ import annotations

import json
import weakref
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from capture_files import ROOMS, WRITERS, Recording, phone, png, room_recording, write_stray_scanner, write_transforms
from click.testing import CliRunner, Result
from PIL import Image
from scipy.spatial.transform import Rotation

from colonnade.capture import convert as conversion
from colonnade.capture import record3d
from colonnade.cli.main import cli
from colonnade.common import image_io
from colonnade.common.errors import UserError
from colonnade.environment.depth_normals import DepthNormals
from colonnade.environment.load import load_environment
from colonnade.environment.sequence import Sequence, load_sequence

#: A world in which no axis points up.
TURN = Rotation.from_euler("xyz", [70, 20, -30], degrees=True).as_matrix()
#: The lens of a TUM folder without the name of its camera.
TUM_LENS = (525.0, 525.0, 320.0, 240.0)


def run(source: Path, output: Path, *options: str) -> Result:
    return CliRunner().invoke(cli, ["capture", str(source), "--output", str(output), *options])


def converted(source: Path, output: Path, *options: str) -> tuple[Sequence, str]:
    result = run(source, output, *options)
    assert result.exit_code == 0, result.output
    return load_sequence(output / "sequence.toml"), result.stderr


def with_lens(recording: Recording, lens: tuple[float, float, float, float]) -> Recording:
    """The part of the pictures that a longer lens sees, by the nearest pixel."""
    height, width = recording.photo.shape[:2]
    fx, fy, cx, cy = recording.lens
    column = ((np.arange(width) + 0.5 - lens[2]) / lens[0] * fx + cx).astype(int)
    row = ((np.arange(height) + 0.5 - lens[3]) / lens[1] * fy + cy).astype(int)
    part = np.ix_(row, column)
    return replace(recording, photo=recording.photo[part], depth=recording.depth[part], lens=lens)


@pytest.fixture(scope="module")
def living() -> Recording:
    return room_recording("living", 3)


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without albedo and normals of rooms, which take seconds to derive."""
    from colonnade.environment import load

    monkeypatch.setattr(load, "derived_albedo", lambda room, light=None: np.full((room.height, room.width, 3), 0.5))
    monkeypatch.setattr(
        load,
        "normals_of_depth",
        lambda depth, *_: DepthNormals(np.broadcast_to([0.0, 0.0, -1.0], (*depth.shape, 3)), 0.0, 0, 0.0),
    )


def test_every_format_gives_poses_lens_and_depth(living: Recording, tmp_path: Path, quick: None) -> None:
    for name, write in WRITERS.items():
        recording = phone(living)
        if name == "tum":
            recording = with_lens(living, TUM_LENS)
        truth = recording
        recording = recording.turned_world(np.eye(3) if name == "stray" else TURN)  # its world is level
        sequence, notes = converted(write(tmp_path, recording), tmp_path / f"out-{name}")
        assert len(sequence) == 3
        assert ("degrees" in notes or "°" in notes) == (name != "stray")
        times = [frame.time for frame in sequence.content.frame]
        assert np.allclose(times, [0.0, 1 / 30, 2 / 30], atol=1e-4)
        for camera, pose in zip(sequence.cameras, living.poses, strict=True):
            assert np.allclose([camera.fx, camera.fy, camera.cx, camera.cy], truth.lens, atol=1e-3)
            # The vertical and the height are the room's; the direction about the vertical is free
            assert np.degrees(np.arccos(np.clip(camera.to_world[1, :3] @ pose[1, :3], -1, 1))) < 0.3, name
            assert abs(camera.to_world[1, 3] - pose[1, 3]) < 0.015, name
        for number in (1, 2):
            moved, true = (
                np.linalg.inv(np.vstack([first, [0, 0, 0, 1]])) @ np.vstack([second, [0, 0, 0, 1]])
                for first, second in (
                    (sequence.cameras[0].to_world, sequence.cameras[number].to_world),
                    (living.poses[0][:3], living.poses[number][:3]),
                )
            )
            assert np.allclose(moved, true, atol=2e-5), name
        room = sequence.room(2)
        full = truth.depth if name == "tum" else living.depth
        assert np.median(np.abs(room.depth / full - 1)) < 0.001, name
        assert (np.abs(room.depth - full) < 0.02 * full).mean() > 0.99, name
        assert room.photo is not None
        assert np.abs(room.photo.astype(int) - truth.photo).mean() < 3.0, name


def test_the_first_frame_is_a_room(living: Recording, tmp_path: Path) -> None:
    """Its derived maps are near the room's, and a command takes it."""
    output = tmp_path / "out"
    _, notes = converted(write_transforms(tmp_path, living), output, "--frames", "0-0")
    assert "there is no normal.png" in notes and "there is no albedo.png" in notes
    room, truth = load_environment(output / "0000"), load_environment(ROOMS / "living")
    assert room.notes == ()
    assert np.degrees(np.arccos((room.normals * truth.normals).sum(axis=2).clip(-1, 1))).mean() < 4.0
    assert room.photo is not None and np.array_equal(room.photo, truth.photo)
    result = CliRunner().invoke(cli, ["light", str(output / "0000"), "--lights", "0"])
    assert result.exit_code == 0, result.output
    assert "[ambient]" in result.stdout


def test_uncertain_depth_is_a_hole(living: Recording, tmp_path: Path, quick: None) -> None:
    """Of two levels of confidence below the highest."""
    recording = phone(living)
    confidence = np.full(recording.depth.shape, 2, np.uint8)
    confidence[:40], confidence[60:70, :50] = 1, 0
    for name in ("record3d", "stray"):
        source = WRITERS[name](tmp_path, replace(recording, confidence=confidence))
        converted(source, tmp_path / f"out-{name}")
        depth = np.asarray(Image.open(tmp_path / f"out-{name}" / "0000.depth.png"))
        assert not depth[:98].any() and not depth[152:172, :122].any()
        assert depth[104:148].all()


def test_frames_without_certain_depth_are_left_out(living: Recording, tmp_path: Path, quick: None) -> None:
    source = write_transforms(tmp_path, living)
    empty = np.zeros(living.depth.shape, np.uint16)
    (source / "depths" / "frame_00001.png").write_bytes(png(empty))
    sequence, notes = converted(source, tmp_path / "out")
    assert [frame.time for frame in sequence.content.frame] == [0.0, pytest.approx(2 / 30, abs=1e-5)]
    assert "1 of 3 frames were left out" in notes


def test_frames_are_chosen(living: Recording, tmp_path: Path, quick: None) -> None:
    recording = room_recording("living", 6)
    for write in (write_transforms, write_stray_scanner):
        source = write(tmp_path, phone(recording))
        sequence, _ = converted(source, tmp_path / write.__name__, "--every", "2", "--frames", "1-4")
        origin, true = recording.poses[1][:3, 3], recording.poses[3][:3, 3]
        assert len(sequence) == 2
        moved = sequence.cameras[1].to_world[:, 3] - sequence.cameras[0].to_world[:, 3]
        assert np.linalg.norm(moved) == pytest.approx(np.linalg.norm(true - origin), abs=1e-5)


def test_a_portrait_is_cropped_and_a_picture_on_its_side_is_turned(
    living: Recording, tmp_path: Path, quick: None
) -> None:
    """Points stay where they are in the world."""
    side = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # after a counter-clockwise turn
    fx, fy, cx, cy = living.lens
    first = living.poses[:1]
    poses = [np.vstack([np.column_stack([pose[:3, :3] @ side, pose[:3, 3]]), [0, 0, 0, 1]]) for pose in first]
    turned = Recording(np.rot90(living.photo), np.rot90(living.depth), (fy, fx, cy, 640 - cx), poses)
    source = write_stray_scanner(tmp_path, replace(turned, photo=np.ascontiguousarray(turned.photo)))
    sequence, notes = converted(source, tmp_path / "out")
    assert "turned by 270°" in notes
    room = sequence.room(0)
    assert np.allclose(sequence.cameras[0].to_world[:, :3], living.poses[0][:3, :3], atol=1e-4)
    assert (np.abs(room.depth - living.depth) < 0.02 * living.depth).mean() > 0.99
    portrait = Recording(living.photo[:, 140:500], living.depth[:, 140:500], (fx, fy, cx - 140, cy), first)
    sequence, _ = converted(write_transforms(tmp_path, portrait), tmp_path / "portrait")
    camera = sequence.cameras[0]
    scale = 640 / 360
    assert np.allclose([camera.fx, camera.cx, camera.cy], [fx * scale, (cx - 140) * scale, 240 + (cy - 240) * scale])
    wide = Recording(living.photo[60:420], living.depth[60:420], (fx, fy, cx, cy - 60), first)
    sequence, _ = converted(write_transforms(tmp_path / "wide", wide), tmp_path / "wide-out")
    camera = sequence.cameras[0]
    scale = 480 / 360
    assert np.allclose([camera.fx, camera.cx, camera.cy], [fx * scale, 320 + (cx - 320) * scale, (cy - 60) * scale])
    column = int(80 + 100 / scale)  # of the maps' column 100
    seen = sequence.room(0).depth[:, 100]
    true = living.depth[(60 + (np.arange(480) + 0.5) / scale).astype(int), column]
    assert np.median(np.abs(seen / true - 1)) < 0.005


def test_up_may_be_given(living: Recording, tmp_path: Path, quick: None) -> None:
    up = TURN @ np.array([0.0, 1.0, 0.0])
    source = write_transforms(tmp_path, living.turned_world(TURN))
    sequence, notes = converted(source, tmp_path / "out", "--up", ",".join(f"{value:.9f}" for value in up))
    assert np.allclose(sequence.cameras[0].to_world[1], living.poses[0][1], atol=0.015)
    assert "the floor is the largest low level plane" in notes


def test_the_noise_of_the_depth_is_found(living: Recording, tmp_path: Path, quick: None) -> None:
    for noise in (0.005, 0.01):
        source = write_transforms(tmp_path / str(noise), phone(living, noise))
        sequence, _ = converted(source, tmp_path / f"out-{noise}", "--frames", "0-0")
        assert 0.6 * noise < sequence.content.depth_noise < 1.1 * noise


def test_a_folder_that_is_not_empty_stays(living: Recording, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine").write_text("kept")
    result = run(write_transforms(tmp_path, living), tmp_path / "out")
    assert (result.exit_code, result.stderr) == (
        2,
        f"colonnade: error: {tmp_path}/out is not empty: name a new folder\n",
    )
    assert (tmp_path / "out" / "mine").read_text() == "kept"


def test_a_sequence_is_checked(tmp_path: Path) -> None:
    row = "[1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 1.5], [0.0, 0.0, -1.0, 0.0]"
    frame = '[[frame]]\ntime = 0.0\nphoto = "a.png"\ndepth = "b.png"\nfx = 60.0\nfy = 60.0\ncx = 32.0\ncy = 24.0\n'
    frame += f"cam_to_world = [{row}]\n"
    good = f"width = 64\nheight = 48\n{frame}"
    folder = tmp_path / "folder"
    folder.mkdir()
    (tmp_path / "outside.png").touch()
    (folder / "link.png").symlink_to("../outside.png")
    (folder / "circle.png").symlink_to("circle.png")
    file = folder / "sequence.toml"
    file.write_text(good)
    assert len(load_sequence(file)) == 1
    changes: dict[str, Callable[[str], str]] = {
        "frame.0.time is missing": lambda text: text.replace("time = 0.0\n", ""),
        "unknown key frame.0.speed": lambda text: text + "speed = 1.0\n",
        "width: ": lambda text: text.replace("width = 64", "width = 64000"),
        "times of its frames must ascend": lambda text: text + frame,
        r"frame 0, names \.\./a\.png: a file must lie in the folder": lambda text: text.replace("a.png", "../a.png"),
        "names link.png: a file must lie in the folder": lambda text: text.replace("a.png", "link.png"),
        "names circle.png: a file must lie in the folder": lambda text: text.replace("b.png", "circle.png"),
        "depth_step must be the metres per step of depth pictures, 1e-06 to 1000": lambda text: (
            "depth_step = 1e-300\n" + text
        ),
        "unit, at right angles": lambda text: text.replace("[1.0, 0.0", "[2.0, 0.0"),
        "is not TOML": lambda text: text + "[[",
        "a focal length": lambda text: text.replace("fx = 60.0", "fx = 0.0"),
        "frame is missing": lambda text: "width = 64\nheight = 48\n",
    }
    for says, change in changes.items():
        file.write_text(change(good))
        with pytest.raises(UserError, match=says):
            load_sequence(file)
    file.write_text(good)
    with pytest.raises(UserError, match=r"no picture .*a\.png"):
        load_sequence(file).room(0)


def test_what_cannot_be_loaded_replaces_nothing(
    living: Recording, tmp_path: Path, quick: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(path: Path) -> Sequence:
        assert path.is_file()
        raise UserError("sequence sequence.toml is wrong")

    monkeypatch.setattr(conversion, "load_sequence", refused)
    result = run(write_transforms(tmp_path, phone(living)), tmp_path / "out")
    assert result.exit_code == 2 and "gives no sequence that can be read: sequence sequence.toml is" in result.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("mark", [b"\xef\xbb\xbf", b"\xff\xfe"], ids=["utf-8", "utf-16"])
def test_text_may_begin_with_a_mark_of_its_encoding(living: Recording, tmp_path: Path, mark: bytes) -> None:
    for name in ("stray", "tum"):
        source = WRITERS[name](tmp_path, phone(living))
        expected = [frame.time for frame in conversion.source_of(source).frames([0, 1, 2])]
        for file in (*source.glob("*.txt"), *source.glob("*.csv")):
            text = file.read_text()
            file.write_bytes(mark + text.encode("utf-8" if mark[0] == 0xEF else "utf-16-le"))
        assert [frame.time for frame in conversion.source_of(source).frames([0, 1, 2])] == expected


def with_times(source: Path, change: Callable[[float], str]) -> None:
    """Change the times in the lists of a TUM folder."""
    for name in ("rgb.txt", "depth.txt", "groundtruth.txt"):
        lines = [line.split() for line in (source / name).read_text().splitlines() if not line.startswith("#")]
        (source / name).write_text("\n".join(" ".join([change(float(time)), *rest]) for time, *rest in lines) + "\n")


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")])
def test_times_of_a_tum_folder_in_another_unit_are_named(
    living: Recording, tmp_path: Path, factor: float, unit: str
) -> None:
    source = WRITERS["tum"](tmp_path, phone(living))
    with_times(source, lambda time: f"{time * factor:.0f}")
    with pytest.raises(UserError, match=rf"rgb\.txt are \S+ apart, as of {unit}: they must be seconds"):
        conversion.source_of(source)
    with_times(source, lambda time: f"{time - time % (factor / 30):.0f}")
    assert f"as of {unit}: they must be seconds" in conversion.source_of(source).outline.notes[0]


def test_one_frame_at_a_time_is_in_memory(
    living: Recording, tmp_path: Path, quick: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    photos: list[weakref.ref[Any]] = []
    pixels = image_io.rgb_pixels

    def watched(picture: Image.Image) -> Any:
        assert all(photo() is None for photo in photos)
        photo = pixels(picture).copy()
        photos.append(weakref.ref(photo))
        return photo

    monkeypatch.setattr(image_io, "rgb_pixels", watched)
    monkeypatch.setattr(record3d, "rgb_pixels", watched)
    for name in ("record3d", "tum", "transforms"):
        result = run(WRITERS[name](tmp_path, phone(living)), tmp_path / f"out-{name}")
        assert result.exit_code == 0, result.output
    # Three frames for the floor, the same three for the sequence, and the room's photo
    assert len(photos) == 3 * 7


def test_the_report(living: Recording, tmp_path: Path, quick: None) -> None:
    report = tmp_path / "report.json"
    converted(write_transforms(tmp_path, living), tmp_path / "out", "--frames", "1-1", "--json", str(report))
    data = json.loads(report.read_text())
    assert data["format"] == "nerfstudio" and data["frames"] == 1 and data["size"] == [640, 480]
    assert conversion.ROOM == "0000"
