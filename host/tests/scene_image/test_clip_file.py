"""Tests of clip files, and of the C that bends meshes by them: against floats, and records read bit by bit."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from animated_documents import arm
from bent_trees import delta_bits, get, pairs, random_tree, read_leaf, swept, walk

from colonnade import _core
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.mesh import Mesh
from colonnade.scene_image.clip_file import clip_file
from colonnade.scene_image.grid_clip import TIME_FRACTION, GridClip, grid_clip

HASH = tuple(range(1, 9))
ROOT = 77


@pytest.fixture(scope="module")
def mesh(tmp_path_factory: pytest.TempPathFactory) -> Mesh:
    return load_mesh(arm().write(tmp_path_factory.mktemp("clips") / "arm.gltf"), animation="bend")


@pytest.fixture(scope="module", params=[16, 19])
def clip(request: pytest.FixtureRequest, mesh: Mesh) -> GridClip:
    return grid_clip(mesh, request.param)


class Bent:
    """A clip, a tree over its leaves, and the C that bends them."""

    def __init__(self, clip: GridClip, vertex_bits: int, leaf_records: int = 1, seed: int = 1) -> None:
        self.clip, self.vertex_bits = clip, vertex_bits
        self.leaves = pairs(clip.corners)
        self.tree = random_tree(len(self.leaves), vertex_bits, ROOT, leaf_records, np.random.default_rng(seed))
        self.file = clip_file(clip, self.tree.clip_tree(vertex_bits, self.leaves), self.tree.places, HASH)
        self.target: Any = _core.TargetMesh(HASH, self.file)

    def refit(self, positions: Any, normals: Any) -> tuple[Any, Any]:
        """The records, and what the refit has found."""
        records = self.tree.records.copy()
        return records, self.target.refit(positions, normals, records.view(np.uint32), ROOT)

    def at(self, time: float) -> tuple[Any, Any]:
        """Positions and normals at a time, seconds."""
        return self.target.skin(self.target.pose(round(time * 2**TIME_FRACTION)))


def bits_of(clip: GridClip) -> int:
    return 16 if max(clip.high) < 1 << 16 else 19


@pytest.fixture(scope="module")
def bent(clip: GridClip) -> Bent:
    return Bent(clip, bits_of(clip))


@pytest.mark.parametrize("time", [0.0, 0.1, 0.37, 0.624, 0.7, 0.99])
def test_skinned_vertices_are_those_of_floats(mesh: Mesh, clip: GridClip, bent: Bent, time: float) -> None:
    assert mesh.clip is not None and mesh.clip_corners is not None
    positions, _ = bent.at(time)
    pose = mesh.clip.pose(time)
    exact = (mesh.clip.vertices(pose.matrices, pose.weights) - np.array(clip.frame.offset)) * clip.frame.scale
    tolerance = mesh.extent.edge * _core.CLIP_TOLERANCE * clip.frame.scale + 2
    assert np.abs(positions[clip.corners] - exact[mesh.clip_corners]).max() <= tolerance
    assert (positions.min(axis=0) >= clip.low).all() and (positions.max(axis=0) <= clip.high).all()


def test_the_rest_pose_has_the_vertices_and_normals_of_the_mesh(mesh: Mesh, clip: GridClip, bent: Bent) -> None:
    positions, normals = bent.target.skin(clip.rest.astype(np.int32))
    exact = (mesh.vertices - np.array(clip.frame.offset)) * clip.frame.scale
    assert np.abs(positions[clip.corners] - exact[mesh.faces]).max() <= 1.0
    cosines = (_directions(normals)[clip.corners] * mesh.corner_normals).sum(axis=2)
    assert np.degrees(np.arccos(np.clip(cosines, -1, 1))).max() < 0.15


def test_normals_turn_with_their_surface(mesh: Mesh, clip: GridClip, bent: Bent) -> None:
    # Of the mirrored box, which turns as a whole, and is flat
    is_box = np.flatnonzero((mesh.vertices[mesh.faces][:, :, 0] < -1.9).all(axis=1))
    assert len(is_box) == 2
    for time in (0.2, 0.5, 0.9):
        positions, normals = bent.at(time)
        x, y, z = (positions[clip.corners[is_box, corner]].astype(float) for corner in range(3))
        rest = _across(*np.moveaxis(mesh.vertices[mesh.faces[is_box]], 1, 0))
        sides = np.sign((rest * mesh.corner_normals[is_box, 0]).sum(axis=1))
        across = _across(x, y, z) * sides[:, None]
        assert ((_directions(normals)[clip.corners[is_box]] * across[:, None]).sum(axis=2) > 0.9).all()


def _across(x: Any, y: Any, z: Any) -> Any:
    found = np.cross(y - x, z - x)
    return found / np.linalg.norm(found, axis=1)[:, None]


def _directions(codes: Any) -> Any:
    u, v = codes[..., 0].astype(float), codes[..., 1].astype(float)
    z = 1023 - np.abs(u) - np.abs(v)
    x = np.where(z < 0, np.where(u < 0, -1, 1) * (1023 - np.abs(v)), u)
    y = np.where(z < 0, np.where(v < 0, -1, 1) * (1023 - np.abs(u)), v)
    found = np.stack([x, y, z], axis=-1)
    return found / np.linalg.norm(found, axis=-1, keepdims=True)


def _check(bent: Bent, positions: Any, normals: Any, records: Any, found: Any) -> int:
    """Every leaf holds its vertices, and every box what is below it. Answers the flat pairs."""
    flat, leaf, boxes = 0, 0, {ROOT: None}
    for node in walk(records, ROOT, bent.tree):
        for (address, is_node), box in zip(node.children, node.boxes, strict=True):
            own = boxes[node.address]
            assert own is None or all(a >= b for a, b in zip(box[0], own[0], strict=True))
            assert own is None or all(a <= b for a, b in zip(box[1], own[1], strict=True))
            if is_node:
                boxes[address] = box
                continue
            vertices = bent.leaves[leaf][: 3 if bent.leaves[leaf][3] < 0 else 4]
            read = read_leaf(records[address - ROOT], address, bent.tree.places, bent.vertex_bits)
            assert read.vertices == positions[vertices].tolist()
            codes = normals[vertices] & (~1 if read.format == 3 else ~0)
            assert read.format == 2 or read.codes == [tuple(code) for code in codes.tolist()]
            assert (np.array(read.vertices) >= box[0]).all() and (np.array(read.vertices) <= box[1]).all()
            flat += read.format == 2
            leaf += 1
    assert leaf == len(bent.leaves) and found[2] == flat
    assert list(found[0]) == positions[bent.leaves[bent.leaves >= 0]].min(axis=0).tolist()
    assert list(found[1]) == positions[bent.leaves[bent.leaves >= 0]].max(axis=0).tolist()
    return flat


@pytest.mark.parametrize("leaf_records", [1, 2])
def test_a_refit_writes_all_vertices_and_boxes(clip: GridClip, leaf_records: int) -> None:
    for seed in range(4):
        bent = Bent(clip, bits_of(clip), leaf_records, seed)
        for time in (0.0, 0.3, 0.9):
            positions, normals = bent.at(time)
            records, found = bent.refit(positions, normals)
            _check(bent, positions, normals, records, found)
            np.testing.assert_array_equal(records, swept(records, ROOT, bent.tree, bent.vertex_bits))
            again = records.copy()
            bent.target.refit(positions, normals, again.view(np.uint32), ROOT)
            np.testing.assert_array_equal(records, again)


def test_what_does_not_bend_stays(bent: Bent) -> None:
    records, _ = bent.refit(*bent.at(0.4))
    places = bent.tree.places
    for node in walk(records, ROOT, bent.tree):
        for address, is_node in node.children:
            layout, names = ("node", ("first", "leaves", "nodes")) if is_node else ("nearPair", ("material", "isClear"))
            for place in (places[layout][name] for name in names):
                assert get(bent.tree.records[address - ROOT], place) == get(records[address - ROOT], place)


def test_stretched_pairs_go_far_then_flat_and_keep_every_vertex(clip: GridClip, bent: Bent) -> None:
    positions, normals = bent.at(0.0)
    formats = set()
    for factor in (0.002, 0.3, 1.0):
        middle = positions.mean(axis=0)
        scaled = np.rint(middle + (positions - middle) * factor).astype(np.int32)
        records, found = bent.refit(scaled, normals)
        formats.add(_check(bent, scaled, normals, records, found) > 0)
    assert formats == {False, True}


def test_deltas_at_their_limits(clip: GridClip) -> None:
    bent = Bent(clip, bits_of(clip))
    positions, normals = bent.at(0.0)
    reach = 1 << (delta_bits(bent.vertex_bits) - 1)
    pair = bent.leaves[bent.leaves[:, 3] >= 0][0]
    for delta, kind in ((reach - 1, 0), (-reach, 0), (reach, 3), (-reach - 1, 3), (2 * reach - 1, 3), (2 * reach, 2)):
        moved = positions.copy()
        moved[pair] = positions[pair[0]].clip(3 * reach, None)
        moved[pair[3], 1] += delta
        records, found = bent.refit(moved, normals)
        _check(bent, moved, normals, records, found)
        kinds = [read_leaf(record, 0, bent.tree.places, bent.vertex_bits) for record in records]
        assert any(leaf.format == kind and leaf.vertices == moved[pair].tolist() for leaf in kinds)


def test_a_vertex_outside_is_an_error(clip: GridClip, bent: Bent) -> None:
    pose = clip.rest.astype(np.int32)
    pose[3] += 1 << (bits_of(clip) + clip.shift)
    with pytest.raises(ValueError, match="outside"):
        bent.target.skin(pose)


def test_a_vertex_may_have_its_whole_weight_on_any_bone(clip: GridClip, bent: Bent) -> None:
    pose = np.zeros(len(clip.rest), dtype=np.int32)
    pose[3 : 12 * clip.bones : 4] = (np.arange(3 * clip.bones) + 1000) << clip.shift
    for bones, weights in (((2, 0, 0, 0), (0, 0, 0)), ((0, 2, 0, 0), (1 << 15, 0, 0)), ((1, 0, 0, 2), (0, 0, 1 << 15))):
        vertices = clip.vertices.copy()
        vertices[:, 6:] = (*bones, *weights)
        tree = bent.tree.clip_tree(bent.vertex_bits, bent.leaves)
        target: Any = _core.TargetMesh(HASH, clip_file(replace(clip, vertices=vertices), tree, bent.tree.places, HASH))
        assert (target.skin(pose)[0] == [1006, 1007, 1008]).all()


def test_other_records_are_refused(bent: Bent) -> None:
    positions, normals = bent.at(0.0)
    for root, change in ((ROOT + 1, None), (ROOT, 0), (ROOT, len(bent.tree.records) - 1)):
        records = bent.tree.records.copy()
        if change is not None:
            records[change] = 0xFF
        if change is None or change == 0:
            with pytest.raises(ValueError, match="otherRecords"):
                bent.target.refit(positions, normals, records.view(np.uint32), root)


def test_a_clip_repeats(clip: GridClip, bent: Bent) -> None:
    end = int(clip.times[-1])
    for time in (0, 5, end // 2, end - 1):
        np.testing.assert_array_equal(
            bent.target.pose(time), bent.target.pose(time + end) if time else bent.target.pose(0)
        )
    np.testing.assert_array_equal(bent.target.pose(end), clip.poses[-1])


def test_hostile_clip_files_are_refused_by_name(bent: Bent) -> None:
    def refused(change: Any) -> str:
        with pytest.raises(ValueError, match=r"^\w+$") as caught:
            _core.TargetMesh(HASH, bytes(change))
        return str(caught.value)

    file = bent.file
    assert refused(b"") == refused(file[:100]) == refused(file[:-4]) == refused(file + b"\0" * 4) == "truncated"
    assert refused(b"CLNDVIEW" + file[8:]) == "notAClip"
    with pytest.raises(ValueError, match="otherFormat"):
        _core.TargetMesh(HASH[::-1], file)
    accepted = 0
    random = np.random.default_rng(2)
    for place in [*range(48, 200, 4), *random.integers(0, len(file) - 4, 300).tolist()]:
        for value in (0xFFFFFFFF, 0x7FFFFFFF, 0x80000000, 1 << 24):
            changed = bytearray(file)
            changed[place : place + 4] = value.to_bytes(4, "little")
            try:
                target: Any = _core.TargetMesh(HASH, bytes(changed))
            except ValueError as error:
                assert str(error) in ("truncated", "notAClip", "otherFormat")
                continue
            accepted += 1
            try:
                target.skin(target.pose(12345))
            except ValueError as error:
                assert str(error) == "outside"
    assert accepted > 0
