"""Rooms in the scene image: words round-trip through the file, fit the hardware, and appear in the report."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from colonnade.cli.main import cli
from colonnade.common.errors import UserError
from colonnade.design.manifest import Manifest
from colonnade.environment.load import load_environment
from colonnade.maps.encoded import EncodedEnvironment, layout_of
from colonnade.maps.image import AttributeImage, memory_words
from colonnade.mesh.load import load_mesh
from colonnade.scene_image.environment import map_memories, with_environment
from colonnade.scene_image.file import SceneImage
from colonnade.scene_image.header import LoadedMemory
from colonnade.scene_image.inspect import describe, report_lines
from colonnade.scene_image.packer import memory_use, pack

ROOT = Path(__file__).resolve().parents[3]
#: Array types of words by width.
WORDS = ((16, np.uint16), (32, np.uint32), (64, np.uint64))


@pytest.fixture(scope="module")
def hardware() -> Manifest:
    return Manifest.load(ROOT / "configs" / "golden" / "small.json")


@pytest.fixture(scope="module")
def held(hardware: Manifest) -> EncodedEnvironment:
    """A room with random words."""
    random, memories = np.random.default_rng(5), dict[str, dict[str, Any]]()
    for name, place in hardware.memories.items():
        part, _, memory = name.partition(".")
        if memory:
            kind = next((kind for width, kind in WORDS if int(place["bits"]) <= width), np.uint64)
            parts = -(-int(place["bits"]) // 64)
            words = random.integers(0, 1 << 64, (int(place["depth"]), parts), dtype=np.uint64)
            words[:, -1] &= np.uint64((1 << (int(place["bits"]) - 64 * (parts - 1))) - 1)
            memories.setdefault(part, {})[memory] = (words if parts > 1 else words[:, 0]).astype(kind)
    return EncodedEnvironment(
        load_environment(ROOT / "scenes" / "rooms" / "attic"),
        AttributeImage.from_memories(layout_of(hardware), memories, 1.25),
    )


@pytest.fixture(scope="module")
def image(hardware: Manifest, held: EncodedEnvironment) -> SceneImage:
    return with_environment(pack(load_mesh("cube"), hardware), held, hardware)


def test_all_memories_round_trip_through_the_file(
    tmp_path: Path, hardware: Manifest, held: EncodedEnvironment, image: SceneImage
) -> None:
    loaded = SceneImage.load(image.save(tmp_path), hardware)
    assert loaded.header.room == image.header.room
    assert loaded.header.room is not None and loaded.header.room.depth_unit == 1.25
    assert {section.memory for section in loaded.attributes} == set(hardware.memories) - {"columnBvh", "light.cube"}
    maps = loaded.attributes[: len(map_memories(hardware))]
    for section, (memory, words) in zip(maps, memory_words(held.image), strict=True):
        place, width = hardware.memories[memory], section.words.shape[1]
        assert section.memory == memory
        assert section.words.shape == (place["depth"], -(-place["bits"] // 8))
        np.testing.assert_array_equal(section.words, words[:, :width])
        assert not words[:, width:].any()
    np.testing.assert_array_equal(loaded.source_faces, image.source_faces)
    np.testing.assert_array_equal(loaded.records, image.records)


def test_a_file_that_lacks_words_or_has_others_is_refused(tmp_path: Path, image: SceneImage) -> None:
    file = image.save(tmp_path)
    data = bytearray(file.read_bytes())
    file.write_bytes(data[:-33])
    with pytest.raises(UserError, match="truncated"):
        SceneImage.load(file)
    data[-40] ^= 4
    file.write_bytes(data)
    with pytest.raises(UserError, match="corrupt"):
        SceneImage.load(file)
    file.write_bytes(b"CLNDIMG1" + data[8:])
    with pytest.raises(UserError, match="of another version: pack the scene again"):
        SceneImage.load(file)


def test_maps_that_do_not_fill_the_memories_are_refused(tmp_path: Path, hardware: Manifest, image: SceneImage) -> None:
    """Rejected despite a correct checksum: extra words would be lost, missing words undefined."""
    environment, first = image.header.room, image.attributes[0]
    assert environment is not None
    place = f"for the memory '{first.memory}'"
    for words in (first.words[:-1], np.vstack((first.words, first.words[:1])), first.words[:, :-1], None):
        others = (image.attributes[1:], environment.memories[1:])
        sections, memories = others
        if words is not None:
            words = np.ascontiguousarray(words)
            sections = (replace(first, words=words), *sections)
            memories = (LoadedMemory(first.memory, *words.shape), *memories)
        header = replace(image.header, room=replace(environment, memories=memories))
        file = replace(image, header=header, attributes=sections).save(tmp_path)
        with pytest.raises(UserError, match=place):
            SceneImage.load(file, hardware)
        SceneImage.load(file)


def test_inspect_reports_tiles_beyond_their_heap(tmp_path: Path, image: SceneImage) -> None:
    """One line if there are any, else none."""
    legal = tuple(
        replace(section, words=np.zeros_like(section.words)) if "descriptors" in section.memory else section
        for section in image.attributes
    )
    # Mode 7, four entries, 32 words before the end: one of its 33 words lies beyond; one word earlier none does
    sections = []
    for section in legal:
        words = section.words.copy()
        if section.memory == "albedo.descriptors":
            depth = next(len(s.words) for s in legal if s.memory == "albedo.heap")
            for tile, pointer in enumerate((depth - 32, depth - 33, 8191)):
                words[tile] = np.frombuffer((pointer << 3 | 7).to_bytes(4, "little"), dtype=np.uint8)
        sections.append(replace(section, words=words))
    for attributes, line in ((legal, ""), (tuple(sections), "tiles point beyond their heap, 2 of albedo:")):
        json_file = tmp_path / "report.json"
        replace(image, attributes=attributes).save(tmp_path)
        result = CliRunner().invoke(cli, ["inspect", str(tmp_path), "--json", str(json_file)])
        assert result.exit_code == 0, result.output
        assert line in result.output and ("warning" in result.output) == bool(line)
        counts = json.loads(json_file.read_text())["room"]["tiles_beyond_heap"]
        assert counts == {"albedo": 2 if line else 0, "normals": 0, "planes": 0}


def test_words_without_a_memory_are_a_bug(hardware: Manifest, held: EncodedEnvironment) -> None:
    planes = held.image.planes
    for changed in (
        replace(planes, heap=planes.heap[:-1]),
        replace(planes, bounding=planes.bounding | np.uint64(1 << 40)),
    ):
        wrong = EncodedEnvironment(held.environment, replace(held.image, planes=changed))
        with pytest.raises(ValueError, match="do not fit"):
            with_environment(pack(load_mesh("cube"), hardware), wrong, hardware)


def test_the_report_has_the_bytes_of_each_map(hardware: Manifest, image: SceneImage) -> None:
    use = memory_use(image.header, hardware)["physicalAttributeMemory"]
    assert {name: part["bytes"] for name, part in use.items()} == {"albedo": 16384, "normals": 16384, "planes": 12288}
    assert use["albedo"]["source_bytes"] == 921600 and use["albedo"]["ratio"] == pytest.approx(56.25)
    lines = "\n".join(report_lines(image.header, hardware))
    assert "16,384 bytes of memory, a 56.2x reduction from the map's 921,600" in lines
    assert "planes.bounding         8 words of 17 bytes, load target 10" in lines
    assert "albedo.palette" in "\n".join(report_lines(image.header))
    assert json.loads(json.dumps(describe(image)))["room"]["name"] == "attic"


def test_pack_rejects_a_room_without_attribute_memory(tmp_path: Path) -> None:
    """As `render` does; no file is written."""
    scene = tmp_path / "scene.toml"
    scene.write_text('[mesh]\nname = "cube"\n')
    environment = ROOT / "scenes" / "rooms" / "attic"
    arguments = ["pack", str(scene), "--background", str(environment), "--output", str(tmp_path / "packed")]
    result = CliRunner().invoke(cli, [*arguments, "--config", "tiny"])
    assert result.exit_code == 2
    assert "no memory for a room: set physicalAttributeMemory" in result.output
    assert not (tmp_path / "packed").exists()
