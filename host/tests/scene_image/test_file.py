"""Scene images round-trip through a file; damaged or foreign files are rejected with the reason."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from colonnade.common.errors import UserError
from colonnade.design.manifest import Manifest
from colonnade.mesh.load import load_mesh
from colonnade.scene_image.file import SceneImage
from colonnade.scene_image.packer import pack

MakeManifest = Callable[..., Manifest]


@pytest.fixture(scope="module")
def image(manifest: Manifest) -> SceneImage:
    return pack(load_mesh("cube"), manifest)


@pytest.mark.parametrize("bvh", [True, False])
def test_an_image_round_trips_through_its_file(tmp_path: Path, make_manifest: MakeManifest, bvh: bool) -> None:
    manifest = make_manifest(bvh=bvh)
    image = pack(load_mesh("torus:9"), manifest)
    file = image.save(tmp_path / "new" / "folder")
    assert file == tmp_path / "new" / "folder" / "scene.image"
    for path in (file, file.parent):
        loaded = SceneImage.load(path, manifest)
        np.testing.assert_array_equal(loaded.records, image.records)
        np.testing.assert_array_equal(loaded.source_faces, image.source_faces)
        for name, value in vars(image.header.extent).items():
            np.testing.assert_array_equal(getattr(loaded.header.extent, name), value)
        same = dataclasses.replace(loaded.header, extent=image.header.extent)
        assert same == image.header


def test_packing_is_reproducible(tmp_path: Path, manifest: Manifest) -> None:
    files = [pack(load_mesh("teapot:3"), manifest).save(tmp_path / name) for name in ("a", "b")]
    assert files[0].read_bytes() == files[1].read_bytes()


def test_another_format_is_refused(tmp_path: Path, image: SceneImage, make_manifest: MakeManifest) -> None:
    file = image.save(tmp_path)
    with pytest.raises(UserError, match="packed for another format"):
        SceneImage.load(file, make_manifest(vertex_bits=12))


def test_truncated_files_are_refused(tmp_path: Path, image: SceneImage) -> None:
    file = image.save(tmp_path)
    data = file.read_bytes()
    for length in (8, 11, 12, 100, len(data) // 2, len(data) - 32, len(data) - 1):
        file.write_bytes(data[:length])
        with pytest.raises(UserError, match="truncated"):
            SceneImage.load(file)


def test_foreign_files_are_refused(tmp_path: Path) -> None:
    for content in (b"", b"CLND", b"something else entirely, but long enough"):
        (tmp_path / "scene.image").write_bytes(content)
        with pytest.raises(UserError, match="is not a scene image"):
            SceneImage.load(tmp_path)
    with pytest.raises(UserError, match="run colonnade pack first"):
        SceneImage.load(tmp_path / "missing")


def test_appended_bytes_are_refused(tmp_path: Path, image: SceneImage) -> None:
    file = image.save(tmp_path)
    file.write_bytes(file.read_bytes() + b"x")
    with pytest.raises(UserError, match="corrupt"):
        SceneImage.load(file)


@settings(max_examples=100, suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
@given(position=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_every_flipped_bit_is_detected(tmp_path: Path, image: SceneImage, position: float, bit: int) -> None:
    file = image.save(tmp_path)
    data = bytearray(file.read_bytes())
    data[int(position * len(data))] ^= 1 << bit
    file.write_bytes(data)
    with pytest.raises(UserError, match=r"corrupt|truncated|is not a scene image|another version"):
        SceneImage.load(file)
