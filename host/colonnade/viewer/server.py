"""The server of `colonnade view`: the page, frames of its camera, and changes of the scene; on this machine alone."""

from __future__ import annotations

import contextlib
import json
import math
import sys
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np

from colonnade.common.errors import UserError
from colonnade.common.limits import MAX_COORDINATE
from colonnade.design.toolchain import project_root
from colonnade.viewer.session import Session, ViewCamera

HOST = "127.0.0.1"
#: Files of the page by address, and their types.
_FILES = {
    "/": ("live.html", "text/html"),
    "/live.js": ("live.js", "text/javascript"),
    "/orbit.js": ("orbit.js", "text/javascript"),
    "/style.css": ("style.css", "text/css"),
}
_MOST_BYTES = 4096
_KEEP_ALIVE = 15.0


class ViewServer(ThreadingHTTPServer):
    """Serves a session.

    Args:
        session: The scene.
        port: TCP port of 127.0.0.1; 0: a free one.

    Raises:
        UserError: The port is in use.
    """

    daemon_threads = True

    def __init__(self, session: Session, port: int = 0) -> None:
        self.session = session
        self.folder: Path = project_root() / "site"
        try:
            super().__init__((HOST, port), _Handler)
        except OSError as error:
            raise UserError(f"port {port} of {HOST} cannot be used: {error.strerror}: give another --port") from None

    @property
    def address(self) -> str:
        """The page's."""
        return f"http://{HOST}:{self.server_address[1]}/"

    def start(self) -> None:
        """Serve and watch the scene, in threads that end with the program or by `stop`."""
        threading.Thread(target=self.serve_forever, args=(0.05,), daemon=True).start()
        threading.Thread(target=self.session.watch, daemon=True).start()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a page that was closed."""
        if not isinstance(sys.exc_info()[1], ConnectionError):
            super().handle_error(request, client_address)

    def stop(self) -> None:
        """End the threads, and release the session."""
        self.session.end()
        self.shutdown()
        self.server_close()
        self.session.close()


class _Handler(BaseHTTPRequestHandler):
    server: ViewServer
    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True

    def do_GET(self) -> None:
        """The page, a frame, or the changes of the scene."""
        address = urlsplit(self.path)
        if not self._is_own():
            return
        if address.path in _FILES:
            name, kind = _FILES[address.path]
            self._answer(200, (self.server.folder / name).read_bytes(), f"{kind}; charset=utf-8")
        elif address.path == "/frame":
            self._refusable(lambda: self._frame(parse_qs(address.query)))
        elif address.path == "/events":
            self._events()
        else:
            self._answer(404, b"nothing is here")

    def do_POST(self) -> None:
        """Save the camera: a JSON object with position and target."""
        if not self._is_own():
            return
        size = int(self.headers.get("Content-Length") or 0)
        if self.path != "/camera" or self.headers.get_content_type() != "application/json" or size > _MOST_BYTES:
            self.close_connection = True
            return self._answer(404, b"nothing is here")
        content = self.rfile.read(size)

        def save() -> None:
            values = json.loads(content)
            self.server.session.save(_camera([*values["position"], *values["target"]]))
            self._answer(200, b"saved")

        self._refusable(save)

    def _frame(self, query: dict[str, list[str]]) -> None:
        camera = None
        if "camera" in query:
            camera = _camera([float(text) for text in query["camera"][0].split(",")])
        session = self.server.session
        frame = session.still(camera) if "still" in query else session.frame(camera)
        height, width, _ = frame.pixels.shape
        pixels = np.full((height, width, 4), 255, np.uint8)
        pixels[..., :3] = frame.pixels
        figures = {name: getattr(frame, name) for name in ("version", "milliseconds", "rays", "samples", "final")}
        headers = {"X-Frame": json.dumps(figures | {"width": width, "height": height})}
        self._answer(200, pixels.tobytes(), "application/octet-stream", headers)

    def _events(self) -> None:
        """Server-sent events: the state now, and whenever it changes."""
        self.close_connection = True
        self.send_response(200)
        self.send_header("Content-Type", "text/event-stream")
        self.send_header("Cache-Control", "no-store")
        self.send_header("Connection", "close")
        self.end_headers()
        session, version = self.server.session, None
        try:
            while True:
                state = session.state(version, _KEEP_ALIVE)
                text = ":\n\n" if state["version"] == version else f"data: {json.dumps(state)}\n\n"
                version = state["version"]
                self.wfile.write(text.encode())
        except OSError:  # the page was closed
            return

    def _refusable(self, work: Any) -> None:
        try:
            work()
        except UserError as error:
            self._answer(422, str(error).encode(errors="replace"))
        except (ValueError, KeyError, TypeError):
            self._answer(400, b"six numbers describe a camera")

    def _is_own(self) -> bool:
        """Refuse requests of other sites' pages, which could name this server by a name of theirs."""
        own = self.server.address.removeprefix("http://").rstrip("/")
        hosts = (own, own.replace(HOST, "localhost"))
        origin = self.headers.get("Origin")
        if self.headers.get("Host") in hosts and (origin is None or origin.removeprefix("http://") in hosts):
            return True
        self.close_connection = True
        self._answer(403, b"this server answers its own page")
        return False

    def _answer(self, status: int, content: bytes, kind: str = "text/plain; charset=utf-8", headers: Any = ()) -> None:
        self.send_response(status)
        for name, value in {"Content-Type": kind, "Content-Length": str(len(content)), **dict(headers)}.items():
            self.send_header(name, value)
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        with contextlib.suppress(ConnectionError):  # the page was closed
            self.wfile.write(content)

    def log_message(self, format: str, *arguments: object) -> None:
        """Standard error is for errors of the command."""


def _camera(numbers: list[Any]) -> ViewCamera:
    """The camera of six numbers.

    Raises:
        ValueError: They are not.
    """
    values = [float(number) for number in numbers]
    if len(values) != 6 or not all(math.isfinite(value) and abs(value) <= MAX_COORDINATE for value in values):
        raise ValueError("no camera")
    return ViewCamera((values[0], values[1], values[2]), (values[3], values[4], values[5]))
