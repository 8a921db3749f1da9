"""The light of a scene in a room, in frames of the model and of the reference."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import FrameType

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from colonnade_lab.evaluation.studies.synthetic_attic import attic, write_attic
from live_maps import SMALL_MAPS

from colonnade.cli.main import cli
from colonnade.common import notes
from colonnade.common.errors import UserError
from colonnade.common.image_io import decode_srgb, encode_srgb
from colonnade.design.generator import manifest_for
from colonnade.environment.load import load_environment
from colonnade.mesh.load import load_mesh
from colonnade.quality.image_metrics import psnr
from colonnade.render.composite import composited
from colonnade.render.frames import render, render_frames
from colonnade.render.request import RenderRequest
from colonnade.render.result import RenderResult
from colonnade.scene.lit_room import LitRoom, lit_room
from colonnade.scene.model import Background, Colour, Light, MeshSource, Paths, Scene
from colonnade.scene.object_pose import Placed, object_pose
from colonnade.scene.parser import load_scene
from colonnade.scene.prepared import device_scene
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene.prepared.gathered_light import scene_cube

SIZE = (96, 72)

MIRROR = """
mesh.name = "teapot:4"
object = {stand_at = [48, 43], size = 0.6}
material.kind = "mirror"
background.room = "attic"
"""
LAMP = "light = {position = [0.6, 2.2, 0.6], colour = [0.5, 0.5, 0.5], falloff = 1.5}\n"
UNGATHERED = "paths.gather = 0\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lit")
    write_attic(folder / "attic", *SIZE)
    write_attic(folder / "dark", *SIZE)
    (folder / "dark" / "photo.png").unlink()
    surface = attic(*SIZE).surface
    trimesh.Trimesh(surface.vertices, surface.faces, process=False).export(folder / "attic.ply")
    return folder


def frame(folder: Path, text: str, backend: str = "model", **options: object) -> RenderResult:
    (folder / "scene.toml").write_text(text)
    return render(RenderRequest(folder / "scene.toml", "small", SMALL_MAPS, backend, SIZE, **{"samples": 1, **options}))


def decibels(one: RenderResult, other: RenderResult, mask: np.ndarray | None = None) -> float:
    where = np.ones(one.object_mask.shape, dtype=bool) if mask is None else mask
    return psnr(encode_srgb(one.image[where])[None], encode_srgb(other.image[where])[None])


def test_a_scene_without_lights_gets_those_of_the_photo(folder: Path, told: list[str]) -> None:
    frame(folder, MIRROR + UNGATHERED)
    assert told == ["room attic: ambient light and 1 point light fitted to the photo ([[light]], [ambient])"]
    for named in (LAMP, "ambient.colour = [0.3, 0.3, 0.3]\n"):
        frame(folder, MIRROR + named + UNGATHERED)
    frame(folder, MIRROR.replace("attic", "dark"))
    assert len(told) == 2 and "room dark: no photo to fit lights to, one beside the object and ambient" in told[1]


def test_found_lights_cast_no_shadow_where_the_photo_has_one(folder: Path) -> None:
    """Those that a scene names cast whole shadows; so do all in a room whose albedo has the photo's shadows."""
    room = load_environment(folder / "attic")
    extent, scene = load_mesh("teapot:4").extent, Scene(MeshSource("teapot:4"), background=Background(room=folder))
    strengths = [
        lit_room(Placed(replace(scene, names_light=names), extent, one), 2, relit).strength
        for names, one, relit in (
            (True, room, False),
            (False, replace(room, has_albedo=False), False),
            (False, room, True),
            (False, room, False),
        )
    ]
    assert strengths[:3] == [None, None, None]
    strength = strengths[3]
    assert strength is not None and strength.shape == (SIZE[1], SIZE[0]) and strength.min() == 0
    assert np.median(strength) > 200
    partial = frame(folder, MIRROR)
    assert (partial.image >= composited(partial.sums, room.photo) - 1e-4).all(), (
        "no pixel is darker than with whole ones"
    )
    whole = frame(folder, MIRROR + 'background.shadows = "whole"\n')
    np.testing.assert_array_equal(whole.image, composited(partial.sums, room.photo))
    with pytest.raises(UserError, match=r"background.shadows is photo, but room dark has no photo.png"):
        frame(folder, MIRROR.replace("attic", "dark") + 'background.shadows = "photo"\n')


@pytest.mark.parametrize("light", ["", LAMP, "ambient.colour = [0.3, 0.3, 0.3]\n"])
def test_the_reference_is_composited_as_the_device_is(folder: Path, light: str) -> None:
    model, reference = frame(folder, MIRROR + light), frame(folder, MIRROR + light, "reference")
    np.testing.assert_array_equal(model.object_mask, reference.object_mask)
    assert decibels(model, reference) > 30
    # Mirrors are not black where the camera saw nothing
    assert decibels(model, reference, model.object_mask) > 18
    assert (reference.image[reference.object_mask].max(axis=1) > 0.01).mean() > 0.95
    relit = [frame(folder, MIRROR + light, backend, relit=True) for backend in ("model", "reference")]
    assert decibels(*relit) > 24
    assert decibels(reference, relit[1]) < 40


def test_a_photo_that_is_too_bright_for_the_lights_of_a_scene_is_noted(folder: Path, told: list[str]) -> None:
    """Not with gathered light, and not with fitted lights: nothing that a scene says would help."""
    (folder / "scene.toml").write_text(MIRROR + LAMP)
    room, extent = load_environment(folder / "attic"), load_mesh("cube").extent
    (folder / "scene.toml").write_text(MIRROR + LAMP)
    dim = replace(load_scene(folder / "scene.toml"), ambient=Colour((0.001,) * 3), light=Light(colour=(0.001,) * 3))
    for scene in (replace(dim, paths=Paths(gather=1)), replace(dim, names_light=False), dim):
        assert not any("too dark" in line for line in told)
        lit_room(Placed(scene, extent, room), 1, False)
    assert any("too dark under the scene's lights" in line and "raise ambient.colour" in line for line in told)


def test_what_a_room_lacks_is_noted(folder: Path, told: list[str]) -> None:
    room = replace(load_environment(folder / "dark"), notes=("its depth is estimated", "its albedo is derived"))
    lit_room(
        Placed(Scene(MeshSource("cube"), background=Background(room=folder / "dark")), load_mesh("cube").extent, room),
        1,
        False,
    )
    notes.flush()
    assert told == ["room dark: its depth is estimated; its albedo is derived"]


@pytest.mark.parametrize("backend", ["model", "reference"])
def test_notes_on_a_room_are_one_line_of_a_command(folder: Path, told: list[str], backend: str) -> None:
    """Whatever the number of frames and scenes: lights, directions, look, gathered light, filter and samples."""
    for frames in (1, 2):
        (folder / "scene.toml").write_text(MIRROR + "motion.turn = 40.0\n")
        request = RenderRequest(folder / "scene.toml", "small", SMALL_MAPS, backend, SIZE, frames=frames)
        assert len(list(render_frames(request))) == frames
    (line,) = told
    lights, seen, gathered, samples = line.split("; ")
    assert lights == "room attic: ambient light and 1 point light fitted to the photo ([[light]], [ambient])"
    assert re.fullmatch(
        r"\d\d% of the directions of light seen, .* \(background.panorama, background.second_view\)", seen
    )
    filtered = ("", "") if backend == "reference" else (" and noise filtered", ", --denoise")
    assert gathered == f"light gathered{filtered[0]} by small (paths.gather{filtered[1]})"
    assert samples.startswith("16 samples a pixel, ") and samples.endswith(" (--samples)")


def test_the_colours_of_a_room_can_be_chosen(folder: Path) -> None:
    """Without shadows a room that is relit in the photo's colours is the photo."""
    photo = decode_srgb(attic(*SIZE).environment.photo)
    quiet = LAMP.replace("falloff", "shadows = false, falloff") + "ambient.colour = [0.4, 0.4, 0.4]\n"
    shown = {
        colours: frame(folder, MIRROR + quiet + f'background.colours = "{colours}"\n', "reference", relit=True)
        for colours in ("photo", "albedo")
    }
    seen = ~shown["photo"].object_mask
    errors = {name: psnr(encode_srgb(photo[seen])[None], encode_srgb(f.image[seen])[None]) for name, f in shown.items()}
    assert errors["photo"] > 40 and errors["albedo"] < 25


def test_the_headroom_of_the_lights_does_not_change_the_object(folder: Path) -> None:
    """Lights are brighter by the headroom, and the object's albedo is darker by it."""
    dim = UNGATHERED + MIRROR.replace("mirror", "diffuse") + LAMP.replace("0.5, 0.5, 0.5", "0.2, 0.2, 0.2")
    photo, albedo = (
        frame(folder, dim + f'background.colours = "{colours}"\n', backend)
        for colours, backend in (("photo", "model"), ("albedo", "model"))
    )
    assert np.abs(encode_srgb(photo.image).astype(int) - encode_srgb(albedo.image)).max() <= 3


@pytest.mark.parametrize("kind", ["mirror", "glass"])
def test_a_photo_that_is_brighter_than_its_lights_is_as_bright_in_what_gathers(folder: Path, kind: str) -> None:
    """Under lights that explain the photo, and under a fifth of them."""
    light = {}
    for ambient in (1.0, 0.2):
        text = f"light.colour = [0.0, 0.0, 0.0]\nambient.colour = {[ambient] * 3}\npaths.gather = 1\n"
        (folder / "scene.toml").write_text(MIRROR.replace("mirror", kind) + text)
        request = RenderRequest(folder / "scene.toml", "small", SMALL_MAPS, "model", SIZE, samples=4)
        result = render(replace(request, encoder="live"))
        light[ambient] = result.image[result.object_mask].mean()
    assert light[0.2] == pytest.approx(light[1.0], rel=0.04)


def test_corners_of_faces_are_packed_darker_by_the_headroom(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "scene.toml").write_text(MIRROR.replace("mirror", "diffuse") + LAMP)
    packed: list[object] = []
    whole = device_scene.pack_objects
    monkeypatch.setattr(device_scene, "pack_objects", lambda *given: packed.append(given[3]) or whole(*given))
    prepared = DeviceScene.of(load_scene(folder / "scene.toml"), manifest_for("small", SMALL_MAPS).manifest)
    assert packed == [prepared.scene.headroom] and prepared.scene.headroom > 1


def test_colours_need_a_room_with_a_photo(folder: Path) -> None:
    with pytest.raises(UserError, match=r"background.colours is photo, but room dark has no photo.png"):
        frame(folder, MIRROR.replace("attic", "dark") + LAMP + 'background.colours = "photo"\n')
    with pytest.raises(UserError, match=r"background.colours chooses the colours of a room: it needs background.room"):
        frame(folder, 'mesh.name = "cube"\nbackground.colours = "photo"\n')
    with pytest.raises(UserError, match=r"background.panorama_yaw is of a panorama: it needs background.panorama"):
        frame(folder, 'mesh.name = "cube"\nbackground.panorama_yaw = 90.0\n')
    with pytest.raises(UserError, match=r"background.colours must be one of photo, albedo"):
        frame(folder, MIRROR + 'background.colours = "grey"\n')


def test_the_truth_of_a_room_replaces_its_depth_map(folder: Path) -> None:
    text, truth = MIRROR + LAMP, folder / "attic.ply"
    by_map, by_mesh = frame(folder, text, "reference"), frame(folder, text, "reference", truth=truth)
    # The attic's maps are its mesh's, so only what the camera did not see may differ
    assert decibels(by_map, by_mesh) > 28
    background = ~by_map.object_mask
    assert decibels(by_map, by_mesh, background) > 40
    assert decibels(by_map, by_mesh, by_map.object_mask) < 40
    with pytest.raises(UserError, match="--truth is for --backend reference"):
        frame(folder, text, truth=truth)
    with pytest.raises(UserError, match="--truth is the real geometry of a room, but the scene has none"):
        frame(folder, 'mesh.name = "cube"\n', "reference", truth=truth)


def test_the_truth_has_its_own_colours_where_the_photo_has_none(folder: Path) -> None:
    surface = attic(*SIZE).surface
    red = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    red.visual.face_colors = np.tile(np.array([255, 0, 0, 255], dtype=np.uint8), (len(surface.faces), 1))
    red.export(folder / "red.ply")
    plain, coloured = (
        frame(folder, MIRROR + LAMP, "reference", truth=folder / f"{name}.ply").image for name in ("attic", "red")
    )
    changed = np.abs(plain - coloured).max(axis=2) > 0.02
    assert 10 < changed.sum() < 0.1 * changed.size
    assert (coloured[changed][:, 0] > 4 * coloured[changed][:, 1]).mean() > 0.9


def test_fitted_lights_have_an_area_that_mirrors_do_not_see(folder: Path) -> None:
    """Only where light is gathered: other frames have one sample, or the lights of `colonnade light`."""
    room, extent = load_environment(folder / "attic"), load_mesh("teapot:4").extent
    scene = Scene(MeshSource("teapot:4"), background=Background(room=folder), names_light=False)
    hard = lit_room(Placed(scene, extent, room), 2, False).scene
    assert [light.radius for light in hard.lights] == [0.0] * len(hard.lights) and not hard.fits_lights
    soft = lit_room(Placed(replace(scene, paths=Paths(gather=1)), extent, room), 2, False).scene
    middle = Placed(soft, extent, room).pose.to_world(extent.centre)
    for light in soft.lights:
        assert light.position is not None
        assert light.radius == pytest.approx(0.2 * np.linalg.norm(np.array(light.position) - middle), abs=1e-3)
    assert soft.blurs == [], "no key of the scene asks for several samples"
    for known, marks in ((soft, False), (replace(soft, fits_lights=False), True)):
        cube = scene_cube(LitRoom(Placed(known, extent, room)), None, False)
        assert cube is not None and cube.lights is not None and cube.lights.any() == marks


def test_the_light_command_prints_a_scene(folder: Path, tmp_path: Path) -> None:
    runner = CliRunner()
    result = runner.invoke(cli, ["light", str(folder / "attic"), "--output", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "out" / "light.png").is_file()
    text = MIRROR + 'background.shadows = "photo"\n' + result.stdout
    fitted, named = frame(folder, MIRROR), frame(folder, text)
    np.testing.assert_array_equal(fitted.image, named.image)
    failed = runner.invoke(cli, ["light", str(folder / "dark")])
    assert failed.exit_code == 2 and "has no photo.png or render.png" in failed.stderr


def test_a_second_view_needs_a_room_a_photo_and_gathered_light(folder: Path, told: list[str]) -> None:
    with pytest.raises(UserError, match=r"background.second_view is another view of a room: it needs background.room"):
        frame(folder, 'mesh.name = "cube"\nbackground.second_view = "attic"\n')
    with pytest.raises(UserError, match=r"background.second_view is .*dark, which has no photo.png"):
        frame(folder, MIRROR + LAMP + 'background.second_view = "dark"\n')
    frame(folder, MIRROR + LAMP + UNGATHERED + 'background.second_view = "attic"\n')
    assert "has no effect: the scene gathers no light" in told[-1]


def entries(run: Callable[[], object]) -> list[float]:
    """The progress along the motion at each entry of `object_pose`."""
    found: list[float] = []

    def profile(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and frame.f_code is object_pose.__code__:
            found.append(frame.f_locals["placed"].scene.motion_progress)

    before = sys.getprofile()
    sys.setprofile(profile)
    try:
        run()
    finally:
        sys.setprofile(before)
    return found


@pytest.mark.parametrize("gather", [0, 1])
def test_the_pose_of_a_moment_is_computed_once(folder: Path, gather: int) -> None:
    """From the fit of lights to the registers of all passes."""
    moves = f"paths.gather = {gather}\nmotion = {{stand_at = [44, 46], turn = 40.0}}\n"
    (folder / "scene.toml").write_text(MIRROR + moves)
    request = RenderRequest(folder / "scene.toml", "small", SMALL_MAPS, "model", SIZE, samples=4, frames=2)
    assert entries(lambda: list(render_frames(replace(request, encoder="live")))) == [0.0, 1.0]
