"""Pairs: which triangles may share a leaf, and which do."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from leaves import leaf_addresses, packed_triangles
from trees import build_bvh

from colonnade.common.vectors import unit_vectors
from colonnade.design.manifest import Manifest
from colonnade.mesh.load import clean_mesh, load_mesh
from colonnade.scene_image.file import SceneImage
from colonnade.scene_image.packer import pack, quantise


def counts(image: SceneImage, manifest: Manifest) -> list[int]:
    """Triangles of each leaf."""
    section = image.records[leaf_addresses(image)]
    return [int(count) for count in 2 - (manifest.layouts["nearPair"].unpack(section)["format"] == 1)]


def test_pairs_have_a_common_edge_of_opposite_directions_which_comes_first(manifest: Manifest) -> None:
    """Triangles with a common edge of one direction, or a common corner, are leaves of their own."""
    a, b, c, d, e = ([0, 0, 0], [9, 0, 0], [0, 9, 0], [9, 9, 1], [4, 4, 9])
    parts = [[[c, a, b], [d, b, a]], [[a, b, c], [d, a, b]], [[a, b, c], [e, d, c]], [[b, c, a]]]
    away = [[0, 0, 0], [200, 0, 0], [0, 200, 0], [200, 200, 0]]
    corners = np.array([triangle for part in parts for triangle in part], dtype=np.float64)
    corners += np.repeat(np.array(away, dtype=np.float64), [2, 2, 2, 1], axis=0)[:, None]
    mesh = clean_mesh(corners.reshape(-1, 3), np.arange(21, dtype=np.int32).reshape(-1, 3), "pairs")
    mesh = replace(mesh, corner_normals=np.broadcast_to([0.0, 0.0, 1.0], mesh.corner_normals.shape).copy())
    image = pack(mesh, manifest)
    assert sorted(counts(image, manifest)) == [1, 1, 1, 1, 1, 2]
    units, triangles = quantise(mesh, 16), dict(zip(*packed_triangles(image, manifest), strict=True))
    rotated = {}
    for packed, triangle in triangles.items():
        face = int(image.source_faces[packed])
        rotated[face] = (
            units.vertices[units.faces[np.flatnonzero(units.mesh_faces == face)[0]]]
            .tolist()
            .index(triangle[0].tolist())
        )
    assert [rotated[face] for face in range(7)] == [1, 1, 0, 0, 0, 0, 0]
    first, second = (triangles[int(np.flatnonzero(image.source_faces == face)[0])].tolist() for face in (0, 1))
    assert first[:2] == second[1::-1]


@pytest.mark.parametrize("differs", ["material", "normal", "nothing"])
def test_a_pair_has_one_material_and_one_normal_at_each_end_of_its_edge(manifest: Manifest, differs: str) -> None:
    mesh = load_mesh("square")
    if differs == "material":
        mesh = replace(mesh, materials=mesh.materials * 2, face_materials=np.arange(2, dtype=np.uint8))
    if differs == "normal":
        normals = mesh.corner_normals.copy()
        normals[1, :, 0] += 0.1
        mesh = replace(mesh, corner_normals=unit_vectors(normals))
    assert counts(
        pack(mesh, manifest, [replace(m, albedo=(0.1 * k, 0, 0)) for k, m in enumerate(mesh.materials)]), manifest
    ) == ([2] if differs == "nothing" else [1, 1])


def test_most_leaves_of_a_mesh_are_pairs(manifest: Manifest) -> None:
    image = pack(load_mesh("teapot"), manifest)
    found = counts(image, manifest)
    assert sum(count == 2 for count in found) > 0.95 * len(found)
    assert image.records.nbytes < 24 * image.header.triangles


@settings(max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), kept=st.sampled_from([0.5, 0.8, 1.0]))
def test_no_triangle_is_alone_beside_another_one_or_beside_a_pair_that_may_be_divided(seed: int, kept: float) -> None:
    """Triangles of a flat grid with holes, in any order, of which each may be a pair with up to three others."""
    generator = np.random.default_rng(seed)
    size = 9
    vertices = np.stack([*np.meshgrid(np.arange(size), np.arange(size)), np.zeros((size, size))], axis=-1).reshape(
        -1, 3
    )
    corner = (np.arange(size - 1)[:, None] * size + np.arange(size - 1)).ravel()
    quads = corner[:, None] + np.array([0, 1, size + 1, size])
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    faces = generator.permutation(faces)[: round(kept * len(faces))].astype(np.int32)
    tree = build_bvh((vertices * 99).astype(np.int32), faces, children=4, box_bits=7, stack_depth=48)

    beside: dict[int, set[int]] = {face: set() for face in range(len(faces))}
    for one, other in itertools.combinations(range(len(faces)), 2):
        if len(set(faces[one]) & set(faces[other])) == 2:
            beside[one].add(other)
            beside[other].add(one)
    leaves = [
        tree.order[first : first + count].tolist()
        for first, count in zip(tree.leaf_first, tree.leaf_count, strict=True)
    ]
    partner = {one: other for leaf in leaves if len(leaf) == 2 for one, other in (leaf, leaf[::-1])}
    alone = beside.keys() - partner.keys()
    for face in alone:
        assert not beside[face] & alone
        for neighbour in beside[face]:
            assert not (beside[partner[neighbour]] - {face}) & alone
    if kept == 1.0:
        assert len(alone) <= 4
