"""What `make browser` has built: the page, open in Chromium, and its WebAssembly in node."""

from __future__ import annotations

import json
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import playwright
import pytest
from patience import PATIENCE
from playwright.sync_api import BrowserContext, Page

from colonnade.environment.light_cube import LightCube
from colonnade.environment.seen_light import FINE

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "out" / "browser" / "index.html"
MODULE, RTL = (ROOT / ".cache" / "browser-objects" / f"{name}.wasm" for name in ("colonnade", "tiny"))
#: The marks of tests that need the page, and its WebAssembly.
NEEDS_PAGE, NEEDS_MODULE = (
    pytest.mark.skipif(not file.is_file(), reason="the page is not built: run `make browser`")
    for file in (FILE, MODULE)
)
#: Stops the watch of the page's workers, each second: a slow machine may take longer than it allows.
NO_WATCH = """{
  const every = setInterval;
  window.setInterval = (call, time) => (time === 1000 ? 0 : every(call, time));
}"""
#: A tetrahedron with a colour at each vertex.
OBJ = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nv 0 0 1 1 1 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\nl 1 2\n"


def run_node(program: str, folder: Path, job: Any) -> None:
    """Run a program of tests/browser on a folder with the job, by the node that Playwright brings, or the system's."""
    own = Path(playwright.__file__).parent / "driver" / "node"
    node = str(own) if own.is_file() else shutil.which("node")
    if node is None:
        pytest.skip("no node")
    (folder / "job.json").write_text(json.dumps(job))
    subprocess.run([node, Path(__file__).with_name("browser") / program, folder], check=True)


def cube_of(words: bytes) -> LightCube:
    """The light cube of `FINE` texels along an edge that words of the device hold."""
    numbers = np.frombuffer(words, "<u4")
    mantissas = np.stack([numbers >> shift & 127 for shift in (14, 7, 0)], axis=1)
    return LightCube((mantissas << (numbers[:, None] >> 21 & 15)).reshape(6, FINE, FINE, 3) / 4096)


class Tab:
    """The open page, and what it asked for or complained about."""

    def __init__(self, context: BrowserContext, link: str = "") -> None:
        self.page: Page = context.new_page()
        self.page.set_default_timeout(PATIENCE)
        self.page.add_init_script(NO_WATCH)
        self.requests: list[str] = []
        self.complaints: list[str] = []
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("console", lambda message: self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.goto(FILE.as_uri() + link)
        self.wait()

    def wait(self, before: int = 0) -> None:
        """Wait for a whole frame after so many."""
        self.page.wait_for_selector("body[data-frames]")
        while self.frames() <= before:
            time.sleep(0.02)

    @contextmanager
    def another_frame(self) -> Iterator[None]:
        """Wait for a whole frame after what is done."""
        before = self.frames()
        yield
        self.wait(before)

    def press(self, key: str) -> None:
        """Move the object or the camera, and wait for its frame."""
        with self.another_frame():
            self.page.focus("#stage")
            self.page.keyboard.press(key)

    def frames(self) -> int:
        return int(self.page.get_attribute("body", "data-frames") or 0)

    def picture(self) -> dict[str, Any]:
        """The last whole frame, and the writes of its registers."""
        return dict(
            self.page.evaluate(
                """async () => {
                  const { width, height, view, ...pixels } = colonnade.picture;
                  const { writes } = await colonnade.renderer.writes(view);
                  const lists = Object.entries(pixels).map(([name, values]) => [name, [...values]]);
                  return { width, height, writes, ...Object.fromEntries(lists) };
                }"""
            )
        )

    def drop(self, name: str, text: str) -> None:
        """Drop a file onto the picture."""
        self.page.evaluate(
            """([name, text]) => {
              const dataTransfer = new DataTransfer();
              dataTransfer.items.add(new File([text], name));
              document.getElementById("stage").dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true }));
            }""",
            [name, text],
        )

    def is_quiet(self) -> bool:
        """Whether the page asked no host, and the console is empty."""
        assert not [url for url in self.requests if not url.startswith((FILE.as_uri(), "blob:", "data:"))]
        assert not self.complaints
        return True
