"""Files of a release stay readable, and files of a newer one are refused in one line (docs/release.md).

The folder `data/formats` holds what this command wrote, and the manifest of its configuration:

    colonnade pack host/tests/data/formats/scene.toml --config host/tests/data/formats/config.json
        --output host/tests/data/formats --frame-file host/tests/data/formats/frame.bin
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from colonnade.common.errors import UserError
from colonnade.design.manifest import VERSION, Manifest
from colonnade.device.bit_exact import render_model
from colonnade.registers.frame_file import read_frame_file
from colonnade.scene.model import MeshSource, Scene
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene_image.file import SceneImage

DATA = Path(__file__).parents[1] / "data" / "formats"
ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def manifest() -> Manifest:
    return Manifest.load(DATA)


def test_a_frame_of_the_files(manifest: Manifest) -> None:
    image = SceneImage.load(DATA, manifest)
    registers = read_frame_file((DATA / "frame.bin").read_bytes(), manifest)
    frame = render_model(manifest, image, registers)
    assert frame.triangle.shape == (registers["frame.height"], registers["frame.width"])
    assert 0.1 < (frame.triangle >= 0).mean() < 0.9


def test_an_older_manifest_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "manifest.json"
    file.write_text(json.dumps({"version": VERSION - 1}))
    with pytest.raises(
        UserError, match=rf"^the manifest has the formats of version {VERSION - 1}, .*: generate it again$"
    ):
        Manifest.load(file)


def test_a_newer_manifest_is_refused(tmp_path: Path) -> None:
    data = json.loads((DATA / "manifest.json").read_text())
    file = tmp_path / "manifest.json"
    file.write_text(json.dumps({"version": VERSION + 1, "novel": data}))
    with pytest.raises(UserError, match=f"^the manifest has version {VERSION + 1}, this host reads {VERSION} at most"):
        Manifest.load(file)


def test_a_newer_scene_image_is_refused(tmp_path: Path) -> None:
    content = (DATA / "scene.image").read_bytes()
    file = tmp_path / "scene.image"
    file.write_bytes(content[:7] + bytes([content[7] + 1]) + content[8:])
    with pytest.raises(UserError, match=r"is a scene image of another version: pack the scene again$"):
        SceneImage.load(file)


class Recorder(Mapping[str, int]):
    """Numbers that remember which of them were read."""

    def __init__(self, numbers: Mapping[str, int]) -> None:
        self.numbers, self.read = numbers, set[str]()

    def __getitem__(self, name: str) -> int:
        self.read.add(name)
        return self.numbers[name]

    def __iter__(self) -> Iterator[str]:
        raise AssertionError("all numbers are read")

    def __len__(self) -> int:
        return len(self.numbers)


def test_the_format_hash_covers_the_numbers_of_images() -> None:
    """Packer and registers read no number that the generator leaves out of the hash."""
    source = (ROOT / "src/main/scala/colonnade/config/NumberFormats.scala").read_text()
    (block,) = re.findall(r"def ofImages.*?Seq\((.*?)\n  \)", source, re.DOTALL)
    hashed = set(re.findall(r'"(\w+)"', block))
    golden = Manifest.load(ROOT / "configs" / "golden" / "small.json")
    recorder = Recorder(golden.numbers)
    design = replace(golden, numbers=recorder)
    scene = Scene(MeshSource(name="cube")).with_environment(ROOT / "scenes" / "rooms" / "living")
    DeviceScene.of(scene, design, encoder="live").registers((64, 48))
    assert recorder.read <= hashed
    assert len(recorder.read) > 12
