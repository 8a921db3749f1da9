"""The page in Chromium: rooms of its own, and a photo with its depth. `make browser` builds it."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from built_page import NEEDS_PAGE, ROOT, Tab
from page_frames import host_frame, light_around, registers_of
from PIL import Image
from playwright.sync_api import BrowserContext, expect

from colonnade.common.image_io import decode_srgb
from colonnade.common.srgb import srgb_from_linear
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import render_model
from colonnade.mesh.load import load_mesh
from colonnade.scene.cameras import camera_axes
from colonnade.scene.parser import load_scene
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene.samples import samples_of_frame

pytestmark = NEEDS_PAGE


def test_the_first_picture_is_that_of_the_readme(context: BrowserContext) -> None:
    """The material of scenes/metal.toml, its place and turn in the room; the light is fitted to the photo."""
    tab = Tab(context)
    assert tab.page.evaluate("location.hash") == "#room=living&material=metal&colour=f9d1c2&azimuth=49"
    assert tab.page.evaluate("colonnade.first") < 10_000  # some 3 s on a busy machine
    writes, hits = tab.page.evaluate(
        """async () => {
          const { view, triangles } = colonnade.picture;
          const { writes } = await colonnade.renderer.writes(view);
          return [writes, Array.from(triangles, (triangle) => Number(triangle >= 0)).join("")];
        }"""
    )
    manifest = Manifest.load(ROOT / "configs" / "golden" / "small.json")
    registers = registers_of({"writes": writes}, manifest)
    scene = DeviceScene.of(load_scene(ROOT / "scenes" / "metal.toml"), manifest, load_mesh("teapot"), encoder="live")
    own = scene.registers((640, 480))
    for name in ("kind", *(f"lobe.{part}" for part in ("alpha", "slope", "peak"))):
        assert registers[f"materials[0].{name}"] == own[f"materials[0].{name}"], name
    for channel in "rgb":
        name = f"materials[0].albedo.{channel}"
        assert registers[name] == pytest.approx(own[name], rel=0.01)
    assert registers["gather.bounces"] == own["gather.bounces"] == 1
    expected = render_model(manifest, scene.image, own | {"gather.bounces": 0}).is_object
    is_object = np.reshape([hit == "1" for hit in hits], (480, 640))
    assert (expected & is_object).sum() > 0.98 * (expected | is_object).sum() > 2000
    expect(tab.page.locator("#samples")).to_contain_text("is added")
    assert tab.is_quiet()


def test_a_room_equals_the_host_and_a_drag_turns_the_object(context: BrowserContext) -> None:
    tab = Tab(context, "#pixel=4&room=living&design=edge&material=mirror")
    pictures = []
    for _ in range(2):
        picture = tab.picture()
        assert (picture["width"], picture["height"]) == (160, 120)
        frame = host_frame(picture, load_mesh("teapot"), "edge", is_in_room=True, light=light_around(tab.page))
        assert frame.is_object.sum() > 100
        np.testing.assert_array_equal(np.reshape(picture["colours"], frame.colour.shape), frame.colour)
        np.testing.assert_array_equal(np.reshape(picture["ratios"], frame.ratio.shape), frame.ratio)
        pictures.append(picture["triangles"])
        tab.press("ArrowLeft")
    assert pictures[0] != pictures[1] and frame.ratio.min() < 3000
    photographed = tab.page.evaluate("document.getElementById('picture').toDataURL()")
    with tab.another_frame():
        tab.page.uncheck("input[name=photo]")
    assert tab.page.evaluate("document.getElementById('picture').toDataURL()") != photographed
    # Another camera, and back
    unmoved = tab.picture()["triangles"]
    with tab.another_frame():
        tab.page.select_option("select[name=drag]", "camera")
        tab.page.focus("#stage")
        tab.page.keyboard.press("ArrowRight")
    expect(tab.page.locator("#notes")).to_contain_text("the camera is not that of the photo")
    picture = tab.picture()
    frame = host_frame(picture, load_mesh("teapot"), "edge", is_in_room=True, light=light_around(tab.page))
    np.testing.assert_array_equal(np.reshape(picture["colours"], frame.colour.shape), frame.colour)
    np.testing.assert_array_equal(np.reshape(picture["triangles"], frame.triangle.shape), frame.triangle)
    assert frame.is_object.sum() > 100 and picture["triangles"] != pictures[1]
    with tab.another_frame():
        tab.page.click("#home")
    assert tab.picture()["triangles"] == unmoved
    tab.page.select_option("select[name=design]", "tiny")
    expect(tab.page.locator("#notes")).to_contain_text("this hardware has no maps of a room")
    assert tab.is_quiet()


def test_a_room_lights_the_object_and_passes_are_added(context: BrowserContext) -> None:
    """The light cube turns with the object; passes have the host's samples, and the points of its lights' discs."""
    tab = Tab(context, "#pixel=4&room=living&material=metal&azimuth=64")
    page = tab.page
    light = page.evaluate("colonnade.light")
    for _ in range(2):
        picture = tab.picture()
        frame = host_frame(picture, load_mesh("teapot"), "small", is_in_room=True, light=light_around(page))
        assert frame.is_object.sum() > 100 and frame.ratio.min() < 3500
        np.testing.assert_array_equal(np.reshape(picture["colours"], frame.colour.shape), frame.colour)
        np.testing.assert_array_equal(np.reshape(picture["ratios"], frame.ratio.shape), frame.ratio)
        tab.press("ArrowLeft")

    expect(page.locator("#samples")).to_have_text("pass 64 of 64 is added")
    view, middle = page.evaluate("[colonnade.pass, colonnade.middle]")
    writes = page.evaluate("colonnade.renderer.writes(colonnade.pass)")
    sample = samples_of_frame(64, len(light["lamps"]))[63]
    registers = registers_of(writes, Manifest.load(ROOT / "configs" / "golden" / "small.json"))
    assert [registers[f"gather.points[0].{axis}"] for axis in "uv"] == list(sample.gather[0])
    for lamp, placed, point in zip(light["lamps"], view["lights"], sample.lights, strict=True):
        right, up, _ = camera_axes(np.subtract(lamp["position"], middle), (0, 1, 0))
        expected = lamp["position"] + lamp["radius"] * (point[0] * right + point[1] * up)
        np.testing.assert_allclose(placed["position"], expected, atol=1e-12)
    lit = page.evaluate("document.getElementById('picture').toDataURL()")
    with tab.another_frame():
        page.uncheck("input[name=gather]")
    assert page.evaluate("document.getElementById('picture').toDataURL()") != lit
    expect(page.locator("#notes")).to_contain_text("rough metal is diffuse")
    assert tab.is_quiet()


def test_a_photo_and_its_depth_are_a_room(context: BrowserContext) -> None:
    """Relit from its maps it is the photo again, and the device sees it as a room of the page."""
    folder = ROOT / "scenes" / "rooms" / "living"
    tab = Tab(context, "#pixel=4&design=edge&material=mirror&photo=0")
    page = tab.page
    with tab.another_frame():
        page.set_input_files("#file", [folder / name for name in ("render.png", "depth.png", "meta.json")])
        expect(page.locator("#notes")).to_contain_text("one white lamp")
    picture = tab.picture()
    size = picture["height"], picture["width"]
    linear = np.reshape(picture["colours"], (*size, 3)) / 4095 / page.evaluate("colonnade.light.exposure")
    photo = decode_srgb(np.asarray(Image.open(folder / "render.png").convert("RGB").resize(size[::-1], Image.BOX)))
    is_object = np.reshape(picture["triangles"], size) >= 0
    assert is_object.sum() > 100
    lit = np.reshape(picture["ratios"], (*size, 3)).min(axis=2) == 4096
    error = (srgb_from_linear(linear) - srgb_from_linear(photo))[lit & ~is_object]
    assert lit.mean() > 0.8 and -20 * np.log10(np.sqrt((error**2).mean())) > 24
    # The room of the page has this lens, pose and depth: the projection to the maps is in proportion to the object
    manifest = Manifest.load(ROOT / "configs" / "golden" / "edge.json")
    own, scale = registers_of(picture, manifest), page.evaluate("colonnade.room.object.scale")
    with tab.another_frame():
        page.select_option("select[name=room]", "living")
    other = registers_of(tab.picture(), manifest)
    for i, axis in itertools.product(range(3), "xyz"):
        assert own[f"environment.rotation[{i}].{axis}"] == other[f"environment.rotation[{i}].{axis}"]
        ours, theirs = (
            each[f"environment.matrix[{i}].{axis}"] * 2.0 ** -each["environment.exponent"] for each in (own, other)
        )
        assert ours * 0.29 == pytest.approx(theirs * scale, rel=1e-6, abs=1e-12)
    # Without meta.json
    with tab.another_frame():
        page.set_input_files("#file", [folder / name for name in ("render.png", "depth.png")])
        expect(page.locator("#notes")).to_contain_text("the photo's width is taken as 65°")
        expect(page.locator("#notes")).to_contain_text("the vertical is that of the floor")
    # A double click moves the object, and a photo alone is refused
    hits = tab.picture()["triangles"]
    with tab.another_frame():
        page.check("input[name=photo]")
    with tab.another_frame():
        box = page.locator("#picture").bounding_box()
        assert box is not None
        page.mouse.dblclick(box["x"] + 0.35 * box["width"], box["y"] + 0.9 * box["height"])
    expect(page.locator("#error")).to_be_hidden()
    with tab.another_frame():  # after the move, not one between the clicks
        expect(page.locator("#busy")).to_be_hidden()
        page.uncheck("input[name=photo]")
    assert tab.picture()["triangles"] != hits
    with tab.another_frame():  # the frame after an error leaves it
        page.set_input_files("#file", folder / "render.png")
    expect(page.locator("#error")).to_contain_text("render.png is a photo without depth")
    # Its light, in other hardware
    with tab.another_frame():
        page.select_option("select[name=design]", "small")
        expect(page.locator("#notes")).to_contain_text("of the directions around the object")
    share, parallax = page.evaluate("[colonnade.light.share, colonnade.light.parallax]")
    assert 0.1 < share < 0.6 and parallax in (2, 3)
    assert tab.is_quiet()
