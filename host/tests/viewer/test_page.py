"""The page of a view in Chromium: it keeps its policy, and another site's page neither reads nor writes."""

from __future__ import annotations

import http.server
import re
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from patience import PATIENCE
from playwright.sync_api import Browser, Page, expect

from colonnade.viewer.server import ViewServer

#: A page of another site that has found out the address of the view.
HOSTILE = """<script>
const page = "PAGE", camera = JSON.stringify({ position: [9, 9, 9], target: [0, 0, 0] });
const json = { "Content-Type": "application/json" }, plain = { "Content-Type": "text/plain" };
const fetches = {
  read: () => fetch(page + "frame"),
  render: () => fetch(page + "frame?still=1&camera=1,2,3,0,0,0", { mode: "no-cors" }),
  save: () => fetch(page + "camera", { method: "POST", headers: json, body: camera }),
  saveAsText: () => fetch(page + "camera", { method: "POST", mode: "no-cors", headers: plain, body: camera }),
};
const loaded = (tag, values) => new Promise((done) => {
  const ends = { onload: () => done(true), onerror: () => done(false) };
  document.body.append(Object.assign(document.createElement(tag), ends, values));
});
async function attack() {
  const found = {};
  for (const [name, work] of Object.entries(fetches)) {
    found[name] = await work().then((answer) => answer.ok, () => false);
  }
  navigator.sendBeacon(page + "camera", new Blob([camera], { type: "application/json" }));
  found.image = await loaded("img", { src: page + "frame?camera=1,1,5,0,0,0" });
  found.script = await loaded("script", { src: page + "orbit.js" });
  found.style = await loaded("link", { rel: "stylesheet", href: page + "style.css" });
  found.events = await new Promise((done) => {
    Object.assign(new EventSource(page + "events"), { onmessage: () => done(true), onerror: () => done(false) });
  });
  await loaded("iframe", { src: page });
  window.found = found;
}
window.onload = attack;
</script><body></body>"""


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    page = browser.new_page(viewport={"width": 900, "height": 560})
    page.set_default_timeout(PATIENCE)
    yield page
    page.close()


def test_the_page_keeps_its_policy_and_saves_its_camera(page: Page, server: ViewServer, file: Path) -> None:
    complaints: list[str] = []
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(server.link)
    page.wait_for_selector("body[data-frames]")
    assert page.url == server.address
    text = file.read_text()
    page.locator("#picture").hover()
    page.mouse.down()
    page.mouse.move(500, 300, steps=4)
    page.mouse.up()
    page.keyboard.press("s")
    expect(page.locator("#status")).to_have_text("The camera is in scene.toml.")
    assert "position = [" in file.read_text() and text != file.read_text()
    page.reload()
    page.wait_for_selector("body[data-frames]")
    assert not complaints


def test_a_motion_plays_until_it_is_paused(page: Page, server: ViewServer, file: Path) -> None:
    file.write_text(file.read_text() + "[motion]\nturn = 90.0\n")
    page.goto(server.link)
    page.wait_for_selector("body[data-frames]")
    expect(page.get_by_text("moment")).to_have_count(0)
    page.keyboard.press("p")
    body, above_four = page.locator("body"), re.compile("^([5-9]|[1-9][0-9]+)$")
    expect(body).to_have_attribute("data-frames", above_four)
    expect(page.get_by_text("moment")).to_have_count(1)
    page.get_by_role("button", name="Pause").click()
    expect(page.get_by_role("button", name="Play")).to_be_visible()
    expect(body).to_have_attribute("data-samples", above_four)  # it rests


def test_a_page_of_another_site_gets_nothing(
    page: Page, server: ViewServer, file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text, content = file.read_text(), HOSTILE.replace("PAGE", server.address).encode()
    reached: list[str] = []
    for name in ("frame", "still", "save", "state"):
        monkeypatch.setattr(server.session, name, lambda *_, name=name: reached.append(name))

    class Hostile(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, format: str, *arguments: object) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Hostile) as hostile:
        threading.Thread(target=hostile.serve_forever, daemon=True).start()
        page.goto(f"http://127.0.0.1:{hostile.server_address[1]}/")
        page.wait_for_function("window.found")
        assert not [name for name, value in page.evaluate("found").items() if value]
        for frame in page.frames[1:]:
            assert frame.locator("#picture").count() == 0
        hostile.shutdown()
    assert not reached and file.read_text() == text
