"""Frames in a room: the model is close to the reference, within the loss of encoding and reconstruction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from colonnade.common.errors import UserError
from colonnade.common.image_io import decode_srgb, encode_srgb
from colonnade.design.toolchain import project_root
from colonnade.environment.load import load_environment
from colonnade.quality.image_metrics import psnr
from colonnade.render.frames import render
from colonnade.render.request import RenderRequest

ROOMS = project_root() / "scenes" / "rooms"
SCENE = """
[mesh]
name = "teapot:4"
[material]
kind = "{kind}"
[object]
stand_at = [318, 300]
size = 0.42
[light]
position = [0.1, 2.2, 1.2]
colour = [0.55, 0.53, 0.48]
falloff = 1.6
[ambient]
colour = [0.32, 0.32, 0.32]
[background]
room = "{room}"
[paths]
gather = 0
"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    file = tmp_path / "room.toml"
    file.write_text(SCENE.format(kind="mirror", room=(ROOMS / "living").as_posix()))
    return file


def test_a_frame_in_a_room_is_near_the_reference(scene: Path) -> None:
    model = render(RenderRequest(scene, "small", (), "model", (320, 240), relit=True))
    reference = render(RenderRequest(scene, "small", (), "reference", (320, 240), relit=True))
    # Their tolerances differ where the room hides the object
    assert np.count_nonzero(model.object_mask != reference.object_mask) <= 2
    # Encoding alone limits the picture of the living room to 30 dB
    assert psnr(encode_srgb(reference.image), encode_srgb(model.image)) > 24
    assert model.report.bytes is not None
    assert model.report.bytes["albedo"] == model.report.bytes["normals"] == 16384


def test_the_photo_changes_only_at_object_and_shadow(scene: Path) -> None:
    photo = load_environment(ROOMS / "living").photo
    assert photo is not None
    result = render(RenderRequest(scene, "small", (), "model", (640, 480), samples=1, encoder="live"))
    before, after = np.rint(decode_srgb(photo) * 65535) / 65535, result.image
    untouched = ~result.object_mask & (np.abs(after - before).max(axis=2) < 1e-9)
    shadow = ~result.object_mask & ~untouched
    np.testing.assert_array_equal(encode_srgb(after)[untouched], photo[untouched])
    assert untouched.mean() > 0.9
    assert shadow.sum() > 200
    assert (after[shadow] <= before[shadow] + 1e-9).all(), "an object only takes light"


def test_a_design_without_attribute_memory_rejects_rooms(scene: Path) -> None:
    with pytest.raises(UserError, match="set physicalAttributeMemory, as in the preset small"):
        render(RenderRequest(scene, "tiny", (), "model", None))
