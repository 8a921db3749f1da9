"""A scene file, and a view of it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from colonnade.viewer.server import ViewServer
from colonnade.viewer.session import Session

FRAMING = """# A scene
mesh = {name = "octahedron"}   # eight faces

[camera]   # of the picture
direction = [0.4, 0.3, 1.0]
fov = 35.0   # degrees
# lights
[[light]]
offset = [1.0, 1.5, 1.0]
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    file = tmp_path / "scene.toml"
    file.write_text(FRAMING)
    return file


@pytest.fixture
def server(file: Path) -> Iterator[ViewServer]:
    server = ViewServer(Session(file, "tiny", size=(48, 36)))
    server.start()
    yield server
    server.stop()
