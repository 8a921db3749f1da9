"""The device image has the words that docs/bus-shell.md says; the simulated shell loads it in test_shell.py."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from colonnade_lab.evaluation.studies.synthetic_attic import write_attic
from live_maps import SMALL_MAPS

from colonnade.cli.main import cli
from colonnade.design.manifest import Manifest
from colonnade.environment.load import load_environment
from colonnade.maps.encoded import EncodedEnvironment
from colonnade.maps.layout import AttributeLayout
from colonnade.maps.live import encode_still
from colonnade.mesh.load import load_mesh
from colonnade.scene_image.device_image import ALIGNMENT, device_image, maps_image
from colonnade.scene_image.environment import map_memories, with_environment
from colonnade.scene_image.file import LoadSection
from colonnade.scene_image.packer import pack

ROOT = Path(__file__).resolve().parents[3]
ROOM = ROOT / "scenes" / "rooms" / "living"


@pytest.fixture(scope="module")
def hardware() -> Manifest:
    return Manifest.load(ROOT / "configs" / "golden" / "small.json")


def test_an_image_has_a_header_and_a_section_for_each_memory(hardware: Manifest) -> None:
    palette = np.arange(256 * 5, dtype=np.uint8).reshape(256, 5)
    image = replace(pack(load_mesh("cube"), hardware), attributes=(LoadSection("albedo.palette", palette),))
    data = device_image(image, hardware)
    words = np.frombuffer(data, dtype="<u4")
    assert data[:8] == b"CLNDLOAD" and len(data) % ALIGNMENT == 0
    assert words[2:4].tolist() == [1, len(data)] and words[12] == 2 and not words[13:32].any()
    assert "".join(f"{word:08x}" for word in words[4:12]) == hardware.format_hash

    record_words = hardware.record_bits // 32
    count = len(image.records)
    assert words[32:36].tolist() == [0, count, 0, 0]
    records = words[36 : 36 + count * record_words]
    assert records.tobytes() == image.records.tobytes()
    rest = words[36 + count * record_words :]
    assert rest[:4].tolist() == [2, 256, 0, 0]
    entries = rest[4 : 4 + 2 * 256].view(np.uint8).reshape(256, 8)
    assert (entries[:, :5] == palette).all() and not entries[:, 5:].any()
    assert not rest[4 + 2 * 256 :].any() and len(rest[4 + 2 * 256 :]) < 32


def test_an_image_of_maps_is_the_device_image_without_the_scene(hardware: Manifest) -> None:
    layout = AttributeLayout.from_config(hardware.config["physicalAttributeMemory"])
    room = load_environment(ROOM)
    maps = EncodedEnvironment(room, encode_still(room, layout, rounds=1))
    scene = pack(load_mesh("cube"), hardware)
    whole, alone = (
        np.frombuffer(each, dtype="<u4")
        for each in (device_image(with_environment(scene, maps, hardware), hardware), maps_image(maps.image, hardware))
    )
    assert alone[2:4].tolist() == [1, 4 * len(alone)] and alone[12] == len(map_memories(hardware))
    assert whole[12] == alone[12] + 1 + len(scene.attributes)
    start = 36 + len(scene.records) * hardware.record_bits // 32
    size = sum(
        4 + shape["depth"] * -(-shape["bits"] // 32)
        for name in map_memories(hardware)
        for shape in (hardware.memories[name],)
    )
    np.testing.assert_array_equal(alone[32 : 32 + size], whole[start : start + size])
    assert not alone[32 + size :].any() and len(alone) - 32 - size < 32


def test_pack_writes_the_maps_of_a_room_alone(tmp_path: Path) -> None:
    write_attic(tmp_path / "attic", 96, 72)
    (tmp_path / "scene.toml").write_text('mesh.name = "cube"\n')
    settings = [word for override in SMALL_MAPS for word in ("--set", override)]
    command = ["pack", tmp_path / "scene.toml", "--output", tmp_path / "out", "--encoder", "live", *settings]
    files = ["--device-image", tmp_path / "image", "--maps-image", tmp_path / "maps"]

    def run(*arguments: object) -> Result:
        return CliRunner().invoke(cli, [str(argument) for argument in arguments])

    refused = run(*command, *files)
    assert refused.exit_code == 2 and "has none: give background.room or --background" in refused.output
    assert not (tmp_path / "maps").exists()
    done = run(*command, *files, "--background", tmp_path / "attic")
    assert done.exit_code == 0, done.output
    whole, alone = ((tmp_path / name).read_bytes() for name in ("image", "maps"))
    assert alone[128:-128] in whole and 128 < len(alone) < len(whole)
