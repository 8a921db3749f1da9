"""The atlas of a mesh: regions, positions in them, and the colours that faces find there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from colonnade.common.errors import UserError
from colonnade.design.generator import manifest_for
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.materials import MeshMaterial
from colonnade.mesh.materials.mesh import Mesh
from colonnade.mesh.materials.texture import Texture, Wrap
from colonnade.scene_image.atlas import TILE, make_atlas, uv_codes
from colonnade.scene_image.file import SceneImage
from colonnade.scene_image.packer import pack

EDGE = 512
ON = ("geometry.cornerColours=true", "geometry.textureBytes=16384")


def smooth(width: int, height: int, seed: int, wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")) -> Texture:
    """A texture that changes slowly, so that resampling changes its colours little."""
    v, u = np.mgrid[:height, :width] / np.array((height, width))[:, None, None]
    phase = np.random.default_rng(seed).random((3, 2)) * 6
    waves = [0.5 + 0.2 * np.cos(2 * np.pi * u + a) + 0.2 * np.cos(2 * np.pi * v + b) for a, b in phase]
    return Texture(f"smooth {seed}", np.rint(255 * np.stack(waves, axis=-1)).astype(np.uint8), wrap)


def textured(textures: tuple[Texture, ...], positions: np.ndarray) -> Mesh:
    """A sphere whose faces show the textures by turns, at the positions [textures, 3, 2]."""
    mesh = load_mesh("sphere:1")
    index = np.arange(len(mesh.faces)) % len(textures)
    materials = tuple(MeshMaterial(albedo=(1.0, 0.5, 0.25), texture=number) for number in range(len(textures)))
    return replace(
        mesh,
        materials=materials,
        face_materials=index.astype(np.uint8),
        textures=textures,
        corner_uvs=positions[index],
    )


@settings(max_examples=25)
@example(3, 2539)  # a face less than a texel wide
@given(st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_a_point_of_a_face_finds_the_colour_of_its_texture(count: int, seed: int) -> None:
    """Of textures of any size, wrap and number of repeats, times the albedo."""
    random = np.random.default_rng(seed)
    wraps: list[Wrap] = ["repeat", "mirror", "clamp"]
    textures = tuple(
        smooth(*random.integers(100, 400, 2), number, (wraps[random.integers(3)], wraps[random.integers(3)]))
        for number in range(count)
    )
    mesh = textured(textures, random.uniform(-0.7, 1.8, (count, 3, 2)) + random.integers(-3, 3))
    atlas = make_atlas(mesh, mesh.materials, 1.0, EDGE)
    assert atlas is not None and 0.0 < atlas.scale <= 16.0 and mesh.corner_uvs is not None
    weights = random.dirichlet(np.ones(3), len(mesh.faces))
    at = np.einsum("nj,njk->nk", weights, uv_codes(atlas, 3)[:, :, :2] / 8.0).astype(int)
    found = atlas.colours[at[:, 1], at[:, 0]]
    wanted = np.einsum("nj,njk->nk", weights, mesh.corner_uvs)
    for number, texture in enumerate(textures):
        shows = mesh.face_materials == number
        expected = texture.colours(wanted[shows]) * mesh.materials[number].albedo
        # Over half a texel in each direction, of at least 100 · scale a wave, the colours change by so much
        np.testing.assert_allclose(found[shows], expected, atol=0.01 + 0.03 / min(atlas.scale, 1.0))


def test_a_picture_that_fills_the_atlas_is_kept() -> None:
    texture = smooth(EDGE, EDGE, 1)
    halves = np.array([[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)], [(0.0, 0.0), (1.0, 1.0), (0.0, 1.0)]])
    mesh = textured((texture,), halves[:1])
    mesh = replace(mesh, corner_uvs=halves[np.arange(len(mesh.faces)) % 2])
    atlas = make_atlas(mesh, (replace(mesh.materials[0], albedo=(1.0, 1.0, 1.0)),), 1.0, EDGE)
    assert atlas is not None and atlas.scale == 1.0 and atlas.source_bytes == 3 * EDGE * EDGE
    centres = (np.stack(np.meshgrid(np.arange(EDGE), np.arange(EDGE)), axis=-1).reshape(-1, 2) + 0.5) / EDGE
    np.testing.assert_allclose(atlas.colours.reshape(-1, 3), texture.colours(centres), atol=1e-9)
    assert uv_codes(atlas, 3).max() == 8 * EDGE - 1


def test_headroom_darkens_diffuse_faces_and_no_others() -> None:
    mesh = textured((smooth(64, 64, 1),), np.zeros((1, 3, 2)))
    for kind, factor in (("diffuse", 2.0), ("mirror", 1.0)):
        materials = tuple(replace(material, kind=kind) for material in mesh.materials)
        bright, dark = (make_atlas(mesh, materials, headroom, EDGE) for headroom in (1.0, 2.0))
        assert bright is not None and dark is not None
        np.testing.assert_allclose(bright.colours, dark.colours * factor)


def test_a_mesh_with_too_many_textured_materials_is_refused() -> None:
    small = replace(textured((smooth(32, 32, 1), smooth(32, 32, 2)), np.zeros((2, 3, 2))), name="many")
    with pytest.raises(UserError, match="mesh many has 2 textured materials: use at most 1"):
        make_atlas(small, small.materials, 1.0, TILE)


def test_an_image_keeps_its_textures_in_a_file(tmp_path) -> None:  # type: ignore[no-untyped-def]
    manifest = manifest_for("tiny", ON).manifest
    mesh = textured((smooth(64, 48, 1),), np.random.default_rng(1).random((1, 3, 2)))
    image = pack(mesh, manifest)
    read = SceneImage.load(image.save(tmp_path), manifest)
    assert read.header.texture == image.header.texture and read.header.texture is not None
    assert read.header.texture.textures == 1 and read.header.texture.source_bytes == 3 * 64 * 48
    assert sum(memory.bytes for memory in read.header.memories) == 1024 * 4 + 256 * 5 + (16384 - 5248)
    for one, other in zip(read.attributes, image.attributes, strict=True):
        assert one.memory == other.memory
        np.testing.assert_array_equal(one.words, other.words)
    plain = pack(load_mesh("cube"), manifest)
    assert plain.header.texture is not None and not any(section.words.any() for section in plain.attributes)
    with pytest.raises(UserError, match="the hardware has none: take --config small, or set geometry"):
        pack(mesh, manifest_for("tiny").manifest)


@pytest.mark.parametrize(("wrap", "period"), [("repeat", 1), ("mirror", 2)])
def test_whole_periods_between_faces_cost_nothing(wrap: Wrap, period: int) -> None:
    random = np.random.default_rng(2)
    mesh = textured((smooth(200, 200, 1, (wrap, wrap)),), random.random((1, 3, 2)))
    assert mesh.corner_uvs is not None
    moved = mesh.corner_uvs + period * random.integers(-5, 5, (len(mesh.faces), 1, 2))
    atlas = make_atlas(replace(mesh, corner_uvs=moved), mesh.materials, 1.0, EDGE)
    near = make_atlas(mesh, mesh.materials, 1.0, EDGE)
    assert atlas is not None and near is not None and atlas.scale == near.scale
    np.testing.assert_allclose(atlas.uvs, near.uvs, atol=1e-6)
