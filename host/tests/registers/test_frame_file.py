"""The frame file holds every register of a frame, and is refused if it is not one of this design."""

from __future__ import annotations

import dataclasses

import pytest

from colonnade.design.manifest import Manifest
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.registers.frame_file import frame_file, read_frame_file
from colonnade.scene.model import MeshSource, Scene
from colonnade.scene_image.packer import pack

SCENE = Scene(MeshSource(name="teapot:3"))


@pytest.fixture(scope="module")
def design(manifest: Manifest) -> Manifest:
    return dataclasses.replace(manifest, format_hash="0123abcd" * 8)


@pytest.fixture(scope="module")
def registers(manifest: Manifest) -> dict[str, int]:
    return frame_registers(SCENE, pack(load_mesh("teapot:3"), manifest).header, manifest, 64, 48)


def test_a_frame_file_has_all_registers(design: Manifest, registers: dict[str, int]) -> None:
    assert any(value < 0 for value in registers.values())
    assert read_frame_file(frame_file(registers, design), design) == registers


def test_other_files_are_refused(design: Manifest, registers: dict[str, int]) -> None:
    content = frame_file(registers, design)
    with pytest.raises(ValueError, match="incomplete"):
        read_frame_file(content[:-8], design)
    with pytest.raises(ValueError, match="no frame file"):
        read_frame_file(b"X" + content[1:], design)
    with pytest.raises(ValueError, match="another design"):
        read_frame_file(content[:16] + bytes([content[16] ^ 1]) + content[17:], design)
