"""Unusual scenes in a room: a correct picture, or one line with advice."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from colonnade_lab.evaluation.studies.synthetic_attic import write_attic
from live_maps import SMALL_MAPS

from colonnade.cli.main import cli
from colonnade.common.image_io import encode_srgb
from colonnade.environment.load import load_environment
from colonnade.mesh.load import load_mesh
from colonnade.quality.image_metrics import psnr
from colonnade.render.frames import render
from colonnade.render.request import RenderRequest
from colonnade.render.result import RenderResult
from colonnade.scene.object_pose import Placed
from colonnade.scene.parser import load_scene

SIZE = (96, 72)

IN_ATTIC = 'mesh.name = "teapot:4"\nbackground.room = "attic"\n'
STANDING = IN_ATTIC + "object = {stand_at = [48, 43], size = 0.6}\n"
LAMP = "light = {position = [0.6, 2.2, 0.6], falloff = 1.5}\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scenes")
    write_attic(folder / "attic", *SIZE)
    return folder


def both(folder: Path, text: str) -> tuple[RenderResult, RenderResult]:
    """The frames of the model and of the reference."""
    (folder / "scene.toml").write_text(text)
    model = render(
        RenderRequest(folder / "scene.toml", "small", SMALL_MAPS, "model", SIZE, relit=True, encoder="offline")
    )
    return model, render(RenderRequest(folder / "scene.toml", "small", SMALL_MAPS, "reference", SIZE, relit=True))


def assert_alike(model: RenderResult, reference: RenderResult) -> None:
    np.testing.assert_array_equal(model.object_mask, reference.object_mask)
    assert np.isfinite(reference.image).all()
    # Encoding limits this small attic to 32 dB, and views through glass to 28 dB
    assert psnr(encode_srgb(reference.image), encode_srgb(model.image)) > 25


@pytest.mark.parametrize(
    ("transform", "pixels"),
    [
        ("translate = [0.0, 1.0, 9.0], scale = 0.1", 0),  # behind the camera
        ("translate = [30.0, 1.0, -3.0], scale = 0.1", 0),  # beside the picture
        ("translate = [0.0, 1.0, 0.0], scale = 3.0", SIZE[0] * SIZE[1]),  # around the camera
    ],
)
def test_an_object_out_of_view_and_one_around_the_camera(folder: Path, transform: str, pixels: int) -> None:
    model, reference = both(folder, IN_ATTIC + LAMP + f"background.occlusion = false\ntransform = {{{transform}}}\n")
    assert model.object_mask.sum() == pixels
    assert_alike(model, reference)


@pytest.mark.parametrize("turn", [(-1, 1, -1), (1, -1, -1)])
def test_the_pose_of_the_camera_does_not_change_its_maps(folder: Path, turn: tuple[int, int, int]) -> None:
    """The maps are in view space for any pose of the camera, even upside down, where the object is in the floor."""
    shutil.copytree(folder / "attic", folder / "turned", dirs_exist_ok=True)
    meta = json.loads((folder / "attic" / "meta.json").read_text())
    meta["cam_to_world"] = (np.array(meta["cam_to_world"]) @ np.diag([*turn, 1])).tolist()
    (folder / "turned" / "meta.json").write_text(json.dumps(meta))
    turned = load_environment(folder / "turned")
    x, y, z = turned.camera_to_world[:, :3] @ turned.points()[43, 48] + turned.camera_to_world[:, 3]
    place = f"transform = {{translate = [{x}, {y}, {z}], scale = 0.2}}\nbackground.occlusion = false\n"
    model, reference = both(folder, IN_ATTIC.replace("attic", "turned") + LAMP + place)
    assert model.object_mask.any()
    assert_alike(model, reference)


LIGHTS = {
    "inside the object": lambda pose, mesh, environment: pose.to_world(mesh.extent.centre),
    "at a vertex": lambda pose, mesh, environment: pose.to_world(mesh.vertices[100]),
    "at the camera": lambda pose, mesh, environment: environment.camera_to_world[:, 3],
    "on a wall": lambda pose, mesh, environment: (
        environment.camera_to_world[:, :3] @ environment.points()[40, 30] + environment.camera_to_world[:, 3]
    ),
    "behind the wall": lambda pose, mesh, environment: np.array([0.6, 1.0, -30.0]),
    "below the floor": lambda pose, mesh, environment: np.array([0.6, -1.0, -2.0]),
    "behind the camera": lambda pose, mesh, environment: np.array([0.6, 1.0, 30.0]),
}


@pytest.mark.parametrize("kind", ["diffuse", "mirror", "glass"])
@pytest.mark.parametrize("place", LIGHTS)
def test_a_light_anywhere(folder: Path, place: str, kind: str) -> None:
    (folder / "scene.toml").write_text(STANDING)
    mesh, environment = load_mesh("teapot:4"), load_environment(folder / "attic")
    where: Callable[..., np.ndarray] = LIGHTS[place]
    position = where(
        Placed(load_scene(folder / "scene.toml"), mesh.extent, environment).pose, mesh, environment
    ).tolist()
    text = STANDING + f'light = {{position = {position}, falloff = 0.5}}\nmaterial.kind = "{kind}"\n'
    model, reference = both(folder, text)
    assert model.object_mask.any()
    assert_alike(model, reference)


@pytest.mark.parametrize("falloff", [1e-6, 1e6])
def test_no_light_and_saturating_light(folder: Path, falloff: float) -> None:
    lamp = f"light = {{position = [0.6, 2.2, 0.6], falloff = {falloff}, colour = [15, 15, 15]}}\n"
    model, reference = both(folder, STANDING + lamp)
    assert_alike(model, reference)
    assert (np.median(model.image) > 0.9) == (falloff > 1)


def test_the_default_placement_is_on_the_visible_surface(folder: Path) -> None:
    model, reference = both(folder, IN_ATTIC + LAMP)
    assert 10 < model.object_mask.sum() < 1000
    assert_alike(model, reference)


THREE = LAMP.replace("light = ", "[[light]]\n").replace("{", "").replace("}", "").replace(", falloff", "\nfalloff") * 3


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        (STANDING.replace("attic", "nowhere"), (), "there is no room .*nowhere: name a folder with meta.json"),
        (STANDING.replace("attic", "attic/meta.json"), (), "there is no room .*meta.json: name a folder"),
        (STANDING + LAMP, ("--config", "tiny"), "no memory for a room: set physicalAttributeMemory"),
        (STANDING, ("--config", "small"), "are 96x72, physicalAttributeMemory holds 640x480: set its width and height"),
        (STANDING, ("--size", "96x96"), "96x96 pixels does not have the proportions of room attic"),
        (STANDING + THREE, (), "the scene has 3 lights, the hardware supports 2: leave some out or raise frame.lights"),
        (
            STANDING + LAMP + 'material.kind = "glass"\npaths.bounces = 9\n',
            (),
            "lower paths.bounces or raise frame.maxBounces",
        ),
        (STANDING.replace("0.6", "0.001") + LAMP, (), "the camera is .* edges away, .*: make the object larger"),
        (
            STANDING + "ambient.colour = [1, 1, 1]\nlight.position = [0.0, 1e6, 0.0]\n",
            (),
            "light 1 is .* edges away, .*: move it nearer",
        ),
        (STANDING.replace("[48, 43]", "[96, 43]"), (), r"object.stand_at is \(96, 43\), outside the maps"),
        (STANDING.replace("[48, 43]", "[nan, 43]"), (), "object.stand_at must be two numbers"),
        (STANDING + "camera.fov = 30\n", (), "the camera is the room's: give camera.position"),
    ],
)
def test_what_cannot_be_is_one_line(
    folder: Path, tmp_path: Path, text: str, options: tuple[str, ...], message: str
) -> None:
    (folder / "scene.toml").write_text(text)
    sets = [word for override in (*SMALL_MAPS, "frame.gather=false") for word in ("--set", override)]
    hardware = () if "--config" in options else ("--config", "small", *sets)
    common = ["render", str(folder / "scene.toml"), "--backend", "model", *hardware, *options]
    result = CliRunner().invoke(cli, [*common, "--output", str(tmp_path / "f.png")])
    assert result.exit_code == 2, result.output
    assert len(result.stderr.splitlines()) == 1
    assert re.search(message, result.stderr), result.stderr
    assert not list(tmp_path.iterdir())
