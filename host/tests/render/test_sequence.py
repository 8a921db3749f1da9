"""An object in the frames of a moving camera: it stays in the world, and each frame is its room's."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from colonnade_lab.evaluation.studies.generated_rooms import generated_room
from colonnade_lab.evaluation.studies.synthetic_attic import DEPTH_STEP, write_room
from live_maps import SMALL_MAPS
from PIL import Image

from colonnade.capture.video import frames_of_video
from colonnade.cli.main import cli
from colonnade.common import extras
from colonnade.common.accumulation import Accumulation
from colonnade.common.errors import UserError
from colonnade.common.image_io import encode_srgb
from colonnade.common.progress import Progress
from colonnade.design.generator import manifest_for
from colonnade.device.bit_exact import render_model
from colonnade.environment.derived_albedo import derived_albedo, hue_lights
from colonnade.environment.load import load_environment
from colonnade.environment.sequence import load_sequence
from colonnade.maps.encoded import layout_of
from colonnade.maps.image import AttributeImage
from colonnade.maps.live import STILL_ROUNDS, LiveEncoder, LiveFrame
from colonnade.mesh.load import load_mesh
from colonnade.render import sequence_frames as module
from colonnade.render.composite import composited
from colonnade.render.frames import render, render_frames
from colonnade.render.host_frame import HostFrame
from colonnade.render.request import RenderRequest
from colonnade.render.result import RenderResult
from colonnade.scene.model import Transform
from colonnade.scene.object_pose import Placed
from colonnade.scene.parser import load_scene
from colonnade.scene.prepared.device_scene import DeviceScene

SIZE, VIEWS, STEP, NOISE = (96, 72), 3, 0.2, 0.004
#: One unit, and an attribute memory for maps of this size.
ROOM = ("array.rows=1", "array.columns=1", *SMALL_MAPS)
SCENE = """
mesh.name = "teapot:3"
object.size = 0.5
material.kind = "mirror"
paths.bounces = 1
background.colours = "{colours}"
light = {{offset = [1.0, 1.5, 0.5]}}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sequence whose frames are the rooms in folders of their numbers."""
    folder = tmp_path_factory.mktemp("sequence")
    lines = [f"width = {SIZE[0]}\nheight = {SIZE[1]}\nrate = 12.5\ndepth_step = {DEPTH_STEP}\ndepth_noise = {NOISE}"]
    for number in range(VIEWS):
        room = generated_room(4, *SIZE, walked=STEP * number).environment
        write_room(folder / f"{number}", room)
        names = {"photo": "photo", "depth": "depth", "albedo": "albedo", "normal": "normal"}
        lines += ["[[frame]]", f"time = {number / 12.5}"]
        lines += [f'{key} = "{number}/{name}.png"' for key, name in names.items()]
        lines += [f"{key} = {getattr(room, key)}" for key in ("fx", "fy", "cx", "cy")]
        lines += [f"cam_to_world = {room.camera_to_world.tolist()}"]
    (folder / "sequence.toml").write_text("\n".join(lines) + "\n")
    for colours in ("albedo", "photo"):
        (folder / f"{colours}.toml").write_text(SCENE.format(colours=colours))
    return folder


def request_of(folder: Path, colours: str, backend: str = "model") -> RenderRequest:
    sequence = load_sequence(folder / "sequence.toml")
    request = RenderRequest(folder / f"{colours}.toml", "small", ROOM, samples=1, sequence=sequence, frames=VIEWS)
    return replace(request, backend=backend, size=SIZE, encoder="live")  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def frames(folder: Path) -> list[RenderResult]:
    return list(render_frames(request_of(folder, "albedo")))


def test_the_first_frame_is_the_still_of_its_room(folder: Path, frames: list[RenderResult]) -> None:
    still = replace(request_of(folder, "albedo"), sequence=None, frames=1, background=folder / "0")
    # The sequence's noise is a sensor's, and a still has exact depth: only the tolerance of planes differs
    exact = load_sequence(folder / "sequence.toml")
    exact.content = replace(exact.content, depth_noise=0.0)
    (first,) = render_frames(replace(request_of(folder, "albedo"), sequence=exact, frames=1))
    np.testing.assert_array_equal(render(still).image, first.image)
    assert not np.array_equal(first.image, frames[0].image)


def test_a_frame_is_the_still_of_its_room_with_the_object_in_the_world(
    folder: Path, frames: list[RenderResult]
) -> None:
    """The maps come from an encoder that has seen the frames before."""
    manifest = manifest_for("small", ROOM).manifest
    rooms = [load_environment(folder / str(number)) for number in range(VIEWS)]
    first = DeviceScene.of(load_scene(folder / "albedo.toml", folder), manifest, room=rooms[0], encoder="live").scene
    mesh = load_mesh("teapot:3")
    pose = Placed(first, mesh.extent, rooms[0]).pose
    x, y, z = pose.translate
    centre, edge = pose.to_world(mesh.extent.centre), mesh.extent.edge * pose.scale
    axes = rooms[0].camera_to_world[:, :3] * [1, -1, -1]
    lamp = centre + edge * (axes @ np.array([1.0, 1.5, 0.5]))
    transform = Transform(scale=pose.scale, translate=(x, y, z))
    light = replace(first.light, position=tuple(lamp.tolist()))
    scene = replace(first, placement=None, transform=transform, light=light)

    encoder = LiveEncoder(layout_of(manifest), NOISE)
    for number, room in enumerate(rooms):
        images: list[AttributeImage] = []
        for _ in range(1 if number else STILL_ROUNDS):
            images.append(encoder.encode(LiveFrame.of(room)).image)
        prepared = DeviceScene.of(scene, manifest, room=room, encode=lambda room, image=images[-1]: image)
        frame = render_model(manifest, prepared.image, prepared.registers(SIZE, composited=True))
        assert prepared.environment is not None
        expected = composited(Accumulation.of_frame(frame), prepared.photo)
        np.testing.assert_array_equal(frames[number].object_mask, frame.is_object)
        np.testing.assert_array_equal(encode_srgb(frames[number].image), encode_srgb(expected))


def test_the_object_stays_where_it_is_while_the_camera_moves(folder: Path, frames: list[RenderResult]) -> None:
    sequence = load_sequence(folder / "sequence.toml")
    scene = DeviceScene.of(
        load_scene(folder / "albedo.toml", folder),
        manifest_for("small", ROOM).manifest,
        room=sequence.room(0),
        encoder="live",
    ).scene
    extent = load_mesh("teapot:3").extent
    centre = Placed(scene, extent, sequence.room(0)).pose.to_world(extent.centre)
    places = []
    for camera, frame in zip(sequence.cameras, frames, strict=True):
        seen = (centre - camera.to_world[:, 3]) @ camera.to_world[:, :3]
        expected = seen[:2] / seen[2] * (camera.fx, camera.fy) + (camera.cx, camera.cy)
        rows, columns = np.nonzero(frame.object_mask)
        places.append((columns.mean() + 0.5, rows.mean() + 0.5))
        np.testing.assert_allclose(places[-1], expected, atol=2.0)
    assert np.ptp([place[0] for place in places]) > 6, "the camera moves"
    assert [frame.report.time for frame in frames] == pytest.approx([0.0, 0.08, 0.16])


@pytest.mark.parametrize("keyframes", [1, 2])
def test_an_object_and_a_light_move_while_the_camera_does(
    folder: Path, keyframes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between two pixels of the first frame, in the world."""
    text = SCENE.format(colours="albedo").replace("offset = [1.0, 1.5, 0.5]", "position = [0.5, 2.2, 0.5]")
    way = "object.stand_at = [36, 66]\nmotion = {stand_at = [64, 64], light = [-0.5, 2.2, 0.5], turn = 90.0}\n"
    (folder / "moved.toml").write_text(text + way)
    seen: list[HostFrame] = []
    rendered = module.rendered
    monkeypatch.setattr(module, "rendered", lambda *given: seen.extend(given[1]) or rendered(*given))
    found = list(render_frames(replace(request_of(folder, "moved"), keyframes=keyframes)))
    sequence, extent = load_sequence(folder / "sequence.toml"), load_mesh("teapot:3").extent
    scene, room = load_scene(folder / "moved.toml", folder), sequence.room(0)
    for share, camera, frame, result in zip((0.0, 0.5, 1.0), sequence.cameras, seen, found, strict=True):
        pose = Placed(scene.at(share), extent, room).pose
        centre = (pose.to_world(extent.centre) - camera.to_world[:, 3]) @ camera.to_world[:, :3]
        expected = centre[:2] / centre[2] * (camera.fx, camera.fy) + (camera.cx, camera.cy)
        rows, columns = np.nonzero(result.object_mask)
        np.testing.assert_allclose((columns.mean() + 0.5, rows.mean() + 0.5), expected, atol=2.0)
        (light,) = frame.prepared.view(SIZE, frame.passes[0]).lights
        np.testing.assert_allclose(pose.to_world(light.position), (0.5 - share, 2.2, 0.5), atol=1e-9)
        assert result.report.share == share


def test_colours_of_the_photo_keep_the_light_of_the_first_frame(folder: Path) -> None:
    """The object's registers do not change: only the room does."""
    manifest = manifest_for("small", ROOM).manifest
    rooms = [load_environment(folder / str(number)) for number in range(2)]
    encoder = LiveEncoder(layout_of(manifest))

    def encode(room: object) -> AttributeImage:
        return encoder.encode(LiveFrame.of(room)).image  # type: ignore[arg-type]

    first = DeviceScene.of(load_scene(folder / "photo.toml", folder), manifest, room=rooms[0], encode=encode)
    second = first.seen_in(rooms[1], encode)
    assert first.scene.headroom > 1 and second.scene.headroom == first.scene.headroom
    one, other = (prepared.registers(SIZE) for prepared in (first, second))
    fixed = [
        name for name in one if name.startswith(("materials", "lights[0].colour", "lights[0].position", "ambient"))
    ]
    shift = one["frame.unitShift"] - other["frame.unitShift"]
    assert shift == 0 and {name: one[name] for name in fixed} == {name: other[name] for name in fixed}
    assert any(one[name] != other[name] for name in one if name.startswith("camera"))
    np.testing.assert_array_equal(first.image.records, second.image.records)
    assert second.environment is not None and not np.array_equal(second.environment.albedo, rooms[1].albedo)


def test_albedos_that_a_sequence_lacks_have_one_light(folder: Path) -> None:
    text = (folder / "sequence.toml").read_text()
    (folder / "photos.toml").write_text("\n".join(line for line in text.splitlines() if not line.startswith("albedo")))
    known, lacking = load_sequence(folder / "sequence.toml"), load_sequence(folder / "photos.toml")
    light = hue_lights(known.room(0))
    for number in (2, 0):
        room = lacking.room(number)
        np.testing.assert_array_equal(room.albedo, derived_albedo(known.room(number), light))
        assert np.array_equal(room.albedo, derived_albedo(known.room(number))) is (number == 0)


def test_between_keyframes_a_frame_has_its_camera_and_photo_and_the_maps_before(
    folder: Path, frames: list[RenderResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[tuple[DeviceScene, dict[str, int]]] = []
    rendered = module.rendered

    def watched(request: RenderRequest, own: list[HostFrame], registers: list[Any], progress: Progress) -> Any:
        seen.append((own[0].prepared, registers[0][0]))
        return rendered(request, own, registers, progress)

    monkeypatch.setattr(module, "rendered", watched)
    request, sequence = request_of(folder, "albedo"), load_sequence(folder / "sequence.toml")
    found = list(render_frames(replace(request, keyframes=2)))
    assert [values["environment.isMapCamera"] for _, values in seen] == [1, 0, 1]
    assert seen[1][0].image is seen[0][0].image and seen[2][0].image is not seen[0][0].image
    np.testing.assert_array_equal(found[0].image, frames[0].image)
    # The object is where it is with maps of its own; the picture is the frame's own photo, but for its shadow
    assert (found[1].object_mask != frames[1].object_mask).sum() <= 2
    for number, frame in enumerate(found):
        room = ~frame.object_mask
        own, other = (encode_srgb(frame.image)[room] == sequence.photo(each)[room] for each in (number, number - 1))
        assert own.all(axis=1).mean() > 0.7 and other.all(axis=1).mean() < 0.5
    shadows = [
        (encode_srgb(one[1].image) != sequence.photo(1)).any(axis=2) & ~one[1].object_mask for one in (found, frames)
    ]
    assert (shadows[0] & shadows[1]).sum() > 0.7 * (shadows[0] | shadows[1]).sum() > 50


def test_a_camera_of_a_capture_has_any_pose_and_lens(folder: Path) -> None:
    """Rolled, with its centre aside: the rays of a frame between keyframes are its camera's."""
    text = re.sub(
        r"^(cx|fy) = (.*)$",
        lambda found: f"{found[1]} = {1.1 * float(found[2])}",
        (folder / "sequence.toml").read_text(),
        flags=re.M,
    )
    (folder / "aside.toml").write_text(text)
    sequence = load_sequence(folder / "aside.toml")
    camera = sequence.cameras[1]
    turn = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    camera = replace(camera, to_world=np.column_stack([camera.to_world[:, :3] @ turn, camera.to_world[:, 3]]))
    prepared = DeviceScene.of(
        load_scene(folder / "albedo.toml", folder),
        manifest_for("small", ROOM).manifest,
        room=sequence.room(0),
        encoder="live",
    )
    view = prepared.seen_by(camera, None).view(SIZE)
    pose = Placed(prepared.scene, prepared.image.header.extent, sequence.room(0)).pose
    np.testing.assert_allclose(view.origin, pose.to_mesh(camera.to_world[:, 3]), atol=1e-9)
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    rays = view.direction + x[..., None] * view.step_x + y[..., None] * view.step_y
    np.testing.assert_allclose(rays, camera.directions(*SIZE) @ camera.to_world[:, :3].T @ pose.rotation, atol=1e-9)


@pytest.mark.matrix
@pytest.mark.parametrize("keyframes", [1, 2])
def test_the_hardware_renders_the_frames_of_the_model(folder: Path, keyframes: int) -> None:
    common = {"size": (32, 24), "frames": 2, "keyframes": keyframes}
    small = [replace(request_of(folder, "albedo", backend), **common) for backend in ("rtl", "model")]  # type: ignore[arg-type]
    for rtl, model in zip(*map(render_frames, small), strict=True):
        np.testing.assert_array_equal(rtl.image, model.image)
        np.testing.assert_array_equal(rtl.object_mask, model.object_mask)
        assert rtl.report.counters["hits"] == model.report.counters["hits"] > 0


def run(folder: Path, *arguments: object) -> Result:
    settings = [word for each in ROOM for word in ("--set", each)]
    backend = () if "--backend" in arguments else ("--backend", "model")
    common = ("render", folder / "albedo.toml", "--config", "small", *settings, *backend, "--size", "96x72")
    return CliRunner().invoke(cli, [str(argument) for argument in (*common, "--samples", 1, *arguments)])


def test_files_of_a_sequence(folder: Path, tmp_path: Path, frames: list[RenderResult]) -> None:
    outputs = ("--output", tmp_path / "f.png", "--video", tmp_path / "v.mp4", "--json", tmp_path / "r.json")
    result = run(folder, "--sequence", folder / "sequence.toml", *outputs)
    assert result.exit_code == 0 and "3 frames" in result.output, result.output
    assert sorted(file.name for file in tmp_path.iterdir()) == [*(f"f_000{n}.png" for n in range(3)), "r.json", "v.mp4"]
    pictures = [np.asarray(Image.open(tmp_path / f"f_000{number}.png")) for number in range(VIEWS)]
    for decoded, frame, picture in zip(
        frames_of_video(tmp_path / "v.mp4", range(VIEWS)), frames, pictures, strict=True
    ):
        np.testing.assert_array_equal(picture, encode_srgb(frame.image))
        assert decoded.shape == picture.shape
        assert np.abs(decoded.astype(int) - picture).mean() < 6
    report = json.loads((tmp_path / "r.json").read_text())
    assert [one["time"] for one in report["frames"]] == pytest.approx([0.0, 0.08, 0.16])
    assert [one["counters"]["hits"] for one in report["frames"]] == [frame.object_mask.sum() for frame in frames]
    assert all(one["seconds"]["maps"] > 0 for one in report["frames"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--sequence", "none.toml"), "sequence none.toml does not exist"),
        (("--sequence", "FILE", "--frames", 4), "has 3 frames, fewer than the 4 of --frames"),
        (("--sequence", "FILE", "--background", "FOLDER/0"), "both replace the scene's background"),
        (("--sequence", "FILE", "--backend", "reference"), "--sequence is for the rtl and the model backend"),
        (("--sequence", "FILE", "--set", "physicalAttributeMemory.width=64"), "set its width and height"),
        (("--keyframes", 2), "--keyframes needs --sequence"),
        (("--video", "v.mp4"), "--video needs --frames or --sequence"),
        (("--frames", 2, "--video", "v.avi"), "is written as MP4"),
    ],
)
def test_what_does_not_go_with_a_sequence_is_one_line(
    folder: Path, arguments: tuple[object, ...], message: str
) -> None:
    named = [
        str(each).replace("FILE", str(folder / "sequence.toml")).replace("FOLDER", str(folder)) for each in arguments
    ]
    result = run(folder, *named)
    assert result.exit_code == 2 and message in " ".join(re.sub("[│╭╮╰╯─]", " ", result.output).split()), result.output


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("[camera]\nposition = [0.0, 1.0, 2.0]\n", "each frame of a sequence has its own camera: leave out [camera]"),
        ("[[motion.camera]]\nposition = [0.0, 1.0, 2.0]\n", "leave out [[motion.camera]]"),
    ],
)
def test_a_scene_has_no_camera_in_a_sequence(folder: Path, table: str, message: str) -> None:
    (folder / "moving.toml").write_text((folder / "albedo.toml").read_text() + table)
    moved = CliRunner().invoke(
        cli, ["render", str(folder / "moving.toml"), "--backend", "model", "--sequence", str(folder / "sequence.toml")]
    )
    assert moved.exit_code == 2 and message in " ".join(moved.output.split())


def test_a_sequence_chooses_its_keyframes(folder: Path) -> None:
    text = (folder / "sequence.toml").read_text()
    (folder / "keyframes.toml").write_text("maps.every = 2\n" + text)
    result = run(folder, "--sequence", folder / "keyframes.toml", "--frames", 2)
    assert result.exit_code == 0 and result.stderr.count("between keyframes") == 1
    every = run(folder, "--sequence", folder / "keyframes.toml", "--frames", 2, "--keyframes", 1)
    assert every.exit_code == 0 and "between keyframes" not in every.stderr
    (folder / "keyframes.toml").write_text("maps.every = 0\n" + text)
    with pytest.raises(UserError, match=r"maps\.every"):
        load_sequence(folder / "keyframes.toml")


def test_without_its_package_a_video_is_refused_before_work(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    find = extras.find_spec
    monkeypatch.setattr(extras, "find_spec", lambda name: None if name == "imageio_ffmpeg" else find(name))
    result = run(folder, "--sequence", folder / "sequence.toml", "--video", tmp_path / "v.mp4")
    assert result.exit_code == 2 and "pip install 'colonnade[capture]'" in result.output
    assert not list(tmp_path.iterdir())


def test_a_video_of_an_odd_size_has_a_black_line_more(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text('mesh.name = "teapot:2"\nbackground.colour = [0.5, 0.5, 0.5]\n')
    common = ("render", tmp_path / "scene.toml", "--config", "tiny", "--backend", "model", "--size", "31x23")
    outputs = ("--output", tmp_path / "f.webp", "--video", tmp_path / "v.mp4")
    result = CliRunner().invoke(cli, [str(each) for each in (*common, "--frames", 2, *outputs)])
    assert result.exit_code == 0, result.output
    (first, _) = frames_of_video(tmp_path / "v.mp4", range(2))
    with Image.open(tmp_path / "f.webp") as film:
        picture = np.asarray(film.convert("RGB"))
    assert first.shape == (24, 32, 3)
    assert np.abs(first[:22, :30].astype(int) - picture[:22, :30]).mean() < 6
    assert first[23].max() < 60
