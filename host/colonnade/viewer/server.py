"""The server of `colonnade view`: the page, frames of its camera, and changes of the scene."""

from __future__ import annotations

import json
import threading
from pathlib import Path
from urllib.parse import parse_qs

import numpy as np
from pydantic import TypeAdapter

from colonnade.design.toolchain import project_root
from colonnade.viewer.private_handler import PrivateHandler
from colonnade.viewer.private_server import PrivateServer, Refused
from colonnade.viewer.session import Session, ViewCamera

#: Files of the page by request, and their types.
FILES = {
    "GET ": ("live.html", "text/html"),
    "GET live.js": ("live.js", "text/javascript"),
    "GET orbit.js": ("orbit.js", "text/javascript"),
    "GET style.css": ("style.css", "text/css"),
}
_KEEP_ALIVE = 15.0
_CAMERA = TypeAdapter(ViewCamera)


class ViewServer(PrivateServer):
    """Serves a session.

    Args:
        session: The scene.
        port: TCP port of 127.0.0.1; 0: a free one.

    Raises:
        UserError: The port is in use.
    """

    def __init__(self, session: Session, port: int = 0) -> None:
        self.session = session
        self.folder: Path = project_root() / "site"
        super().__init__(port, _Handler)

    def start(self) -> None:
        """Serve and watch the scene, in threads that end with the program or by `stop`."""
        threading.Thread(target=self.serve_forever, args=(0.05,), daemon=True).start()
        threading.Thread(target=self.session.watch, daemon=True).start()

    def stop(self) -> None:
        """End the threads, and release the session."""
        self.session.end()
        self.shutdown()
        self.server_close()
        self.session.close()


class _Handler(PrivateHandler):
    server: ViewServer

    def respond(self, target: str, query: str, body: bytes) -> None:
        """The page, a frame, the changes of the scene; or save the camera of a JSON object."""
        if target in FILES:
            name, kind = FILES[target]
            return self.answer(200, (self.server.folder / name).read_bytes(), kind)
        if target == "GET events":
            self._events()
        elif target == "GET frame":
            fields = parse_qs(query)
            camera = _camera(fields["camera"][0]) if "camera" in fields else None
            self._frame(camera, _moment(fields["at"][0]) if "at" in fields else None, "still" in fields)
        elif target == "POST camera" and self.headers.get_content_type() == "application/json":
            self.server.session.save(_camera(body))
            self.answer(200, b"saved")
        else:
            raise Refused(404, "nothing is here")

    def _frame(self, camera: ViewCamera | None, at: float | None, is_still: bool) -> None:
        session = self.server.session
        frame = session.still(camera, at) if is_still else session.frame(camera, at)
        height, width, _ = frame.pixels.shape
        pixels = np.full((height, width, 4), 255, np.uint8)
        pixels[..., :3] = frame.pixels
        figures = {name: getattr(frame, name) for name in ("version", "milliseconds", "rays", "samples", "final")}
        headers = {"X-Frame": json.dumps(figures | {"width": width, "height": height})}
        self.answer(200, pixels.tobytes(), "application/octet-stream", headers)

    def _events(self) -> None:
        """Server-sent events: the state now, and whenever it changes."""
        self.close_connection = True
        self.begin(200, "text/event-stream")
        session, version = self.server.session, None
        while not session.has_ended:
            state = session.state(version, _KEEP_ALIVE)
            text = ":\n\n" if state["version"] == version else f"data: {json.dumps(state)}\n\n"
            version = state["version"]
            self.wfile.write(text.encode())


def _moment(content: str) -> float:
    """Progress of a motion."""
    try:
        at = float(content)
    except ValueError:
        at = -1.0
    if not 0.0 <= at <= 1.0:
        raise Refused(400, "the progress of a motion is a number from 0 to 1")
    return at


def _camera(content: str | bytes) -> ViewCamera:
    """The camera of six numbers, as text with commas or as a JSON object."""
    try:
        if isinstance(content, bytes):
            return _CAMERA.validate_json(content)
        numbers = [float(number) for number in content.split(",")]
        return _CAMERA.validate_python({"position": numbers[:3], "target": numbers[3:]})
    except ValueError:  # pydantic's is one
        raise Refused(400, "six numbers describe a camera") from None
