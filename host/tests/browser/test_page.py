"""The page in Chromium: it orbits, follows a ray, reads files and links. `make browser` builds it."""

from __future__ import annotations

import base64
import gzip
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from animated_documents import arm, turn
from built_page import FILE, NEEDS_PAGE, OBJ, ROOT, Tab
from page_frames import host_frame, light_around
from patience import PATIENCE
from playwright.sync_api import Browser, BrowserContext, expect

from colonnade.mesh.load import load_mesh

pytestmark = NEEDS_PAGE


def test_the_page_is_small_and_equals_the_host(context: BrowserContext) -> None:
    assert len(gzip.compress(FILE.read_bytes())) < 1_000_000
    tab = Tab(context, "#pixel=4")
    picture = tab.picture()
    frame = host_frame(picture, load_mesh("teapot"), "small")
    assert frame.is_object.sum() > 100
    np.testing.assert_array_equal(np.reshape(picture["colours"], frame.colour.shape), frame.colour)
    np.testing.assert_array_equal(np.reshape(picture["triangles"], frame.triangle.shape), frame.triangle)
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
        expect(page.locator("#notes")).to_have_text("1 line primitive is not shown: only faces are rendered")
    assert page.evaluate("[colonnade.packed.triangles, colonnade.mesh.hasColours]") == [4, True]
    colours = np.reshape(tab.picture()["colours"], (-1, 3))
    assert len(np.unique(colours, axis=0)) > 50
    # A drop, of a file that is none
    tab.drop("broken.ply", "ply nothing")
    expect(page.locator("#error")).to_have_text("broken.ply cannot be read as a mesh: its PLY header has no end")
    tab.drop(
        "huge.ply", "ply\nformat binary_little_endian 1.0\nelement vertex 999999999999\nproperty float x\nend_header\n"
    )
    expect(page.locator("#error")).to_have_text(
        "mesh huge.ply is truncated: its header states 999,999,999,999 rows of vertex, the file ends before"
    )
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
    context.set_default_timeout(PATIENCE)
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
    shots, tables = set(), set()
    for _ in range(3):
        before = int(page.evaluate("colonnade.played ?? 0"))
        while page.evaluate("colonnade.played ?? 0") < before + 3:
            time.sleep(0.02)
        shots.add(page.evaluate("document.getElementById('picture').toDataURL()"))
        tables.add(page.inner_text("#figures"))
    assert len(shots) == len(tables) == 3
    # Of the mesh that plays, not of the picture before it
    assert all("one sample a pixel" in table and "triangles, records\t36, " in table for table in tables), tables
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
    expect(tab.page.locator("#times caption")).to_contain_text("the recording is of the RTL of tiny")
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
    expect(page.locator("#rtl-status")).to_contain_text("Equal: 3072 pixels")
    page.mouse.click(208, 120)
    page.click("#time")
    expect(page.locator("#times caption")).to_contain_text("its colour is the model's")
    pixel = page.evaluate("colonnade.pixelCounters")
    assert pixel["raysPrimary"] == pixel["hits"] == 1 and pixel["waitRecord"] > 0
    result = page.evaluate("colonnade.rtl")
    assert result["hashes"][0] == result["hashes"][1] and not result["different"]
    assert result["counters"]["cycles"] > result["counters"]["boxTests"] > 1000
    assert tab.is_quiet()
