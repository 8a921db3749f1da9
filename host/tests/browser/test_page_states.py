"""The page after links, files and workers that are not as they should be: it says so, has a picture, and goes on."""

from __future__ import annotations

import json
from pathlib import Path

import gltf_documents
import pytest
from built_page import NEEDS_MODULE, NEEDS_PAGE, OBJ, Tab, run_node
from playwright.sync_api import BrowserContext, expect

pytestmark = NEEDS_PAGE

#: Values that are no numbers, not whole, or out of the range of their control.
INVALID = (
    *("bounces=2.5", "bounces=-1", "bounces=16", "bounces=1e30", "bounces=0x2", "bounces=", "shadows=7.5", "shadows=2"),
    *("gather=0.5", "photo=2", "pixel=3", "pixel=1e9", "light=-5", "light=1e300", "distance=-5", "elevation=NaN"),
    *(
        "azimuth=1e308",
        "azimuth=Infinity",
        "x=1e308",
        "y=-1e308",
        "roomX=1e300",
        "roomDistance=0",
        "material=constructor",
    ),
    *(
        "colour=red",
        "constructor=1",
        "__proto__=3",
        "toString=2",
        "follow=0,0,0,0,0,0,0,0,0",
    ),
    *("follow=....,.,.,.,.,.,.,.,.", "follow=9,9,9,9,24,18,4.6,0,0", "follow=1,1,64,48,24,18,1e308,0,0"),
    "follow=1,1,64,48,24,18,4.6,0,0,0",
)
#: What the page without a link shows, and links with their states.
VALID = {
    "": {"room": "living", "material": "metal", "colour": "f9d1c2", "azimuth": 49},
    "#room=": {},
    "#bounces=15&light=0.25&pixel=4&shadows=0": {"bounces": 15, "light": 0.25, "pixel": 4, "shadows": 0},
    "#elevation=-89&roomX=-10&roomDistance=5": {"elevation": -89, "roomX": -10, "roomDistance": 5},
    "#follow=63,47,64,48,24,18,4.6,0,0": {"follow": "63,47,64,48,24,18,4.6,0,0"},
    "#follow=1,1,64,48,24,18,4.6,0,0,1,2,1,0,-0.5": {"follow": "1,1,64,48,24,18,4.6,0,0,1,2,1,0,-0.5"},
}


@NEEDS_MODULE
def test_values_of_links_that_are_not_valid_have_their_defaults(tmp_path: Path) -> None:
    run_node("state.mjs", tmp_path, [f"#{value}" for value in INVALID] + list(VALID))
    found = json.loads((tmp_path / "result.json").read_text())
    assert dict(zip(INVALID, found, strict=False)) == {value: {} for value in INVALID}
    assert found[len(INVALID) :] == list(VALID.values())


@pytest.mark.parametrize(
    "link",
    (
        "room=constructor",
        "room=__proto__&design=constructor",
        "design=__proto__&" + "&".join(value for value in INVALID if not value.startswith("follow")),
        "follow=5,5,6,6,24,18,4.6,0,0",
        "follow=1,1,99999,99999,24,18,4.6,0,0",
    ),
)
def test_the_page_of_any_link_has_a_picture_and_works(context: BrowserContext, link: str) -> None:
    tab = Tab(context, f"#{link}&pixel=4")
    page = tab.page
    assert page.evaluate("location.hash") == "#pixel=4"
    controls = ("design", "room", "bounces", "light", "pixel")
    values = page.evaluate(f"{list(controls)}.map(name => document.getElementById('controls').elements[name].value)")
    assert values == ["small", "", "4", "1", "4"]
    if "design" in link:
        expect(page.locator("#notes")).to_contain_text("which the page does not have: this is small")
    assert page.locator("#error").is_hidden() and page.locator("#busy").is_hidden()
    assert page.locator("#path").is_hidden()
    with tab.another_frame():
        page.select_option("select[name=material]", "mirror")
    assert tab.is_quiet()


@pytest.mark.parametrize(
    "link",
    (
        "elevation=89&distance=40&x=20&y=20",
        "elevation=-89&distance=1.8&x=-20&y=-20&design=tiny",
        "room=living&roomElevation=89&roomDistance=5&roomX=10&roomY=-10&roomAzimuth=180",
        "room=office&roomElevation=-89&roomDistance=0.2&roomX=-10&roomY=10&design=edge&material=glass&bounces=15",
    ),
)
def test_the_ends_of_the_ranges_are_rendered(context: BrowserContext, link: str) -> None:
    tab = Tab(context, f"#{link}&pixel=4")
    assert tab.page.locator("#error").is_hidden()
    assert f"{link.split('&')[1]}&" in tab.page.evaluate("location.hash")
    assert tab.is_quiet()


def test_an_error_of_a_file_shows_at_once_and_the_mesh_stays(context: BrowserContext) -> None:
    """While passes are added, and as a work that shows."""
    tab = Tab(context, "#room=living&material=metal")
    page = tab.page
    expect(page.locator("#samples")).to_contain_text("is added")
    is_hidden, frames = page.evaluate(
        """() => {
          const error = document.getElementById("error");
          const note = () => error.hidden || (window.framesAtError ??= colonnade.frames);
          new MutationObserver(note).observe(error, { attributes: true, childList: true });
          return [error.hidden, colonnade.frames];
        }"""
    )
    content = gltf_documents.REFUSED["doubled.gltf"][1].decode()
    tab.drop("doubled.gltf", content)
    assert page.evaluate("document.getElementById('busy').textContent") == "Reading the files…"
    expect(page.locator("#error")).to_have_text("mesh doubled.gltf: node 1 has two parents: export it again")
    assert is_hidden and page.evaluate("framesAtError") == frames
    expect(page.locator("#busy")).to_be_hidden()
    tab.wait(frames)
    assert page.locator("#mesh").inner_text() == "teapot.ply" and page.locator("#error").is_visible()
    # The mesh of before is also the next material's
    with tab.another_frame():
        page.select_option("select[name=material]", "glass")
    assert page.evaluate("colonnade.packed.triangles") == 6320
    assert tab.is_quiet()


def test_each_work_shows_what_it_is(context: BrowserContext) -> None:
    tab = Tab(context, "#pixel=4")
    page = tab.page
    signs = page.evaluate(
        """([name, text]) => {
          const { elements } = document.getElementById("controls");
          const said = [];
          const sign = document.getElementById("busy");
          new MutationObserver(() => sign.hidden || said.push(sign.textContent)).observe(sign, { childList: true });
          for (const [control, value] of [["design", "edge"], ["room", "office"], ["material", "glass"]]) {
            elements[control].value = value;
            elements[control].dispatchEvent(new Event("input", { bubbles: true }));
          }
          const dataTransfer = new DataTransfer();
          dataTransfer.items.add(new File([text], name));
          window.dispatchEvent(Object.assign(new Event("drop"), { dataTransfer }));
          const atOnce = !sign.hidden && sign.textContent;
          return new Promise((resolve) => {
            const wait = () => (sign.hidden ? resolve([atOnce, [...new Set(said)]]) : setTimeout(wait, 10));
            wait();
          });
        }""",
        ["four.obj", OBJ],
    )
    assert signs == ["Opening edge…", ["Opening edge…", "Opening office…", "Packing the mesh…", "Reading the files…"]]
    assert page.locator("#mesh").inner_text() == "four.obj"
    assert tab.is_quiet()


def test_hardware_that_cannot_hold_the_mesh_is_not_taken(context: BrowserContext) -> None:
    tab = Tab(context, "#pixel=4")
    page = tab.page
    rows = range(330)  # more records than tiny has, fewer than small
    with tab.another_frame():
        vertices = "".join(f"v {x} {(x * x + z * z) % 7 / 3} {z}\n" for x in rows for z in rows)
        corners = [330 * x + z + 1 for x in rows[1:] for z in rows[1:]]
        faces = "".join(f"f {at} {at - 1} {at - 331} {at - 330}\n" for at in corners)
        tab.drop("grid.obj", vertices + faces)
        expect(page.locator("#mesh")).to_have_text("grid.obj")
    colours = tab.picture()["colours"]
    with tab.another_frame():
        page.select_option("select[name=design]", "tiny")
        expect(page.locator("#error")).to_contain_text("mesh grid.obj needs ")
    expect(page.locator("select[name=design]")).to_have_value("small")
    assert tab.picture()["colours"] == colours and page.locator("#error").is_visible()
    with tab.another_frame():
        page.select_option("select[name=material]", "mirror")
    assert page.locator("#error").is_hidden() and tab.picture()["colours"] != colours
    assert tab.is_quiet()


#: Puts a worker without end in the place of one of the renderer's, for a call, of which it is silent too long at once.
ENDLESS = """([index, call]) => {
  const { renderer } = colonnade;
  const { url } = renderer;
  const answer = `if (data.call !== "${call}") return postMessage({ id: data.id, answer: {} }); for (;;);`;
  renderer.url = URL.createObjectURL(new Blob([`onmessage = ({ data }) => { ${answer} };`]));
  renderer.workers.at(index).terminate();
  const endless = renderer.workers[renderer.workers.length + index] = renderer.start();
  renderer.url = url;
  const timer = setInterval(() => {
    if (![...renderer.waiting.values()].some((each) => each.worker === endless && each.call === call)) return;
    clearInterval(timer);
    endless.silence = 20;
    renderer.watch();
  }, 20);
}"""


def test_a_worker_that_does_not_answer_is_replaced(context: BrowserContext) -> None:
    """While a file is read, or a frame is rendered; the page has the mesh of before, and reads the next file."""
    tab = Tab(context, "#pixel=4")
    page, first = tab.page, tab.picture()["colours"]
    expect(page.locator("#samples")).to_have_text("pass 4 of 4 is added")
    count = page.evaluate("colonnade.renderer.workers.length")
    page.evaluate(ENDLESS, [-count, "read"])
    with tab.another_frame():
        tab.drop("four.obj", OBJ)
        says = "a worker has not answered for 20 s while {}: it is replaced, and the page goes on with what it had"
        expect(page.locator("#error")).to_have_text(says.format("reading the file"))
    assert page.locator("#mesh").inner_text() == "teapot.ply" and tab.picture()["colours"] == first

    with tab.another_frame():
        tab.drop("four.obj", OBJ)
        expect(page.locator("#mesh")).to_have_text("four.obj")
    assert page.locator("#error").is_hidden()
    expect(page.locator("#samples")).to_have_text("pass 4 of 4 is added")
    page.evaluate(ENDLESS, [-1, "frame"])
    tab.press("ArrowLeft")
    expect(page.locator("#error")).to_have_text(says.format("rendering"))
    assert page.evaluate("colonnade.packed.triangles") == 4
    with tab.another_frame():
        page.evaluate("location.hash = '#pixel=4&design=edge'")
    assert page.locator("#error").is_hidden()
    assert tab.is_quiet()
