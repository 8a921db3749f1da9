"""Loading rooms: the project's rooms are read exactly; flaws of captured rooms are repaired or rejected in one line."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray
from PIL import Image

from colonnade.cli.main import cli
from colonnade.common.errors import UserError
from colonnade.common.srgb import srgb_from_linear
from colonnade.environment.load import load_environment

ROOMS = Path(__file__).resolve().parents[3] / "scenes" / "rooms"
SIZE = (64, 48)
POSE = [[1, 0, 0, 0.5], [0, -1, 0, 1.2], [0, 0, -1, 2], [0, 0, 0, 1]]


def camera_directions() -> NDArray[np.float64]:
    width, height = SIZE
    x, y = np.meshgrid(np.arange(width) + 0.5 - width / 2, np.arange(height) + 0.5 - height / 2)
    return np.stack([x / 50, y / 50, np.ones_like(x)], axis=-1)


def corner() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Depth and view-space normals of a floor 1.2 m below a level camera and a wall 3 m in front of it."""
    y = camera_directions()[..., 1]
    floor = y > 1.2 / 3
    depth = np.where(floor, 1.2 / np.where(floor, y, 1), 3.0)
    return depth, np.where(floor[..., np.newaxis], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0])


def coded(normals: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.rint((normals * 0.5 + 0.5) * 255).astype(np.uint8)


@pytest.fixture
def environment(tmp_path: Path) -> Path:
    """The folder of a small room: the corner in grey, without a photo."""
    folder = tmp_path / "corner"
    folder.mkdir()
    depth, normals = corner()
    width, height = SIZE
    meta = {"fx": 50, "fy": 50, "cx": width / 2, "cy": height / 2, "cam_to_world": POSE, "albedo_encoding": "linear"}
    (folder / "meta.json").write_text(json.dumps(meta))
    Image.fromarray(np.full((height, width, 3), 102, np.uint8)).save(folder / "albedo.png")
    Image.fromarray(coded(normals)).save(folder / "normal.png")
    np.save(folder / "depth.npy", depth)
    return folder


def change_meta(environment: Path, **values: object) -> None:
    file = environment / "meta.json"
    data = json.loads(file.read_text()) | values
    file.write_text(json.dumps({key: value for key, value in data.items() if value is not None}))


@pytest.mark.parametrize(("name", "ceiling"), [("living", 2.7), ("office", 2.6)])
def test_the_rooms_of_the_project(name: str, ceiling: float) -> None:
    environment = load_environment(ROOMS / name)
    assert (environment.width, environment.height, environment.has_depth, environment.notes) == (640, 480, True, ())
    assert environment.photo is not None and environment.photo.shape == (480, 640, 3)
    # Pose, depth and the sign of each axis: floor and ceiling are level in the world
    assert np.linalg.det(environment.camera_to_world[:, :3]) > 0.999
    assert environment.camera_to_world[0, 0] > 0.98
    world = environment.points() @ environment.camera_to_world[:, :3].T + environment.camera_to_world[:, 3]
    assert abs(world[..., 1].min()) < 0.002
    assert abs(world[..., 1].max() - ceiling) < 0.002
    up = environment.normals @ environment.camera_to_world[1, :3]
    assert world[..., 1][up < -0.99].mean() > ceiling - 0.3
    assert (world[..., 1][up > 0.99] < 1.6).all()


def test_normals_agree_with_depth() -> None:
    environment = load_environment(ROOMS / "living")
    points = environment.points()
    across, down = points[1:-1, 2:] - points[1:-1, :-2], points[2:, 1:-1] - points[:-2, 1:-1]
    facing = np.cross(down, across)
    facing /= np.linalg.norm(facing, axis=2, keepdims=True)
    cosine = np.einsum("yxc,yxc->yx", facing, environment.normals[1:-1, 1:-1])
    assert np.median(cosine) > 0.999
    assert np.mean(cosine > 0.95) > 0.93


def test_the_photo_tells_how_albedo_is_encoded(tmp_path: Path) -> None:
    folder = tmp_path / "living"
    shutil.copytree(ROOMS / "living", folder)
    change_meta(folder, albedo_encoding=None)
    linear = load_environment(folder)
    assert "taken as linear" in linear.notes[0]
    Image.fromarray(np.rint(srgb_from_linear(linear.albedo) * 255).astype(np.uint8)).save(folder / "albedo.png")
    curve = load_environment(folder)
    assert "taken as srgb" in curve.notes[0]
    assert np.abs(curve.albedo - linear.albedo).max() < 0.005
    (folder / "render.png").unlink()
    assert np.array_equal(load_environment(folder).albedo, curve.albedo)


def test_depth_pictures_of_16_bits(environment: Path) -> None:
    depth, _ = corner()
    (environment / "depth.npy").unlink()
    Image.fromarray(np.rint(depth * 1000).astype(np.uint16)).save(environment / "depth.png")
    assert np.abs(load_environment(environment).depth - depth).max() <= 0.0005 + 1e-9
    change_meta(environment, depth_step=0.002)
    assert np.abs(load_environment(environment).depth - 2 * depth).max() <= 0.001 + 1e-9


def test_grey_and_16_bit_albedo(environment: Path) -> None:
    width, height = SIZE
    Image.fromarray(np.full((height, width), 102, np.uint8)).save(environment / "albedo.png")
    assert np.allclose(load_environment(environment).albedo, 0.4)
    Image.fromarray(np.full((height, width), 26214, np.uint16)).save(environment / "albedo.png")
    assert np.allclose(load_environment(environment).albedo, 0.4)


def test_a_grey_photo_of_8_or_16_bits_keeps_its_grey(environment: Path) -> None:
    width, height = SIZE
    for dtype, value in ((np.uint8, 102), (np.uint16, 102 * 257)):
        Image.fromarray(np.full((height, width), value, dtype)).save(environment / "photo.png")
        photo = load_environment(environment).photo
        assert photo is not None and photo.shape == (height, width, 3) and (photo == 102).all()


def test_a_photo_that_its_exif_data_rotate_is_noted(environment: Path) -> None:
    height, width = load_environment(environment).depth.shape
    exif = Image.Exif()
    for value, count in ((1, 0), (3, 1)):
        exif[0x0112] = value
        Image.new("RGB", (width, height)).save(environment / "photo.png", exif=exif)
        noted = [note for note in load_environment(environment).notes if "EXIF data rotate" in note]
        assert len(noted) == count


def test_holes_take_their_neighbours_depth(environment: Path) -> None:
    depth, _ = corner()
    for k, nothing in enumerate((0.0, -1.0, np.nan, np.inf, 1e-300, 1e300)):
        depth[5 + k, 7 : 7 + 3] = nothing
    np.save(environment / "depth.npy", depth)
    loaded = load_environment(environment)
    assert loaded.notes == ("18 of 3,072 pixels had no depth and were filled from their neighbours",)
    assert np.allclose(loaded.depth, corner()[0])


def test_a_few_bad_normals_are_repaired(environment: Path) -> None:
    _, normals = corner()
    normals[3, 4:9] = 0
    normals[20] *= 1.05
    Image.fromarray(coded(np.clip(normals, -1, 1))).save(environment / "normal.png")
    loaded = load_environment(environment)
    assert np.abs(np.linalg.norm(loaded.normals, axis=2) - 1).max() < 1e-9
    assert loaded.notes == ("5 normals were not unit vectors and were replaced by their neighbours'",)
    assert np.abs(loaded.normals - corner()[1]).max() < 0.01


def test_depth_from_normals_finds_wall_and_floor(environment: Path) -> None:
    (environment / "depth.npy").unlink()
    loaded = load_environment(environment)
    assert not loaded.has_depth
    assert "no depth map" in loaded.notes[0] and "1.20 m below the camera" in loaded.notes[0]
    error = np.abs(loaded.depth / corner()[0] - 1)
    assert np.median(error) < 0.03
    assert np.percentile(error, 95) < 0.05
    assert np.allclose(load_environment(environment, camera_height=2.4).depth, 2 * loaded.depth)


def test_depth_from_normals_of_a_furnished_room(tmp_path: Path) -> None:
    folder = tmp_path / "living"
    shutil.copytree(ROOMS / "living", folder)
    (folder / "depth.png").unlink()
    truth = load_environment(ROOMS / "living").depth
    assert np.median(np.abs(load_environment(folder).depth / truth - 1)) < 0.06


def break_file(name: str, content: bytes) -> Callable[[Path], None]:
    return lambda environment: (environment / name).write_bytes(content) and None


def remove(*names: str) -> Callable[[Path], None]:
    def change(environment: Path) -> None:
        for name in names:
            (environment / name).unlink()

    return change


def resize(name: str) -> Callable[[Path], None]:
    return lambda environment: Image.open(environment / name).resize((32, 24)).save(environment / name)


def meta(**values: object) -> Callable[[Path], None]:
    return lambda environment: change_meta(environment, **values)


def save(name: str, array: NDArray[np.generic]) -> Callable[[Path], None]:
    if name.endswith(".npy"):
        return lambda environment: np.save(environment / name, array)
    return lambda environment: Image.fromarray(array).save(environment / name)


HOLES = np.zeros((48, 64))
TILTED = np.array([[-1, 0, 0, 0], [0, 2, 0, 1], [0, 0, -1, 0]])


@pytest.mark.parametrize(
    ("picture", "message"),
    [
        (np.full((48, 64), 90, np.uint8), "depth.png has 8 bits per pixel, too few for depth"),
        (np.zeros((48, 64), np.uint16), "3,072 of 3,072 pixels have no depth"),
    ],
)
def test_uniform_depth_pictures_are_rejected(environment: Path, picture: NDArray[np.generic], message: str) -> None:
    (environment / "depth.npy").unlink()
    Image.fromarray(picture).save(environment / "depth.png")
    with pytest.raises(UserError, match=message):
        load_environment(environment)


def test_float_pictures_are_rejected(environment: Path) -> None:
    """A float picture does not define white."""
    Image.fromarray(np.full((48, 64), 0.4, np.float32)).save(environment / "albedo.png", format="TIFF")
    with pytest.raises(UserError, match=r"albedo\.png is not a readable picture: give a PNG"):
        load_environment(environment)


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (remove("meta.json"), "there is no .*meta.json"),
        (break_file("meta.json", b"{"), "meta.json is not JSON"),
        (break_file("meta.json", b"[]"), "must contain a JSON object"),
        (meta(fx=None), "lacks fx"),
        (meta(fx="wide"), "fx must be a finite number"),
        (meta(fy=0), "fy is 0, a focal length must be more than 0"),
        (meta(cam_to_world=None), "lacks cam_to_world"),
        (meta(cam_to_world=[1, 2]), "4 rows of 4 finite numbers"),
        (meta(cam_to_world=TILTED.tolist()), "at right angles and right-handed"),
        (meta(width=640), "is 64x48 pixels, but .*meta.json says width 640"),
        (meta(albedo_encoding="gamma"), "albedo_encoding must be linear or srgb"),
        (meta(depth_step=9e-7), "meta.json: depth_step must be the metres per step of depth pictures, 1e-06 to 1000"),
        (meta(depth_step=1001), "depth_step must be the metres per step of depth pictures, 1e-06 to 1000"),
        (remove("albedo.png"), "lacks albedo.png"),
        (remove("normal.png", "depth.npy"), "lacks normal.png"),
        (break_file("albedo.png", b"no picture"), "albedo.png is not a readable picture"),
        (break_file("depth.npy", b"no array"), "depth.npy is not a readable array"),
        (save("depth.npy", np.ones((48, 64, 3))), "one number per pixel"),
        (save("depth.npy", np.ones((24, 32))), r"depth.npy is 32x24 pixels, but albedo.png is 64x48"),
        (resize("normal.png"), r"normal.png is 32x24 pixels, but albedo.png is 64x48"),
        (save("depth.npy", HOLES), "3,072 of 3,072 pixels have no depth"),
        (save("normal.png", np.zeros((48, 64, 3), np.uint8)), "normals are not unit vectors"),
        (save("normal.png", np.full((48, 64), 128, np.uint8)), "3,072 of 3,072 normals are not unit vectors"),
        (save("normal.png", 255 - coded(corner()[1])), "normals face away from the camera"),
    ],
)
def test_refusals(environment: Path, damage: Callable[[Path], None], message: str) -> None:
    damage(environment)
    with pytest.raises(UserError, match=message):
        load_environment(environment)


def test_photo_depth_and_pose_alone_are_a_room(tmp_path: Path) -> None:
    """Normals and albedo are derived, with a note for each."""
    truth = load_environment(ROOMS / "attic")
    folder = tmp_path / "attic"
    shutil.copytree(ROOMS / "attic", folder)
    remove("albedo.png", "normal.png")(folder)
    Image.open(folder / "photo.png").save(folder / "photo.jpg", quality=99)
    remove("photo.png")(folder)
    room = load_environment(folder)
    assert [note for note in room.notes if "no normal.png" in note]
    assert [note for note in room.notes if "no albedo.png" in note]
    assert np.degrees(np.arccos((room.normals * truth.normals).sum(axis=2).clip(-1, 1))).mean() < 1.5
    assert np.median(np.abs(room.albedo - truth.albedo)) < 0.1
    assert room.photo is not None
    # Under the lights that were fitted, the albedo shows the photo
    from colonnade.environment.fitted_lights import fitted_lights

    assert fitted_lights(room).psnr > 30.0


def test_normals_alone_are_derived(environment: Path) -> None:
    """Of the corner, whose planes are known; its floor is lower than a window."""
    remove("normal.png")(environment)
    found = load_environment(environment)
    _, truth = corner()
    assert (np.abs(found.normals - truth).max(axis=2) < 0.01).mean() > 0.91
    assert any("normals are those of the depth map" in note for note in found.notes)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("step", [1e-6, 1e-3, 1e3])
def test_normals_are_finite_whatever_the_step_of_depth(environment: Path, step: float) -> None:
    remove("normal.png", "depth.npy")(environment)
    change_meta(environment, depth_step=step)
    steps = np.random.default_rng(1).choice(np.array([1, 2, 1000, 65535], np.uint16), (SIZE[1], SIZE[0]))
    for depth in (steps, np.ones_like(steps), np.sort(steps)):
        Image.fromarray(depth).save(environment / "depth.png")
        assert np.isfinite(load_environment(environment).normals).all()


@pytest.mark.filterwarnings("error")
def test_normals_are_finite_whatever_the_depth(environment: Path) -> None:
    """Far surfaces beside near ones are lost in rounding."""
    remove("normal.png")(environment)
    random = np.random.default_rng(1)
    for near in (1e-6, 1e-300, 1.0):
        depth = np.where(random.random((SIZE[1], SIZE[0])) < 0.4, near, 1e8)
        np.save(environment / "depth.npy", depth)
        assert np.isfinite(load_environment(environment).normals).all()


def test_a_room_without_photo_and_albedo_is_refused(environment: Path) -> None:
    remove("albedo.png")(environment)
    with pytest.raises(UserError, match=r"lacks albedo\.png: it needs meta\.json, albedo\.png or a photo"):
        load_environment(environment)


def test_a_colour_picture_is_not_depth(environment: Path) -> None:
    (environment / "depth.npy").unlink()
    Image.fromarray(np.random.default_rng(1).integers(0, 255, (48, 64, 3), dtype=np.uint8)).save(
        environment / "depth.png"
    )
    with pytest.raises(UserError, match="colours or transparency"):
        load_environment(environment)


def test_inspect_shows_the_loss_of_encoding(environment: Path, tmp_path: Path) -> None:
    output, report = tmp_path / "maps", tmp_path / "report.json"
    arguments = [
        "inspect",
        "--background",
        str(environment),
        "--output",
        str(output),
        "--no-dists",
        "--json",
        str(report),
    ]
    result = CliRunner().invoke(cli, arguments)
    assert result.exit_code == 0, result.output
    assert "16,384 bytes" in result.output
    figures = json.loads(report.read_text())
    assert figures["bytes"] == {"albedo": 16384, "normals": 16384, "planes": 12288}
    assert figures["albedo"]["dists"] is None
    assert figures["planes"]["median_cm"] < 0.1
    kinds = ("before", "after", "difference")
    names = {f"{name}-{kind}.png" for name in ("albedo", "normals", "depth", "relit") for kind in kinds}
    assert {file.name for file in output.iterdir()} == names | {"planes.png"}
    assert Image.open(output / "depth-after.png").size == SIZE


def test_no_folder(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="there is no room"):
        load_environment(tmp_path / "nowhere")
