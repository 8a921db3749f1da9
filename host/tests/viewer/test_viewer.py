"""`colonnade view`: its frames are those of `render`, an edited file is loaded, the camera is saved into it."""

from __future__ import annotations

import http.client
import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import numpy as np
import pytest

import colonnade
from colonnade.common import ledger
from colonnade.common.errors import UserError
from colonnade.common.image_io import decode_srgb, write_png
from colonnade.viewer.camera_table import save_camera
from colonnade.viewer.server import ViewServer
from colonnade.viewer.session import STILL_SAMPLES, Session, ViewCamera

SIZE = (48, 36)
FRAMING = """# A scene
mesh = {name = "octahedron"}   # eight faces

[camera]   # of the picture
direction = [0.4, 0.3, 1.0]
fov = 35.0   # degrees
# lights
[[light]]
offset = [1.0, 1.5, 1.0]
"""
GATHERED = """mesh = {name = "teapot:2"}
background = {room = "attic"}
object = {stand_at = [200, 320], size = 0.6}
material = {kind = "diffuse", albedo = [0.3, 0.5, 0.2], roughness = 0.3}
light = {position = [0.6, 2.2, 0.6], falloff = 1.5}
paths = {gather = 1}
frame = {samples = 4, denoise = true}
"""
MOVED = ViewCamera((1.25, 0.5, 4.0), (0.0, 0.125, -0.0))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    file = tmp_path / "scene.toml"
    file.write_text(FRAMING)
    return file


@pytest.fixture
def server(file: Path) -> Iterator[ViewServer]:
    server = ViewServer(Session(file, "tiny", size=SIZE))
    server.start()
    yield server
    server.stop()


def pixels_of(server: ViewServer, query: str = "") -> np.ndarray:
    with urlopen(f"{server.address}frame{query}") as answer:
        figures = json.loads(answer.headers["X-Frame"])
        assert (figures["width"], figures["height"]) == SIZE and figures["rays"] > 0
        return np.frombuffer(answer.read(), np.uint8).reshape(SIZE[1], SIZE[0], 4)[..., :3]


def refused(request: Request) -> tuple[int, str]:
    with pytest.raises(HTTPError) as error:
        urlopen(request)
    return error.value.code, error.value.read().decode()


def test_the_page_shows_what_render_shows_and_saves_its_camera(server: ViewServer, file: Path) -> None:
    np.testing.assert_array_equal(pixels_of(server), colonnade.Scene.load(file).render(config="tiny", size=SIZE).pixels)
    query = "?camera=" + ",".join(map(str, [*MOVED.position, *MOVED.target]))
    moved = pixels_of(server, query)
    body = json.dumps({"position": MOVED.position, "target": MOVED.target}).encode()
    before = server.session.state()["version"]
    urlopen(Request(f"{server.address}camera", body, {"Content-Type": "application/json"})).close()
    assert server.session.state(before, 5.0)["camera"]["position"] == MOVED.position
    np.testing.assert_array_equal(pixels_of(server), moved)
    np.testing.assert_array_equal(colonnade.Scene.load(file).render(config="tiny", size=SIZE).pixels, moved)
    lines = FRAMING.replace("direction = [0.4, 0.3, 1.0]\n", "").splitlines()
    written = file.read_text().splitlines()
    assert [line for line in written if line in lines] == lines
    assert set(written) - set(lines) == {"position = [1.25, 0.5, 4.0]", "target = [0.0, 0.125, 0.0]"}


def test_a_camera_that_rests_gathers_the_samples_of_render(server: ViewServer, file: Path) -> None:
    """Another camera and another version of the file begin anew."""
    session = server.session
    assert session.still().samples == 1
    last = [session.still(MOVED) for _ in range(STILL_SAMPLES + 1)]
    assert [frame.samples for frame in last] == [*range(1, STILL_SAMPLES + 1), STILL_SAMPLES]
    assert last[-1].final == STILL_SAMPLES
    session.save(MOVED)
    assert session.state(last[-1].version, 5.0)["version"] > last[-1].version
    assert session.still().samples == 1
    whole = colonnade.Scene.load(file).render(config="tiny", size=SIZE, samples=STILL_SAMPLES).pixels
    np.testing.assert_array_equal(last[-1].pixels, whole)
    assert (pixels_of(server, "?still=1") != pixels_of(server)).any()


def test_a_rest_in_a_photo_is_the_picture_of_render(tmp_path: Path) -> None:
    """With the exposure and the coats of gathered light, its filter, and the grain of the photo."""
    shutil.copytree(Path(__file__).parents[3] / "scenes" / "rooms" / "attic", tmp_path / "attic")
    noise = np.random.RandomState(1).normal(128, 8, (480, 640, 3))
    write_png(tmp_path / "attic" / "photo.png", decode_srgb(noise.astype(np.uint8)))
    file = tmp_path / "scene.toml"
    file.write_text(GATHERED)
    size, config = (128, 96), "textured"
    session = Session(file, config, size=size)
    notes = session.state()["notes"]
    assert "room attic shows" in notes[-2] and "the object has the photo's grain" in notes[-1]
    for camera in (None, ViewCamera((0.8, 1.5, 2.4), (0.0, 0.4, 0.0))):
        scene = colonnade.Scene.load(file)
        if camera is not None:
            scene = scene.with_tables(camera={"position": camera.position, "target": camera.target})
        rest = [session.still(camera) for _ in range(4)]
        pictures = [(rest[-1], True)] + [(session.frame(), False)] * (camera is None)
        for picture, denoise in pictures:
            wanted = scene.with_tables(frame={"samples": picture.samples, "denoise": denoise})
            result = wanted.render(config=config, size=size, encoder="live")
            assert result.object_mask.any()
            np.testing.assert_array_equal(picture.pixels, result.pixels)
    session.close()


def test_the_last_picture_stays_while_the_file_is_wrong(server: ViewServer, file: Path) -> None:
    right, version = pixels_of(server), server.session.state()["version"]
    file.write_text(FRAMING.replace("35.0", "350.0"))
    state = server.session.state(version, 5.0)
    assert re.fullmatch(r"scene \S+: camera.fov must be a number from 1 to 150", state["error"])
    np.testing.assert_array_equal(pixels_of(server), right)
    file.write_text(FRAMING.replace("35.0", "70.0"))
    while (state := server.session.state(state["version"], 5.0))["error"]:
        assert "mesh" in state["error"]  # of a file that is half written
    assert (pixels_of(server) != right).any()


def test_requests_of_others_are_refused(server: ViewServer, file: Path) -> None:
    address = server.address
    assert refused(Request(f"{address}frame?camera=1,2"))[0] == 400
    code, text = refused(Request(f"{address}frame?camera=1e5,0,0,0,0,0"))
    assert code == 422 and "the camera is" in text
    assert refused(Request(f"{address}../scene.toml"))[0] == 404
    assert refused(Request(address, headers={"Host": "elsewhere.example"}))[0] == 403
    post = Request(
        f"{address}camera", b"{}", {"Content-Type": "application/json", "Origin": "http://elsewhere.example"}
    )
    assert refused(post)[0] == 403
    assert refused(Request(f"{address}camera", b"{}", {"Content-Type": "text/plain"}))[0] == 404
    assert file.read_text() == FRAMING
    for path in ("", "live.js", "orbit.js", "style.css"):
        assert urlopen(address + path).status == 200
    connection = http.client.HTTPConnection(*server.server_address, timeout=5)
    connection.request("GET", "/events")
    assert b'"triangles": 8' in connection.getresponse().readline()
    connection.close()


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ('mesh.name = "cube"\n', "position = [1.0, 2.0, 3.0]"),
        ('camera = {direction = [1.0, 0.0, 0.0], fov = 30.0} # c\nmesh.name = "cube"\n', "fov = 30.0"),
        ('camera.framing = 0.5 # c\ncamera.fov = 30.0 # f\nmesh.name = "cube"\n', "camera.fov = 30.0 # f"),
        ('[mesh]\nname = "cube"\n[camera]\nposition = [0.0, 0.0, 9.0] # here\n', "position = [1.0, 2.0, 3.0] # here"),
    ],
)
def test_a_camera_in_every_form_of_a_table_is_saved(tmp_path: Path, before: str, after: str) -> None:
    file = tmp_path / "scene.toml"
    file.write_text(before)
    with ledger.opened():  # as of the command, which has read the scene
        save_camera(file, (1, 2, 3), (0, 0, 0.123456))
    assert after in file.read_text()
    camera = colonnade.Scene.load(file).description.camera
    assert camera.position == (1, 2, 3) and camera.target == (0, 0, 0.1235)
    file.write_text("camera = 5")
    with pytest.raises(UserError):
        save_camera(file, (1, 2, 3), (0, 0, 0))
    assert file.read_text() == "camera = 5"
