"""Packing: the records represent the mesh in every layout; meshes that do not fit are rejected."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from leaves import leaf_addresses, leaves_of, packed_triangles

from colonnade import _core
from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors
from colonnade.design.generator import manifest_for
from colonnade.design.manifest import Manifest
from colonnade.design.toolchain import project_root
from colonnade.mesh.load import clean_mesh, load_mesh
from colonnade.mesh.materials.mesh import Mesh
from colonnade.scene_image.inspect import dense_line, describe, lost_line, report_lines
from colonnade.scene_image.packer import QuantisedMesh, memory_use, pack, quantise

MakeManifest = Callable[..., Manifest]


def geometric_normals(quantised: QuantisedMesh) -> Floats:
    """Unit normals of the quantised triangles by their winding, float64 [m, 3]."""
    corners = quantised.vertices[quantised.faces].astype(np.int64)
    return unit_vectors(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).astype(np.float64))


@settings(max_examples=40)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 60),
    bits=st.sampled_from([10, 16, 19]),
    size=st.floats(1e-6, 1e6),
    away=st.floats(-1e6, 1e6),
)
def test_quantisation_is_uniform_centred_and_near(seed: int, count: int, bits: int, size: float, away: float) -> None:
    generator = np.random.default_rng(seed)
    vertices = generator.normal(size=(3 * count, 3)) * size + away
    try:
        mesh = clean_mesh(vertices, np.arange(3 * count, dtype=np.int32).reshape(-1, 3), "random")
        result = quantise(mesh, bits)
    except UserError:
        return  # too small for its distance from the origin
    maximum = (1 << bits) - 1
    assert result.vertices.min() >= 0 and result.vertices.max() <= maximum
    assert np.ptp(result.vertices, axis=0).max() >= maximum - 1
    exact = (mesh.vertices - np.array(result.frame.offset)) * result.frame.scale
    rounding = np.abs(mesh.vertices).max() * result.frame.scale * 1e-15
    assert np.abs(exact - result.vertices).max() <= 0.5 + 1e-3 + rounding
    assert (geometric_normals(result) != 0).any(axis=1).all()


def test_faces_that_lose_their_area_are_dropped() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1e-9, 0, 0], [1, 1, 0]])
    mesh = clean_mesh(vertices, np.array([[0, 3, 2], [0, 1, 2], [1, 4, 2], [3, 1, 2]], dtype=np.int32), "thin")
    result = quantise(mesh, 16)
    assert len(mesh.faces) == 4
    assert result.mesh_faces.tolist() == [1, 2]


def test_nothing_left_is_refused() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [2, 1e-7, 0]])
    with pytest.raises(UserError, match=r"geometry\.vertexBits"):
        quantise(clean_mesh(vertices, np.array([[0, 1, 2]], dtype=np.int32), "needle"), 16)


@pytest.mark.parametrize("vertex_bits", [10, 16, 19])
def test_records_hold_the_mesh_with_any_tree_or_none(make_manifest: MakeManifest, vertex_bits: int) -> None:
    """The leaves have the same order with and without a tree."""
    mesh = load_mesh("sphere:3")
    quantised = quantise(mesh, vertex_bits)
    leaves = []
    for children, bvh in ((4, True), (2, True), (4, False)):
        manifest = make_manifest(vertex_bits=vertex_bits, bvh=bvh)
        image = pack(mesh, manifest, children=children)
        assert image.records.shape == (image.header.record_count, manifest.record_bits // 8)
        leaves.append(image.records[leaf_addresses(image)].tobytes())
        ids, triangles = packed_triangles(image, manifest)
        np.testing.assert_array_equal(np.flatnonzero(image.source_faces >= 0), ids)
        faces = np.full(image.header.source_triangles, -1)
        faces[mesh.source_faces] = np.arange(len(mesh.faces))
        faces = faces[image.source_faces[ids]]
        assert sorted(faces.tolist()) == sorted(quantised.mesh_faces.tolist())
        for face, corners in zip(faces, triangles.tolist(), strict=True):
            source = quantised.vertices[mesh.faces[face]].tolist()
            assert corners in [source[j:] + source[:j] for j in range(3)]
    assert leaves[0] == leaves[2]


def test_nodes_reach_every_leaf_and_only_those(manifest: Manifest) -> None:
    image = pack(load_mesh("teapot:4"), manifest)
    header = image.header
    fields = manifest.layouts["node"].unpack(image.records)
    nodes, leaves = [0], []
    for node in nodes:
        first, below = int(fields["first"][node]), int(fields["nodes"][node])
        assert first > node
        nodes += range(first, first + below)
        leaves += range(first + below, first + below + int(fields["leaves"][node]))
    assert (len(nodes), len(leaves)) == (header.nodes, header.leaves)
    assert sorted(leaves) == leaf_addresses(image).tolist()
    assert sorted(nodes + leaves) == list(range(header.record_count))


def test_leaves_hold_the_normals_of_their_corners(manifest: Manifest) -> None:
    mesh = load_mesh("torus:15")
    image = pack(mesh, manifest)
    quantised = quantise(mesh, 16)
    flat = geometric_normals(quantised)
    ids, leaves = leaves_of(image, manifest)
    for i, face in enumerate(image.source_faces[ids]):
        corners = quantised.vertices[mesh.faces[face]].tolist()
        order = [corners.index(corner) for corner in leaves["vertices"][i].tolist()]
        np.testing.assert_allclose(leaves["normals"][i], mesh.corner_normals[face, order] * 2047, atol=22)
        np.testing.assert_allclose(leaves["geometric"][i], flat[face] * 2047, atol=22)
        assert leaves["material"][i] == 0


def test_the_box_is_tight(manifest: Manifest) -> None:
    header = pack(load_mesh("teapot"), manifest).header
    assert header.bounds_low[0] == 0 and header.bounds_high[0] == 65535
    assert 0 < header.bounds_low[1] < header.bounds_high[1] < 65535


def test_one_triangle_and_a_flat_square(make_manifest: MakeManifest) -> None:
    for name, count in (("triangle", 1), ("square", 2)):
        for children, bvh in ((4, True), (2, True), (4, False)):
            manifest = make_manifest(bvh=bvh)
            image = pack(load_mesh(name), manifest, children=children)
            assert image.header.triangles == count
            assert image.header.record_count == (2 if manifest.bvh else 1)


def test_too_many_records_are_refused(make_manifest: MakeManifest) -> None:
    with pytest.raises(
        UserError,
        match=r"teapot needs 4,\d\d\d records, columnBvhMemory.depth is 4,300: raise columnBvhMemory.depth to 8192,"
        r" simplify the mesh \(--simplify\), or take a preset whose scene lies in DRAM, such as edge$",
    ):
        pack(load_mesh("teapot"), make_manifest(depth=4300))


def test_a_mesh_that_is_far_too_large_is_refused_before_its_tree_is_built(
    make_manifest: MakeManifest, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_core, "Packing", None)
    with pytest.raises(
        UserError,
        match=r"mesh teapot has 6,\d\d\d triangles, the 2,048 records of columnBvhMemory.depth hold 3,072 at most:"
        " raise columnBvhMemory.depth to 8192, simplify the mesh",
    ):
        pack(load_mesh("teapot"), make_manifest(depth=2048))


@pytest.mark.parametrize("triangles", [190_000, pytest.param(1_000_000, marks=pytest.mark.matrix)])
def test_a_preset_with_its_scene_in_dram_takes_a_large_mesh(triangles: int) -> None:
    manifest = manifest_for("edge").manifest
    header = pack(load_mesh(f"sphere:{triangles}"), manifest).header
    assert header.record_count > 1 << 17
    (memory,) = (line for line in report_lines(header, manifest) if line.startswith("memory"))
    size = -(-header.record_count // 4) * 128
    assert memory.endswith(f"({size:,} bytes of DRAM, {size / header.triangles:.1f} a triangle)")


def test_presets_with_their_scenes_in_dram_have_addresses_of_21_bits() -> None:
    memories = [json.loads(file.read_text())["columnBvhMemory"] for file in (project_root() / "configs").glob("*.json")]
    assert {memory["depth"] for memory in memories if memory["cache"]} == {1 << 21}


def test_too_deep_a_tree_is_refused(make_manifest: MakeManifest) -> None:
    with pytest.raises(UserError, match=r"teapot needs a stack of \d+ entries.*stackDepth is 8: raise"):
        pack(load_mesh("teapot"), make_manifest(stack_depth=8))
    # Without a BVH there is no stack.
    assert pack(load_mesh("teapot"), make_manifest(stack_depth=8, bvh=False)).header.tree is None


def test_a_short_stack_gets_a_balanced_tree(make_manifest: MakeManifest) -> None:
    mesh = load_mesh("teapot")
    free = pack(mesh, make_manifest(), children=2).header.tree
    assert free is not None and free.height_limit == 0
    tree = pack(mesh, make_manifest(stack_depth=free.stack_bound - 1), children=2).header.tree
    assert tree is not None
    assert tree.stack_bound < free.stack_bound
    assert tree.height_limit > 0


def test_reports(make_manifest: MakeManifest) -> None:
    for changes in ({}, {"bvh": False}):
        manifest = make_manifest(**changes)
        image = pack(load_mesh("cube"), manifest)
        use = memory_use(image.header, manifest)["columnBvhMemory"]
        assert use["nodes"] + use["triangles"] + use["attributes"] == use["records"] == image.header.record_count
        assert describe(image)["mesh"]["triangles"] == 12
        assert any("tree" in line for line in report_lines(image.header, manifest))


@pytest.mark.parametrize(
    ("source", "said"),
    [
        (12, "12 triangles"),
        (2000, "12 triangles (1,988 dropped)"),
        (5, "12 triangles, 5 in the file: normal maps and alpha split faces"),
    ],
)
def test_a_report_tells_dropped_faces_from_split_ones(make_manifest: MakeManifest, source: int, said: str) -> None:
    header = pack(replace(load_mesh("cube"), source_count=source), make_manifest()).header
    assert report_lines(header)[0] == f"mesh        cube: {said}"


def two_sided(mesh: Mesh) -> Mesh:
    """A mesh with each face twice, once reversed."""
    return clean_mesh(mesh.vertices, np.concatenate([mesh.faces, mesh.faces[:, ::-1]]), mesh.name)


def test_the_other_side_of_a_face_is_the_same_face(manifest: Manifest) -> None:
    mesh = two_sided(load_mesh("octahedron"))
    assert (len(mesh.faces), mesh.source_count) == (8, 16)
    assert pack(mesh, manifest).header.triangles == 8


def test_a_large_mesh_on_few_pixels_gets_a_line(manifest: Manifest) -> None:
    header = replace(pack(load_mesh("cube"), manifest).header, triangles=400_001)
    line = dense_line(header, 100_000)
    assert line is not None and line.startswith("mesh cube has more than four triangles for each pixel")
    assert dense_line(header, 100_001) is None and dense_line(header, 0) is None
    assert dense_line(replace(header, triangles=100_000), 1) is None


def test_faces_that_the_grid_loses_are_told(manifest: Manifest) -> None:
    """A large face takes the grid from all others."""
    near = load_mesh("sphere:1000")
    faces = np.vstack([near.faces, len(near.vertices) + np.arange(3)])
    far = clean_mesh(np.vstack([near.vertices, 1e6 * np.eye(3)]), faces, "far")
    assert lost_line(pack(near, manifest).header) is None
    line = lost_line(pack(far, manifest).header)
    assert line is not None and line.startswith("mesh far: 980 of 981 faces are left out")
