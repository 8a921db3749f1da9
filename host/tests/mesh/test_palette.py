"""Materials of coloured faces, and their reduction to a device's table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.materials import MeshMaterial
from colonnade.mesh.materials.mesh import Mesh
from colonnade.mesh.materials.palette import MAX_MATERIALS, clustered, coloured_materials, reduced, table_entries
from colonnade.scene.model import MeshSource, Scene
from colonnade.scene.object_mesh import SurfaceFeatures, with_materials


def coloured(colours: np.ndarray, *others: MeshMaterial) -> Mesh:
    """A sphere whose faces have the colours in turn, and then the other materials, a face each."""
    mesh = load_mesh("sphere:2")
    materials = tuple(MeshMaterial(albedo=tuple(map(float, colour))) for colour in colours) + others
    index = np.arange(len(mesh.faces)) % len(colours)
    index[: len(others)] = len(colours) + np.arange(len(others))
    return replace(mesh, materials=materials, face_materials=index.astype(np.uint8))


def test_colours_that_fit_are_kept() -> None:
    mesh = coloured(np.eye(3), MeshMaterial("glass"))
    assert reduced(mesh, 4) == (mesh, None)


def test_similar_colours_are_merged_and_glass_is_kept() -> None:
    colours = np.array([[0.5, 0, 0], [0.51, 0, 0], [0, 0.5, 0], [0, 0.51, 0], [0, 0, 0.5], [0, 0, 0.51]])
    mesh, line = reduced(coloured(colours, MeshMaterial("glass")), 4)
    assert len(mesh.materials) == 4 and mesh.materials[mesh.face_materials[0]].kind == "glass"
    assert line is not None and "7 materials become 4, their colours off by 0." in line and "materials is 4" in line
    shown = np.array([mesh.materials[index].albedo for index in mesh.face_materials[1:]])
    wanted = colours[np.arange(len(mesh.faces)) % 6][1:]
    assert np.abs(shown - wanted).max() < 0.02


def test_colours_of_mirrors_are_merged_among_themselves() -> None:
    tints = [MeshMaterial("mirror", (0.1 * k, 0.5, 0.5)) for k in range(1, 9)]
    mesh, _ = reduced(coloured(np.eye(3), *tints), 6)
    kinds = [material.kind for material in mesh.materials]
    assert len(kinds) == 6 and kinds.count("diffuse") == 3
    assert [mesh.materials[index].kind for index in mesh.face_materials[:9]] == ["mirror"] * 8 + ["diffuse"]


def test_emissions_are_merged_where_they_are_too_many() -> None:
    lamps = [MeshMaterial(albedo=(0.5, 0.5, 0.5), emission=(0.1 * k, 0.1, 0.0)) for k in range(1, 9)]
    mesh, line = reduced(coloured(np.zeros((2, 3)), *lamps), 4)
    found = np.array([mesh.materials[index].emission for index in mesh.face_materials])
    assert len(mesh.materials) == 4 and line is not None
    assert np.abs(found[:8] - [lamp.emission for lamp in lamps]).max() < 0.15
    np.testing.assert_allclose(found[8:], 0.0, atol=1e-9)


def test_equal_materials_are_one() -> None:
    mesh, line = reduced(coloured(np.ones((20, 3))), 2)
    assert len(mesh.materials) == 1 and line is None and not mesh.face_materials.any()


def test_more_kinds_than_materials_are_left_to_the_refusal() -> None:
    mesh = coloured(np.eye(3), MeshMaterial("glass"), MeshMaterial("mirror"))
    assert reduced(mesh, 2) == (mesh, None)


def test_many_colours_become_the_materials_of_a_byte() -> None:
    colours = np.random.default_rng(1).uniform(size=(5000, 3))
    colours[0] = np.nan
    materials, index, count = coloured_materials((MeshMaterial(),), np.zeros(5000, dtype=np.int64), colours)
    assert 200 < len(materials) <= MAX_MATERIALS and 4500 < count < 5000
    assert materials[index[0]] == MeshMaterial()
    shown = np.array([materials[k].albedo for k in index[1:]])
    assert np.sqrt(((shown - colours[1:]) ** 2).mean()) < 0.07


def test_clusters_are_the_colours_themselves_if_they_suffice() -> None:
    colours = np.array([[0.0, 0, 0], [1, 1, 1], [1, 0, 0]])
    centres, nearest = clustered(colours, np.array([1, 5, 2]), 8)
    np.testing.assert_array_equal(centres[nearest], colours)
    assert len(centres) == 3


@pytest.mark.parametrize("count", [1, 2, 7])
def test_clusters_are_no_more_than_asked_for(count: int) -> None:
    colours = np.random.default_rng(2).uniform(size=(100, 3))
    centres, nearest = clustered(colours, np.ones(100, dtype=np.int64), count)
    assert len(centres) == count and nearest.max() < count


def test_textures_and_their_tints_take_one_entry_of_the_table() -> None:
    tints = [MeshMaterial(albedo=(0.1 * k, 0.5, 0.5), texture=k) for k in range(9)]
    others = [MeshMaterial("mirror", texture=3), MeshMaterial(albedo=(0.1, 0.5, 0.5))]
    entries, index = table_entries([*tints, *others])
    assert len(entries) == 3 and index.tolist() == [0] * 9 + [1, 2]


def test_a_full_table_moves_plain_colours_to_corners() -> None:
    colours = np.random.default_rng(3).uniform(size=(60, 3))
    mesh = coloured(colours, MeshMaterial("glass"))
    shown = with_materials(Scene(MeshSource(name="sphere:2")), mesh, SurfaceFeatures(8, corner_colours=True))
    assert len(shown.materials) == 2 and shown.corner_colours is not None
    expected = np.array([mesh.materials[number].albedo for number in mesh.face_materials])
    np.testing.assert_array_equal(shown.corner_colours, np.repeat(expected[:, None], 3, axis=1))
    assert [shown.materials[number].kind for number in shown.face_materials[:2]] == ["glass", "diffuse"]
