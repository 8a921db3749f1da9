"""Scenes with gathered light: their light cube, image, registers and errors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenImageIO
import pytest
from numpy.typing import NDArray

from colonnade.common import notes
from colonnade.common.accumulation import FramePasses
from colonnade.common.errors import UserError
from colonnade.design.generator import manifest_for
from colonnade.device.bit_exact import render_model
from colonnade.environment.load import load_environment
from colonnade.maps.cache import encoded_environment
from colonnade.maps.layout import AttributeLayout
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.materials import COAT_REFLECTANCE, Kind
from colonnade.render.frames import render_frames
from colonnade.render.reference_frames import traced_frames
from colonnade.render.request import RenderRequest
from colonnade.scene.lit_room import LitRoom, lit_room
from colonnade.scene.model import Background, Camera, Colour, Light, Material, MeshSource, Paths, Placement, Scene
from colonnade.scene.object_pose import Placed
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene.prepared.gathered_light import scene_cube
from colonnade.scene.samples import samples_of_frame
from colonnade.scene_image.device_image import device_image
from colonnade.scene_image.file import SceneImage
from colonnade.scene_image.inspect import describe

ROOM = Path(__file__).parents[3] / "scenes" / "rooms" / "living"
SCENE = Scene(
    MeshSource(name="teapot:4"), light=Light(falloff=2.0), ambient=Colour((0.4, 0.2, 0.1)), paths=Paths(gather=2)
)
IN_ROOM = replace(SCENE, placement=Placement((322.0, 306.0), 0.5), background=Background(room=ROOM))


def light_of(words: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Red, green and blue of the cube's words, 12 fraction bits, [texels, 3]."""
    fields = np.ascontiguousarray(words).view("<u4").astype(int)
    return (fields >> np.array([14, 7, 0]) & 127) << (fields >> 21 & 15)


def marks_of(words: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Which of the cube's words have a light, [texels]."""
    return words[:, 3].astype(int) >> 1


def test_without_a_room_every_texel_is_the_ambient_light() -> None:
    prepared = DeviceScene.of(SCENE, manifest_for("small").manifest)
    (cube,) = (section for section in prepared.image.attributes if section.memory == "light.cube")
    assert cube.words.shape == (1536, 4)
    np.testing.assert_allclose(light_of(cube.words) / 4096, np.broadcast_to((0.4, 0.2, 0.1), (1536, 3)), atol=0.4 / 128)
    assert not marks_of(cube.words).any(), "a point light has no size"
    inside = DeviceScene.of(replace(SCENE, light=Light(offset=(0.0, 0.0, 0.0), radius=0.1)), prepared.manifest)
    (cube,) = (section for section in inside.image.attributes if section.memory == "light.cube")
    assert not marks_of(cube.words).any(), "a light in the middle of the object is in no direction"


@pytest.mark.parametrize("scene", [SCENE, IN_ROOM], ids=["alone", "in a room"])
def test_an_image_keeps_its_light_in_a_file(scene: Scene, tmp_path: Path) -> None:
    manifest = manifest_for("small").manifest
    image = DeviceScene.of(scene, manifest, encoder="live").image
    again = SceneImage.load(image.save(tmp_path / "scene.image"), manifest)
    assert again.header.to_json() == image.header.to_json()
    assert [section.memory for section in again.attributes] == [section.memory for section in image.attributes]
    assert image.attributes[-1].memory == "light.cube"
    assert describe(again)["light"] == [{"memory": "light.cube", "words": 1536, "word_bytes": 4}]
    for one, other in zip(again.attributes, image.attributes, strict=True):
        np.testing.assert_array_equal(one.words, other.words)
    assert image.attributes[-1].words.tobytes()[:4] in device_image(image, manifest)


def test_a_room_lights_the_object_from_its_picture() -> None:
    """Another place has another light; a scene that gathers nothing has no cube."""
    manifest = manifest_for("small").manifest
    moved = replace(IN_ROOM, placement=Placement((150.0, 380.0), 0.5))
    words = [DeviceScene.of(scene, manifest, encoder="live").image.attributes[-1].words for scene in (IN_ROOM, moved)]
    assert (words[0] != words[1]).any()
    near, alone = (DeviceScene.of(scene, manifest, encoder="live").registers((32, 24)) for scene in (IN_ROOM, SCENE))
    assert near["gather.parallax"] > alone["gather.parallax"] == 0, "a room has walls, ambient light has none"
    still = DeviceScene.of(replace(IN_ROOM, paths=Paths()), manifest, encoder="live").image
    assert all(section.memory != "light.cube" for section in still.attributes)
    assert still.header.light == ()


def test_a_new_view_of_the_room_brings_its_light() -> None:
    prepared = DeviceScene.of(IN_ROOM, manifest_for("small").manifest, encoder="live")
    assert prepared.maps is not None
    room, image = load_environment(ROOM), prepared.maps.image
    assert room.photo is not None
    darker = replace(room, photo=(room.photo // 2).astype(np.uint8))
    words = [light_of(prepared.seen_in(view, lambda _: image).image.attributes[-1].words) for view in (room, darker)]
    assert words[1].sum() < 0.8 * words[0].sum()


def test_each_pass_has_points_of_its_own() -> None:
    manifest = manifest_for("small").manifest
    prepared = DeviceScene.of(SCENE, manifest)
    passes = prepared.passes(prepared.scene.with_samples(16))
    registers = [prepared.registers((32, 24), one) for one in passes]
    assert {values["gather.bounces"] for values in registers} == {2}
    for index in range(4):
        points = [tuple(values[f"gather.points[{index}].{axis}"] // 16 for axis in "uv") for values in registers]
        assert sorted(u for u, _ in points) == sorted(v for _, v in points) == list(range(16)), "evenly spread"
    assert samples_of_frame(16, 1)[3].gather != samples_of_frame(16, 1)[4].gather


def test_what_cannot_gather_is_refused() -> None:
    with pytest.raises(UserError, match=r"set frame\.gather=true"):
        DeviceScene.of(SCENE, manifest_for("small", ("frame.gather=false",)).manifest).registers((32, 24))
    with pytest.raises(UserError, match=r"frame\.gather"):
        manifest_for("small", ("units.shadeInterval=128",))
    with pytest.raises(UserError, match=r"frame\.gather"):
        manifest_for("small", ("frame.maxBounces=0",))


def test_room_pixels_near_the_object_gather_its_light() -> None:
    """The ratios of the model are the reference's, in the window and beside it."""
    design, size = manifest_for("small").manifest, (80, 60)
    scene = replace(IN_ROOM, material=Material(albedo=(0.8, 0.1, 0.1))).with_samples(4)
    prepared = DeviceScene.of(scene, design, encoder="live")
    passes = FramePasses()
    for one in prepared.passes():
        passes.add(render_model(design, prepared.image, prepared.registers(size, one)))
    room = load_environment(ROOM)
    (traced,) = traced_frames([scene], load_mesh("teapot:4"), room, size, 2)
    expected, found = traced.sums.ratio, passes.sums.ratio
    assert expected is not None and found is not None
    shows_room = (traced.sums.coverage == 0) & (passes.sums.coverage == 0)
    errors = np.abs(found / 4096 - expected)[shows_room] / 4
    print(errors.mean(), (errors > 0.02).mean(), found[shows_room].min(), found[shows_room].max())
    assert errors.mean() < 0.004


def test_a_surface_in_a_dome_of_light_is_as_bright_as_under_ambient_light() -> None:
    """A convex object sees the whole dome: its albedo times the light."""
    manifest = manifest_for("small").manifest
    frames = []
    for gather in (0, 1):
        dark = replace(SCENE, mesh=MeshSource(name="sphere"), light=Light(colour=(0.0, 0.0, 0.0)))
        scene = replace(dark, paths=Paths(gather=gather), material=Material(albedo=(0.5, 0.5, 0.5)))
        prepared = DeviceScene.of(scene, manifest)
        frames.append(render_model(manifest, prepared.image, prepared.registers((48, 36))))
    shows = frames[0].is_object
    means = [frame.colour[shows].mean(axis=0) / 4095 for frame in frames]
    assert np.abs(means[0] - means[1]).max() < 0.003


def test_a_mirror_shows_the_light_and_the_lamps_that_leave_it_nothing_else() -> None:
    """A matt object does not see them: they are lights already."""
    manifest, lamp = manifest_for("small").manifest, Light((0.0, 6.0, 0.0), radius=2.0)
    for kind, brightest in (("mirror", 4095), ("diffuse", 0)):
        dark = Light((0.0, 6.0, 0.0), colour=(0.0, 0.0, 0.0), radius=2.0) if kind == "diffuse" else lamp
        scene = replace(SCENE, mesh=MeshSource(name="sphere"), light=dark, material=Material(kind=kind))
        scene = replace(scene, ambient=Colour((0.0, 0.0, 0.5)), background=Background((0.0, 1.0, 0.0)))
        prepared = DeviceScene.of(scene, manifest)
        frame = render_model(manifest, prepared.image, prepared.registers((48, 36)))
        colours = frame.colour[frame.is_object]
        assert colours[:, 0].max() == brightest, "the lamp"
        assert (colours[colours[:, 0] < brightest] if kind == "mirror" else colours)[:, 1].max() == 0, "no background"


def test_mirrors_and_glass_in_a_room_are_those_of_the_reference() -> None:
    design, size, room = manifest_for("small").manifest, (80, 60), load_environment(ROOM)
    for kind, limit in (("mirror", 0.004), ("glass", 0.02)):
        scene = replace(IN_ROOM, mesh=MeshSource(name="sphere"), material=Material(kind=kind), paths=Paths(gather=1))
        prepared = DeviceScene.of(scene, design, encoder="live")
        frame = render_model(design, prepared.image, prepared.registers(size))
        (traced,) = traced_frames([scene], load_mesh("sphere"), room, size, 2)
        expected = traced.first.image[frame.is_object & traced.first.object_mask]
        found = frame.colour[frame.is_object & traced.first.object_mask] / 4095
        errors = np.abs(found - expected).max(axis=1)
        assert np.median(errors) < limit, "at edges of glass a ray may go elsewhere"


@pytest.mark.parametrize("backend", ["model", "reference"])
def test_rays_that_bring_more_than_white_count_whole(backend: str, tmp_path: Path) -> None:
    """Half of the directions are 3.2, the others dark: an albedo of 0.5 shows a mean of 0.8, not 0.5."""
    sky = Background(panorama=side_lit(tmp_path / "side.exr", 3.2, 0.0), panorama_exposure=1.0)
    plain = Material(albedo=(0.5, 0.5, 0.5))
    scene = replace(SCENE, mesh=MeshSource(name="sphere"), material=plain, background=sky, paths=Paths(gather=1))
    facing = replace(scene, light=Light(colour=(0.0, 0.0, 0.0)), camera=Camera(direction=(0.0, 0.0, 1.0)))
    dark = facing.with_samples(16)
    (result,) = render_frames(RenderRequest(dark, "small", backend=backend, size=(32, 24)))
    middle = result.image[10:14, 15:17].mean()
    assert abs(middle - 0.8) < 0.03


@pytest.mark.parametrize("backend", ["model", "reference"])
def test_a_coat_reflects_the_light_around_without_its_colour(backend: str) -> None:
    """In a dome of light it adds its reflectance, on black and on red; a frame of one sample has none."""
    scene = replace(SCENE, mesh=MeshSource(name="sphere"), light=Light(colour=(0.0, 0.0, 0.0)))
    scene = replace(scene, ambient=Colour((0.8, 0.8, 0.8)), paths=Paths(gather=1))
    middles = {}
    for albedo in (0.0, 0.5):
        for roughness in (0.0, 0.3):
            for samples in (1, 4):
                material = Material(kind="diffuse", albedo=(albedo, 0.0, 0.0), roughness=roughness)
                one = replace(scene, material=material).with_samples(samples)
                (result,) = render_frames(RenderRequest(one, "small", backend=backend, size=(32, 24)))
                middles[albedo, roughness, samples] = result.image[10:14, 14:18].mean(axis=(0, 1))
                assert result.report.samples == samples
    for albedo in (0.0, 0.5):
        without = middles[albedo, 0.0, 4]
        np.testing.assert_allclose(without, [0.8 * albedo, 0.0, 0.0], atol=0.003)
        # A smooth coat is as rough as 0.25 and not missing: no roughness is no coat
        np.testing.assert_allclose(middles[albedo, 0.3, 4] - without, 0.8 * COAT_REFLECTANCE, atol=0.003)
        np.testing.assert_allclose(middles[albedo, 0.3, 1], middles[albedo, 0.0, 1], atol=1e-9)


def shiny_ball(
    backend: str, kind: Kind, roughness: float, light: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Under a far point light, which has no mark, with black around: red, and where the ball is."""
    lamp, dark = Light(position=(0.0, 60.0, 0.0), colour=(light, light, light)), Colour((0.0, 0.0, 0.0))
    scene = replace(SCENE, mesh=MeshSource(name="sphere"), light=lamp, ambient=dark, paths=Paths(gather=1))
    material = Material(kind=kind, albedo=(1.0, 1.0, 1.0), roughness=roughness)
    scene = replace(scene, camera=Camera(direction=(0.0, 0.5, 1.0), fov=3.0), material=material).with_samples(16)
    (result,) = render_frames(RenderRequest(scene, "small", backend=backend, size=(96, 72)))
    return result.image[..., 0], result.object_mask


@pytest.mark.parametrize(
    ("kind", "roughness", "expected"),
    [("mirror", 0.1, 0.0), ("mirror", 0.16, 0.25), ("mirror", 0.26, 0.25), ("glass", 0.2, COAT_REFLECTANCE / 4)],
)
def test_a_shiny_ball_sends_a_quarter_of_the_light_to_each_side(kind: Kind, roughness: float, expected: float) -> None:
    """However rough it is: of a mirror, and of what glass reflects, by highlights."""
    image, ball = shiny_ball("reference", kind, roughness, 0.001)
    assert image[ball].mean() / 0.001 == pytest.approx(expected, rel=0.12)


def test_highlights_are_those_of_the_reference() -> None:
    balls = (shiny_ball(backend, "mirror", (6 / 256) ** 0.5, 0.5) for backend in ("model", "reference"))
    (found, ball), (expected, _) = balls
    assert expected.max() > 0.9
    assert np.abs(found - expected)[ball].mean() < 0.04 * expected[ball].mean()


def side_lit(path: Path, bright: float = 0.4, dim: float = 0.02) -> Path:
    """A panorama whose right half, at +x, is brighter than the left one."""
    pixels = np.full((32, 64, 3), dim, np.float32)
    pixels[:, 32:] = bright
    output = OpenImageIO.ImageOutput.create(str(path))
    assert output is not None and output.open(str(path), OpenImageIO.ImageSpec(64, 32, 3, "float"))
    output.write_image(pixels)
    output.close()
    return path


def panorama_scene(path: Path, level: float, scene: Scene) -> Scene:
    """A scene with a grey panorama with a lamp of 100 times its light in the first of 50 rows."""
    pixels = np.full((200, 400, 3), level)
    pixels[:4] *= 100
    output = OpenImageIO.ImageOutput.create(str(path))
    assert output is not None and output.open(str(path), OpenImageIO.ImageSpec(400, 200, 3, "float"))
    output.write_image(pixels.astype(np.float32))
    output.close()
    return replace(scene, background=replace(scene.background, panorama=path))


def test_a_panorama_is_the_light_without_a_room(tmp_path: Path, told: list[str]) -> None:
    """Lights that the scene names add to it; otherwise they are taken out of it, and the rest is ambient light."""
    manifest, scene = manifest_for("small").manifest, panorama_scene(tmp_path / "sky.exr", 0.5, SCENE)
    scene = replace(scene, background=replace(scene.background, panorama_exposure=0.5))
    words = light_of(DeviceScene.of(scene, manifest).image.attributes[-1].words) / 4096
    assert (np.sort(words, axis=None)[: 1528 * 3] == 0.25).all() and words.max() > 1
    assert told == []
    prepared = DeviceScene.of(replace(scene, names_light=False).with_samples(1), manifest)
    extent, light = prepared.image.header.extent, prepared.scene.light
    to_light = np.array(light.position) - Placed(scene, extent).pose.to_world(extent.centre)
    assert to_light[1] > 0.999 * np.linalg.norm(to_light) and light.radius > 0
    solid = 2 * np.pi * (1 - np.cos(np.pi / 50))
    assert light.colour == pytest.approx([solid * (25 - 1) / np.pi] * 3, rel=0.02)
    assert prepared.scene.ambient.colour == pytest.approx([0.25] * 3, rel=0.01)
    words = prepared.image.attributes[-1].words
    assert (light_of(words) / 4096).max() < 0.75 and 1 <= marks_of(words).sum() <= 8, "the lamp is a light instead"
    prepared.registers((32, 24))  # Its distance is within the registers
    assert told == [
        "the scene names no light: ambient light and 1 light are those of panorama sky.exr; [[light]] and [ambient]"
        " name others, and frame.samples = 16 shows the area of these"
    ]


@pytest.mark.matrix
def test_the_light_stays_while_the_object_turns(tmp_path: Path) -> None:
    """A matt ball and a mirror ball look the same in each frame, with the model and the reference."""
    for kind in ("diffuse", "mirror"):
        scene = replace(SCENE, mesh=MeshSource(name="sphere"), paths=Paths(gather=1), material=Material(kind=kind))
        sky = Background(panorama=side_lit(tmp_path / "side.exr"), panorama_exposure=1.0)
        east = replace(scene, light=Light(colour=(0.0, 0.0, 0.0)), background=sky)
        for backend in ("model", "reference"):
            request = RenderRequest(east.with_samples(16), "small", backend=backend, size=(32, 24), frames=3)
            frames = [result.image.mean(axis=2) for result in render_frames(request)]
            sides = np.array([(frame[8:16, 10:14].mean(), frame[8:16, 18:22].mean()) for frame in frames])
            assert (sides[:, 1] > 1.3 * sides[:, 0]).all(), "the light comes from the right"
            assert np.abs(sides - sides[0]).max() < 0.1 * sides.max()


def test_in_a_room_a_panorama_is_what_the_photo_does_not_show(tmp_path: Path, told: list[str]) -> None:
    """Its exposure is the photo's, whatever its own; its lights are in the room."""
    room, extent = load_environment(ROOM), load_mesh("teapot:4").extent
    image = encoded_environment(room, AttributeLayout(room.width, room.height))

    def lit_cube(scene: Scene) -> tuple[LitRoom, np.ndarray]:
        lit = lit_room(Placed(scene, extent, room), 2, False)
        cube = scene_cube(replace(lit, placed=Placed(lit.scene, extent, room)), image, False, is_noted=True)
        assert cube is not None
        return lit, cube.texels.reshape(-1, 3)

    scene = replace(IN_ROOM, names_light=False)
    (lit, one), (_, other) = (lit_cube(panorama_scene(tmp_path / f"{level}.exr", level, scene)) for level in (0.5, 2.0))
    np.testing.assert_allclose(one, other, atol=0.002)
    light = lit.scene.light
    assert light.position is not None and 1.0 < light.position[1] < 4.0 and light.falloff is not None
    _, without = lit_cube(IN_ROOM)
    assert 0.1 < (np.abs(one - without) < 1e-9).all(axis=1).mean() < 0.6, "directions of the photo keep its light"
    grey = np.median(one, axis=0)
    assert (np.abs(one - grey) < 0.002).all(axis=1).mean() > 0.3, "the others are the panorama's"
    named = panorama_scene(tmp_path / "named.exr", 0.5, IN_ROOM)
    for relit, share in ((False, 0.85), (True, 1.0)):
        ambient = lit_room(Placed(named, extent, room), 2, relit).scene.ambient.colour
        assert ambient == pytest.approx([share * value for value in IN_ROOM.ambient.colour]), "of the panorama"
    notes.flush()
    lines = "\n".join(told)
    assert "has the exposure" in lines and "1 light are" in lines and "is not drawn" not in lines
    assert lines.count("(background.panorama, background.second_view)") == 1, "without a panorama"
