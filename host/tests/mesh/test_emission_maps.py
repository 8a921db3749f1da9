"""Emission maps of glTF files: what faces emit, and pieces of faces on which a map varies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from textured_files import gltf

from colonnade.common.srgb import linear_from_srgb
from colonnade.mesh.files.gltf_emission import emission_of, emission_pieces
from colonnade.mesh.geometry.topology import MAX_SPLIT_FACES
from colonnade.mesh.load import clean_mesh, load_mesh
from colonnade.mesh.materials.surface import RawSurface, joined
from colonnade.mesh.materials.texture import Texture


def test_a_face_emits_what_its_map_does(tmp_path: Path) -> None:
    surface = {"baseColorTexture": {"index": 0}, "metallicFactor": 0}
    glowing = {"pbrMetallicRoughness": surface, "emissiveFactor": [1, 0.5, 1], "emissiveTexture": {"index": 0}}
    half = np.zeros((8, 8, 3), np.uint8)
    half[:, 4:] = 255
    for pixels, factor in ((half[:, ::-1], (1.0, 0.5, 1.0)), (half, (0.0, 0.0, 0.0))):
        # The triangle lies on the left, if the right half is shown twice as wide
        transform = {"KHR_texture_transform": {"scale": [0.4, 0.4]}}
        mapped = glowing | {"emissiveTexture": {"index": 0, "extensions": transform}}
        mesh = load_mesh(gltf(tmp_path, pixels, materials=[mapped | {"doubleSided": True}]))
        (material,) = (mesh.materials[index] for index in mesh.face_materials)
        np.testing.assert_allclose(material.emission, factor)
        assert "1 emission map is averaged: a face emits one of four colours" in mesh.notes[0]
    without = [{"attributes": {"POSITION": 0}, "material": 0}]
    mesh = load_mesh(gltf(tmp_path, half, materials=[glowing], meshes=[{"primitives": without}]))
    (material,) = (mesh.materials[index] for index in mesh.face_materials)
    np.testing.assert_allclose(material.emission, (0.5, 0.25, 0.5))


def test_a_bright_map_keeps_its_hue(tmp_path: Path) -> None:
    strong = {"KHR_materials_emissive_strength": {"emissiveStrength": 4.0}}
    glowing = {"emissiveFactor": [1, 0.5, 0.25], "emissiveTexture": {"index": 0}, "doubleSided": True}
    for grey, emission, is_bright in ((255, (1.0, 0.5, 0.25), True), (124, (0.8, 0.4, 0.2), False)):
        pixels = np.full((4, 4, 3), grey, np.uint8)
        found = 4.0 * linear_from_srgb(np.array(grey / 255.0))
        mesh = load_mesh(gltf(tmp_path, pixels, materials=[glowing | {"extensions": strong}]))
        (material,) = (mesh.materials[index] for index in mesh.face_materials)
        np.testing.assert_allclose(material.emission, emission, rtol=0.02)
        assert (found > 1.0) == is_bright == any("1 material shines brighter" in note for note in mesh.notes)


@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 2, 8]))
def test_faces_emit_at_most_four_colours_with_the_mean_of_theirs(seed: int, cells: int) -> None:
    random = np.random.default_rng(seed)
    colours = random.integers(0, 256, (cells, cells, 3), np.uint8)
    pixels = np.repeat(np.repeat(colours, 64 // cells, axis=0), 64 // cells, axis=1)
    corners = random.uniform(0.02, 0.98 / cells - 0.02, (40, 3, 2)) + random.integers(0, cells, (40, 1, 2)) / cells
    texture = Texture("a", pixels)
    emission = emission_of(texture, corners, random.normal(size=(40, 3, 3)))
    assert len(np.unique(emission, axis=0)) <= 4
    if cells <= 2:  # each cell has a colour of its own
        np.testing.assert_allclose(emission, texture.colours(corners.mean(axis=1)), atol=0.13)


def areas_of(corners: np.ndarray) -> np.ndarray:
    return np.asarray(np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1))


def edge_uses(faces: np.ndarray) -> np.ndarray:
    """How many faces have each edge."""
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    return np.asarray(np.unique(edges, axis=0, return_counts=True)[1])


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.3, 1.0]), st.sampled_from([1.0, 0.05]))
def test_pieces_follow_a_map_and_leave_no_crack(seed: int, share: float, factor: float) -> None:
    """On a sphere whose faces share no vertices, as on both sides of a seam."""
    random = np.random.default_rng(seed)
    sphere = load_mesh("sphere:80")
    corners = sphere.vertices[sphere.faces]
    raw = RawSurface(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    shows = random.uniform(size=len(corners)) < share
    texture = Texture("a", np.repeat(np.repeat(random.integers(0, 2, (8, 8, 3), np.uint8) * 255, 8, axis=0), 8, axis=1))
    uvs = 0.5 + 0.4 * corners[..., :2] / np.abs(corners).max()
    pieces = emission_pieces(texture, (factor,) * 3, raw, shows, uvs)
    assert (np.diff(pieces.owners) >= 0).all() and (np.unique(pieces.owners) == np.arange(len(corners))).all()
    np.testing.assert_allclose(pieces.weights.sum(axis=2), 1.0)
    parts = raw.pieces(pieces)
    own = areas_of(parts.vertices[parts.faces])
    np.testing.assert_allclose(np.bincount(pieces.owners, own), areas_of(corners))
    np.testing.assert_array_equal(parts.source_faces, pieces.owners)
    assert parts.source_count == len(corners)
    assert (edge_uses(clean_mesh(parts.vertices, parts.faces.astype(np.int32), "a").faces) == 2).all()
    if factor < 0.1 or not shows.any():  # as good as dark
        assert len(pieces.owners) == len(corners)
        return
    places = np.array([(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.4, 0.3, 0.3), (0.2, 0.6, 0.2), (0.2, 0.2, 0.6)])

    def spread(points: np.ndarray, weights: np.ndarray) -> float:
        """Mean variance of the map inside of faces."""
        inside = texture.colours(((0.9 * places[None] + 0.1 / 3) @ points).reshape(-1, 2)).reshape(len(points), -1, 3)
        return float((inside.var(axis=1).sum(axis=1) * weights).sum() / weights.sum())

    seen = shows[pieces.owners]
    before, after = spread(uvs[shows], areas_of(corners)[shows]), spread(pieces.corners(uvs)[seen], own[seen])
    assert after < 0.3 * before


def test_pieces_stay_within_a_part_of_the_budget() -> None:
    random = np.random.default_rng(1)
    sphere = load_mesh("sphere:20480")
    texture = Texture("a", random.integers(0, 256, (512, 512, 3), np.uint8))
    uvs = sphere.vertices[sphere.faces][..., :2]
    raw = RawSurface(sphere.vertices, sphere.faces.astype(np.int64))
    pieces = emission_pieces(texture, (1.0, 1.0, 1.0), raw, np.ones(len(uvs), bool), uvs)
    more, max_more = len(pieces.owners) - len(uvs), (MAX_SPLIT_FACES - len(uvs)) // 4
    assert 0.9 * max_more < more <= max_more
    large = emission_pieces(
        texture, (1.0, 1.0, 1.0), joined([raw] * 3), np.ones(3 * len(uvs), bool), np.tile(uvs, (3, 1, 1))
    )
    assert len(large.owners) == 3 * len(uvs)


def test_a_face_of_a_file_shows_the_shape_of_its_map(tmp_path: Path) -> None:
    pixels = np.zeros((64, 64, 3), np.uint8)
    pixels[:16, :32] = 255
    glowing = {"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}, "doubleSided": True}
    mesh = load_mesh(gltf(tmp_path, pixels, materials=[glowing]))
    glows = np.array([material.emission[0] for material in mesh.materials])[mesh.face_materials] > 0.5
    areas = areas_of(mesh.vertices[mesh.faces])
    # Of the triangle, half of a square, the upper left eighth of the square
    assert areas[glows].sum() / areas.sum() == pytest.approx(0.25, abs=0.01)
    assert len(mesh.faces) > 100 and mesh.source_count == 1 and not mesh.source_faces.any()


def test_pieces_that_alpha_cuts_are_of_the_faces_of_the_file(tmp_path: Path) -> None:
    pixels = np.zeros((64, 64, 4), np.uint8)
    pixels[:16, :32, :3] = pixels[:32, ..., 3] = 255
    colour = {"baseColorTexture": {"index": 0}, "metallicFactor": 0}
    glowing = {"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}, "doubleSided": True}
    mesh = load_mesh(
        gltf(tmp_path, pixels, materials=[glowing | {"pbrMetallicRoughness": colour, "alphaMode": "MASK"}])
    )
    emission = np.array([material.emission[0] for material in mesh.materials])[mesh.face_materials]
    areas = areas_of(mesh.vertices[mesh.faces])
    # Of the triangle the upper three quarters are left
    assert areas[emission > 0.5].sum() / areas.sum() == pytest.approx(1 / 3, abs=0.02)
    assert mesh.source_count == 1 and not mesh.source_faces.any()


def test_vertices_that_are_no_numbers_are_left_to_the_cleaning() -> None:
    vertices = np.array([(0, 0, 0), (1, 0, 0), (np.nan, 1, 0)])
    texture = Texture("a", np.repeat(np.array([0, 255], np.uint8), 12).reshape(2, 4, 3))
    for raw in (RawSurface(vertices, np.array([[0, 1, 2]])), RawSurface(vertices[:0], np.zeros((0, 3), np.int64))):
        count = len(raw.faces)
        pieces = emission_pieces(texture, (1.0, 1.0, 1.0), raw, np.ones(count, bool), np.ones((count, 3, 2)))
        np.testing.assert_array_equal(pieces.owners, np.arange(count))


@pytest.mark.parametrize(("factor", "roughness"), [(1.0, 3 / 8), (0.05, 0.0)])
def test_smooth_metal_that_glows_is_rough(tmp_path: Path, factor: float, roughness: float) -> None:
    metal = {"metallicRoughnessTexture": {"index": 0}, "roughnessFactor": 0.0}
    glowing = {"pbrMetallicRoughness": metal, "emissiveFactor": [factor] * 3, "emissiveTexture": {"index": 0}}
    mesh = load_mesh(gltf(tmp_path, np.full((2, 2, 3), 255, np.uint8), materials=[glowing]))
    (material,) = (mesh.materials[index] for index in mesh.face_materials)
    assert (material.kind, material.roughness) == ("mirror", roughness)
    assert any(material.emission) == (factor == 1.0)
