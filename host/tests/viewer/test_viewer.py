"""`colonnade view`: its frames are `render`'s, an edited file is loaded, the camera is saved into it."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any
from urllib.request import Request, urlopen

import numpy as np

import colonnade
from colonnade.common.image_io import decode_srgb, write_png
from colonnade.viewer.server import ViewServer
from colonnade.viewer.session import STILL_SAMPLES, Session, ViewCamera

GATHERED = """mesh = {name = "teapot:2"}
background = {room = "attic"}
object = {stand_at = [200, 320], size = 0.6}
material = {kind = "diffuse", albedo = [0.3, 0.5, 0.2], roughness = 0.3}
light = {position = [0.6, 2.2, 0.6], falloff = 1.5}
paths = {gather = 1}
frame = {samples = 4, denoise = true}
"""
MOVED = ViewCamera((1.25, 0.5, 4.0), (0.0, 0.125, -0.0))


def pixels_of(server: ViewServer, query: str = "") -> np.ndarray:
    with urlopen(f"{server.address}frame{query}") as answer:
        figures = json.loads(answer.headers["X-Frame"])
        assert (figures["width"], figures["height"]) == server.session.size and figures["rays"] > 0
        return np.frombuffer(answer.read(), np.uint8).reshape(figures["height"], figures["width"], 4)[..., :3]


def rendered(file: Path, **options: Any) -> np.ndarray:
    return colonnade.Scene.load(file).render(config="tiny", size=(48, 36), **options).pixels


def test_the_page_shows_what_render_shows_and_saves_its_camera(server: ViewServer, file: Path) -> None:
    text = file.read_text()
    np.testing.assert_array_equal(pixels_of(server), rendered(file))
    query = "?camera=" + ",".join(map(str, [*MOVED.position, *MOVED.target]))
    moved = pixels_of(server, query)
    body = json.dumps({"position": MOVED.position, "target": MOVED.target}).encode()
    before = server.session.state()["version"]
    urlopen(Request(f"{server.address}camera", body, {"Content-Type": "application/json"})).close()
    assert server.session.state(before, 5.0)["camera"]["position"] == MOVED.position
    np.testing.assert_array_equal(pixels_of(server), moved)
    np.testing.assert_array_equal(rendered(file), moved)
    lines = text.replace("direction = [0.4, 0.3, 1.0]\n", "").splitlines()
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
    np.testing.assert_array_equal(last[-1].pixels, rendered(file, samples=STILL_SAMPLES))
    assert (pixels_of(server, "?still=1") != pixels_of(server)).any()


def test_a_rest_in_a_photo_is_the_picture_of_render(tmp_path: Path) -> None:
    """With the exposure and the coats of gathered light, its filter, and the grain of the photo."""
    shutil.copytree(Path(__file__).parents[3] / "scenes" / "rooms" / "attic", tmp_path / "attic")
    noise = np.random.RandomState(1).normal(128, 8, (480, 640, 3))
    write_png(tmp_path / "attic" / "photo.png", decode_srgb(noise.astype(np.uint8)))
    file = tmp_path / "scene.toml"
    file.write_text(GATHERED)
    size, config = (128, 96), "small"
    session = Session(file, config, size=size)
    notes = session.state()["notes"]
    (line,) = [note for note in notes if note.startswith("room attic: ")]
    assert "directions of light seen" in line and "the photo's grain of" in line
    for camera in (None, ViewCamera((0.8, 1.5, 2.4), (0.0, 0.4, 0.0))):
        scene = colonnade.Scene.load(file)
        if camera is not None:
            scene = scene.with_tables(camera={"position": camera.position, "target": camera.target})
        picture = [session.still(camera) for _ in range(4)][-1]
        wanted = scene.with_tables(frame={"samples": picture.samples, "denoise": True})
        result = wanted.render(config=config, size=size, encoder="live")
        assert result.object_mask.any()
        np.testing.assert_array_equal(picture.pixels, result.pixels)
    session.close()


def test_the_last_picture_stays_while_the_file_is_wrong(server: ViewServer, file: Path) -> None:
    right, version = pixels_of(server), server.session.state()["version"]
    text = file.read_text()
    file.write_text(text.replace("35.0", "350.0"))
    state = server.session.state(version, 5.0)
    assert re.fullmatch(r"scene \S+: camera.fov must be a number from 1 to 150", state["error"])
    np.testing.assert_array_equal(pixels_of(server), right)
    file.write_text(text.replace("35.0", "70.0"))
    while (state := server.session.state(state["version"], 5.0))["error"]:
        assert "mesh" in state["error"]  # of a file that is half written
    assert (pixels_of(server) != right).any()
