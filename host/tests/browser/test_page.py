"""The page in Chromium: it orbits, follows a ray, reads files and links. `make browser` builds it."""

from __future__ import annotations

import base64
import gzip
import itertools
import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from animated_documents import arm, turn
from built_page import FILE, NEEDS_PAGE, OBJ, ROOT, Tab, cube_of
from PIL import Image
from playwright.sync_api import Browser, BrowserContext, Page, expect

from colonnade.common.image_io import decode_srgb
from colonnade.common.srgb import srgb_from_linear
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import render_model
from colonnade.device.gathered_light import with_cube
from colonnade.device.scene import DeviceScene
from colonnade.environment.light_cube import LightCube
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.mesh import Mesh
from colonnade.registers.frame import frame_registers
from colonnade.scene.cameras import camera_axes
from colonnade.scene.parser import load_scene
from colonnade.scene.passes import exposed
from colonnade.scene.samples import samples_of_frame
from colonnade.scene_image.environment import with_environment
from colonnade.scene_image.packer import pack

pytestmark = NEEDS_PAGE


def registers_of(picture: dict[str, Any], manifest: Manifest) -> dict[str, int]:
    """The registers that the page wrote, by name."""
    words = {address: value for address, value in picture["writes"]}
    return {
        register.name: register.decode([words.get(register.address + word, 0) for word in range(register.words)])
        for register in manifest.registers.values()
        if register.access == "rw"
    }


def host_frame(
    picture: dict[str, Any],
    mesh: Mesh,
    design: str,
    is_in_room: bool = False,
    light: LightCube | None = None,
    progress: float = 0.0,
) -> Any:
    """The host's frame of the registers that the page wrote; those of the mesh are the host's.

    Args:
        light: Around the object, in its axes, of a room whose light is gathered.
        progress: Of the clip of a mesh that has one.
    """
    manifest = Manifest.load(ROOT / "configs" / "golden" / f"{design}.json")
    registers = registers_of(picture, manifest)
    image = pack(mesh, manifest).posed(progress)
    own = frame_registers(load_scene(ROOT / "scenes" / "object.toml"), image.header, manifest, 64, 48)
    of_mesh = [name for name in own if name.startswith(("bounds.", "scene.")) or name == "shading.offset"]
    assert len(of_mesh) == 10 and {name: registers[name] for name in of_mesh} == {name: own[name] for name in of_mesh}
    if is_in_room:
        scene = load_scene(ROOT / "scenes" / "room.toml")
        if light is not None:
            scene = exposed(replace(scene, names_light=False, paths=replace(scene.paths, gather=1)))
        maps = DeviceScene.of(scene, manifest, load_mesh("cube"), encoder="live").maps
        assert maps is not None
        image = with_cube(with_environment(image, maps, manifest), light)
    return render_model(manifest, image, registers)


def test_the_page_is_small_and_fast_and_equals_the_host(context: BrowserContext) -> None:
    assert len(gzip.compress(FILE.read_bytes())) < 1_000_000
    begin = time.monotonic()
    tab = Tab(context, "#pixel=4")
    assert time.monotonic() - begin < 10  # some 3 s on a busy machine
    picture = tab.picture()
    frame = host_frame(picture, load_mesh("teapot"), "small")
    assert frame.is_object.sum() > 100
    np.testing.assert_array_equal(np.reshape(picture["colours"], frame.colour.shape), frame.colour)
    np.testing.assert_array_equal(np.reshape(picture["triangles"], frame.triangle.shape), frame.triangle)
    assert tab.is_quiet()


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


def light_around(page: Page) -> LightCube:
    """The room's cube in the axes of the object, which the page turns."""
    cube = cube_of(base64.b64decode(page.evaluate("colonnade.light")["cube"]))
    angle = np.radians(float(page.evaluate("/azimuth=([\\d.]+)/.exec(location.hash)?.[1] ?? 24")) - 24)
    return cube.turned(np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]))


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


def test_a_click_follows_a_ray_and_the_link_holds_it(context: BrowserContext) -> None:
    tab = Tab(context, "#pixel=4&material=mirror&design=edge&distance=3")
    page = tab.page
    box = page.locator("#stage").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.click(x, y)
    expect(page.locator("#rays tbody tr").first).to_contain_text("primary")
    rays = page.evaluate("colonnade.rays.map(({steps, ...ray}) => ray)")
    assert [ray["kind"] for ray in rays][:2] == ["primary", "reflection"]
    picture = tab.picture()
    column, row = (int(value) for value in page.locator("#pixel").inner_text().split(","))
    assert rays[0]["hit"] == picture["triangles"][row * picture["width"] + column]
    first = rays[0]
    assert first["records"] >= first["nodes"] >= 1 and first["entered"] <= first["boxes"] <= 4 * first["nodes"]
    assert 1 <= first["lines"] <= first["records"]
    page.locator("#rays tbody tr").nth(1).click()
    expect(page.locator("#rays tr.chosen")).to_contain_text("reflection")
    assert page.locator("#steps li").count() == page.evaluate("colonnade.rays[1].steps.length")

    with tab.another_frame():
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 40, y - 20, steps=3)
        page.mouse.up()
    link = page.evaluate("location.hash")
    assert "azimuth=" in link and "follow=" in link
    other = Tab(context, link)
    expect(other.page.locator("#rays tbody tr")).to_have_count(len(rays))
    assert other.page.evaluate("colonnade.rays.map(({steps, ...ray}) => ray)") == rays
    assert tab.is_quiet() and other.is_quiet()


def test_files_are_read_and_what_is_left_out_is_said(context: BrowserContext, tmp_path: Path) -> None:
    tab = Tab(context, "#pixel=4")
    page = tab.page
    (tmp_path / "four.obj").write_text(OBJ)
    with tab.another_frame():
        page.set_input_files("#file", tmp_path / "four.obj")
        expect(page.locator("#mesh")).to_have_text("four.obj")
        expect(page.locator("#notes")).to_have_text("lines, points and curves are left out")
    assert page.evaluate("[colonnade.packed.triangles, colonnade.mesh.hasColours]") == [4, True]
    colours = np.reshape(tab.picture()["colours"], (-1, 3))
    assert len(np.unique(colours, axis=0)) > 50
    # A drop, of a file that is none
    tab.drop("broken.ply", "ply nothing")
    expect(page.locator("#error")).to_have_text("this is no PLY file")
    tab.drop(
        "huge.ply", "ply\nformat binary_little_endian 1.0\nelement vertex 999999999999\nproperty float x\nend_header\n"
    )
    expect(page.locator("#error")).to_have_text("huge.ply is damaged, or no PLY file")
    tab.drop("cycle.gltf", json.dumps(triangle_document() | {"nodes": [{"children": [0]}]}))
    expect(page.locator("#error")).to_have_text("mesh cycle.gltf: node 0 is its own ancestor: export it again")
    with tab.another_frame():
        tab.drop("one.gltf", json.dumps(triangle_document()))
        expect(page.locator("#mesh")).to_have_text("one.gltf")
    assert page.evaluate("colonnade.packed.triangles") == 1
    assert page.locator("#error").is_hidden()
    assert tab.is_quiet()


def triangle_document() -> dict[str, Any]:
    """A glTF file with one triangle, moved and mirrored by its node."""
    content = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype="<f4").tobytes()
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "scale": [-2, 1, 1], "translation": [1, 2, 3]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": len(content)}],
        "buffers": [{"byteLength": len(content), "uri": "data:;base64," + base64.b64encode(content).decode()}],
    }


def test_controls_and_the_size_of_a_phone(browser: Browser) -> None:
    context = browser.new_context(viewport={"width": 360, "height": 640}, has_touch=True, is_mobile=True, offline=True)
    tab = Tab(context, "#pixel=4&design=tiny")
    page = tab.page
    assert page.evaluate("document.documentElement.scrollWidth") <= 360
    stage, form = page.locator("#stage").bounding_box(), page.locator("#controls").bounding_box()
    assert stage is not None and form is not None and form["y"] >= stage["y"] + stage["height"] - 1
    with tab.another_frame():
        page.select_option("select[name=material]", "glass")
        expect(page.locator("#notes")).to_have_text("this hardware has neither mirrors nor glass")
    with tab.another_frame():
        page.select_option("select[name=design]", "lean")
    expect(page.locator("#notes li")).to_have_count(0)
    expect(page.locator("#figures")).to_contain_text("refracted rays")
    page.touchscreen.tap(180, 190)
    expect(page.locator("#rays tbody tr").first).to_contain_text("primary")
    assert tab.is_quiet()
    context.close()


def test_changes_that_come_faster_than_pictures(context: BrowserContext) -> None:
    """Designs, rooms, materials and rays while frames and other works run: no error, and the last state is shown."""
    tab = Tab(context, "#pixel=4")
    page = tab.page
    page.evaluate(
        """() => {
          const error = document.getElementById("error");
          window.errors = [];
          const note = () => error.hidden || errors.push(error.textContent);
          new MutationObserver(note).observe(error, { childList: true });
        }"""
    )
    designs, rooms, materials = ("edge", "small", "tiny", "lean"), ("office", "living", ""), ("glass", "metal")
    for index in range(24):
        name, values = (("design", designs), ("room", rooms), ("material", materials))[index % 3]
        before = page.evaluate(
            """([name, value]) => {
              const control = document.getElementById("controls").elements[name];
              control.value = value;
              control.dispatchEvent(new Event("input", { bubbles: true }));
              const key = new KeyboardEvent("keydown", { key: "ArrowLeft", bubbles: true });
              document.getElementById("stage").dispatchEvent(key);
              return colonnade.frames;
            }""",
            [name, values[index // 3 % len(values)]],
        )
        time.sleep(0.037 * (index % 5))
    tab.wait(before)
    expect(page.locator("#samples")).to_have_text("pass 64 of 64 is added")
    assert page.evaluate("errors") == []
    frame = host_frame(tab.picture(), load_mesh("teapot"), "lean", is_in_room=True, light=light_around(page))
    np.testing.assert_array_equal(np.reshape(tab.picture()["colours"], frame.colour.shape), frame.colour)
    assert tab.is_quiet()


def test_an_animated_file_plays_and_equals_the_host(context: BrowserContext, tmp_path: Path) -> None:
    document = arm()
    document.animate("spin", (5, "rotation", "LINEAR", [0.0, 3.0], [turn((0, 1, 0), 0), turn((0, 1, 0), 120)]))
    path = document.write(tmp_path / "arm.gltf")
    tab = Tab(context, "#pixel=2")
    page = tab.page
    expect(page.locator("#animations")).to_be_hidden()
    tab.drop("arm.gltf", path.read_text())
    expect(page.locator("#play")).to_have_text("Pause")
    shots = set()
    for _ in range(3):
        before, end = int(page.evaluate("colonnade.played ?? 0")), time.monotonic() + 30
        while page.evaluate("colonnade.played ?? 0") < before + 3:
            assert time.monotonic() < end, "it does not play"
        shots.add(page.evaluate("document.getElementById('picture').toDataURL()"))
    assert len(shots) == 3
    with tab.another_frame():
        page.click("#play")
    expect(page.locator("#play")).to_have_text("Play")
    seen = []
    for animation, seconds in (("bend", 1.0), ("bend", 1.0), ("spin", 3.0)):
        if animation == "spin":
            page.select_option("select[name=animation]", label="spin")
            expect(page.locator("#play")).to_have_text("Pause")
        with tab.another_frame():
            page.fill("#moment", "370" if seen else page.input_value("#moment"))
        at = page.evaluate("colonnade.picture.view.time")
        mesh = load_mesh(path, animation=animation)
        picture = tab.picture()
        frame = host_frame(picture, mesh, "small", progress=at / (seconds * 2**16))
        assert frame.is_object.sum() > 100
        np.testing.assert_array_equal(np.reshape(picture["colours"], frame.colour.shape), frame.colour)
        np.testing.assert_array_equal(np.reshape(picture["triangles"], frame.triangle.shape), frame.triangle)
        seen.append((animation, at, str(picture["triangles"])))
    assert seen[1][1] == round(0.37 * 2**16) and seen[2][1] == round(1.11 * 2**16)
    assert len({triangles for _, _, triangles in seen}) >= 2 and seen[1][2] != seen[2][2]
    with tab.another_frame():
        page.select_option("select[name=animation]", label="none")
    expect(page.locator("#play")).to_be_hidden()
    expect(page.locator("#notes")).to_contain_text("animations and skins are left out")
    assert tab.is_quiet()


def test_sliders_have_their_pictures_and_their_costs(context: BrowserContext) -> None:
    tab = Tab(context, "#pixel=4&design=edge")
    page = tab.page
    expect(page.locator("#costs")).to_contain_text("nJ/ray")
    for name, place, value in (("vertexBits", "2", "16"), ("contexts", "1", "12")):
        slider = page.locator(f"input[name={name}]")
        expect(slider).to_have_value(place)
        expect(slider).to_have_attribute("max", "2")
        expect(page.locator(f"#{name}-value")).to_have_text(value)
    expect(page.locator("input[name=precision]")).to_have_value("5")
    expect(page.locator("#precision-value")).to_have_text("32b32s64d")
    sharp = tab.picture()["colours"]
    with tab.another_frame():
        page.fill("input[name=precision]", "0")
        expect(page.locator("#precision-value")).to_have_text("16b16s32d")
    expect(page.locator("#costs")).to_contain_text("PSNR, lowest")
    expect(page.locator("#study")).to_contain_text("colonnade explore scenes/studies/mixed-precision.toml")
    assert tab.picture()["colours"] != sharp
    assert "design=16b16s32d" in page.evaluate("location.hash")
    with tab.another_frame():
        page.fill("input[name=vertexBits]", "0")
        expect(page.locator("#vertexBits-value")).to_have_text("12")
        expect(page.locator("#precision-value")).to_have_text("32b32s64d")
    expect(page.locator("#study")).to_contain_text("vertices-contexts.toml")
    assert tab.picture()["colours"] != sharp
    with tab.another_frame():
        page.fill("input[name=contexts]", "0")
        expect(page.locator("#contexts-value")).to_have_text("4")
    assert tab.picture()["colours"] == sharp, "contexts change no pixel"
    # Other hardware: they are folded, and have the values of edge
    page.select_option("select[name=design]", "lean")
    expect(page.locator("input[name=contexts]")).to_be_hidden()
    page.click("#studied summary")
    expect(page.locator("#studied")).to_contain_text("a slider changes to a variant of edge")
    expect(page.locator("#studied span", has_text="The chosen hardware is another one")).to_be_visible()
    values = [page.locator(f"#{name}-value").inner_text() for name in ("precision", "vertexBits", "contexts")]
    assert values == ["32b32s64d", "16", "12"]
    page.fill("input[name=contexts]", "2")
    expect(page.locator("#contexts-value")).to_have_text("16")
    expect(page.locator("select[name=design]")).to_have_value("16 contexts")
    assert tab.is_quiet()


def test_recorded_cycles_are_those_of_the_rtl(context: BrowserContext) -> None:
    """A change of the timing of `tiny` fails here: run tools/browser/record.py."""
    recording = json.loads((ROOT / "site" / "cycles.json").read_text())["tiny"]
    longest = max(range(len(recording["values"])), key=lambda index: recording["values"][index][0])
    x, y = recording["pixels"][longest]
    tab = Tab(context, f"#pixel=4&design=tiny&follow={x},{y},64,48,24,18,4.6,0,0")
    tab.page.click("#time")
    expect(tab.page.locator("#times caption")).to_contain_text("the recording is of the RTL of tiny", timeout=60_000)
    rows = [row.split("\t") for row in tab.page.locator("#times tbody").inner_text().splitlines()]
    assert rows[0][1:] == ["tiny", "tiny, recorded"] and len(rows) == 8
    # Schedules that run without pause may be a cycle further at the start
    ours, recorded = (np.array([int(row[of].replace(",", "")) for row in rows[1:]]) for of in (1, 2))
    assert np.abs(ours - recorded).max() <= 1
    assert tab.is_quiet()


def test_the_rtl_in_the_tab_equals_the_model(context: BrowserContext) -> None:
    tab = Tab(context, "#pixel=4&azimuth=70")
    page = tab.page
    page.click("#rtl-start")
    expect(page.locator("#rtl-status")).to_contain_text("Equal: 3072 pixels", timeout=60_000)
    page.mouse.click(208, 120)
    page.click("#time")
    expect(page.locator("#times caption")).to_contain_text("its colour is the model's", timeout=60_000)
    pixel = page.evaluate("colonnade.pixelCounters")
    assert pixel["raysPrimary"] == pixel["hits"] == 1 and pixel["waitRecord"] > 0
    result = page.evaluate("colonnade.rtl")
    assert result["hashes"][0] == result["hashes"][1] and not result["different"]
    assert result["counters"]["cycles"] > result["counters"]["boxTests"] > 1000
    assert tab.is_quiet()
