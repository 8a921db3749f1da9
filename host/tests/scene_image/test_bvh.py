"""The BVH: conservative boxes, every triangle once, the same order for any number of children, and valid bounds."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from trees import EMPTY, LEAF, NODE, Bvh, build_bvh

Integers = npt.NDArray[np.int32]
Wide = npt.NDArray[np.int64]


def build(vertices: Integers, faces: Integers, **changes: Any) -> Bvh:
    options = {"children": 4, "box_bits": 7, "stack_depth": 48} | changes
    return build_bvh(vertices, faces, **options)


def random_triangles(seed: int, count: int, spread: int, bits: int = 16) -> tuple[Integers, Integers]:
    """Small triangles; with a small ``spread`` they form clusters with coincident centres."""
    generator = np.random.default_rng(seed)
    maximum = (1 << bits) - 1
    centres = generator.integers(0, maximum + 1, (max(1, spread), 3))
    corners = centres[generator.integers(0, len(centres), count)][:, None] + generator.integers(-40, 41, (count, 3, 3))
    vertices = np.clip(corners, 0, maximum).reshape(-1, 3).astype(np.int32)
    return vertices, np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def is_pair(corners: Integers) -> bool:
    """Whether two triangles, [2, 3, 3], share an edge in opposite directions."""
    first, second = corners.tolist()
    edges = [(first[k], first[k - 2]) for k in range(3)]
    return any((second[k - 2], second[k]) in edges for k in range(3))


def check_tree(tree: Bvh, vertices: Integers, faces: Integers, box_bits: int) -> None:
    """Traverse the tree and check each box against its ancestors'."""
    seen: list[int] = []
    maximum = (1 << 28, -1)
    tasks = [(0, np.full(3, -1), np.full(3, maximum[0]), 0, 1)]
    deepest_stack = depth = 0
    while tasks:
        node, low, high, waiting, level = tasks.pop()
        depth = max(depth, level)
        kinds = tree.kinds[node]
        assert (kinds != EMPTY).any()
        waiting += int((kinds != EMPTY).sum()) - 1
        deepest_stack = max(deepest_stack, waiting)
        next_node, next_leaf = int(tree.first_child[node]), int(tree.first_triangles[node])
        children = []
        for slot, kind in enumerate(kinds):
            if kind == EMPTY:
                continue
            exponent = tree.exponent[node].astype(np.int64)
            origin = tree.origin[node].astype(np.int64)
            child_low = origin + (tree.low[node, slot].astype(np.int64) << exponent)
            child_high = origin + (tree.high[node, slot].astype(np.int64) << exponent)
            assert tree.high[node, slot].max() < 1 << box_bits
            inner_low, inner_high = np.maximum(low, child_low), np.minimum(high, child_high)
            if kind == NODE:
                assert next_node > node
                children.append((next_node, inner_low, inner_high, waiting, level + 1))
                next_node += 1
                continue
            assert kind == LEAF
            first, count = int(tree.leaf_first[next_leaf]), int(tree.leaf_count[next_leaf])
            assert count == 1 or (count == 2 and is_pair(vertices[faces[tree.order[first : first + 2]]]))
            seen += range(first, first + count)
            points = vertices[faces[tree.order[first : first + count]]].reshape(-1, 3)
            assert (points >= inner_low).all() and (points <= inner_high).all()
            next_leaf += 1
        tasks += reversed(children)
    assert sorted(seen) == list(range(len(faces)))
    assert sorted(tree.order.tolist()) == list(range(len(faces)))
    statistics = tree.statistics
    assert (statistics.stack_bound, statistics.depth) == (deepest_stack, depth)
    assert (statistics.nodes, statistics.leaves) == (len(tree.kinds), len(tree.leaf_first))


@settings(max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 300),
    spread=st.sampled_from([1, 3, 1000]),
    box_bits=st.integers(4, 7),
    stack_depth=st.sampled_from([4, 8, 10, 12, 48]),
)
def test_boxes_contain_their_triangles_in_an_order_that_children_and_box_bits_do_not_change(
    seed: int, count: int, spread: int, box_bits: int, stack_depth: int
) -> None:
    vertices, faces = random_triangles(seed, count, spread)
    trees = [
        build(vertices, faces, children=children, box_bits=bits, stack_depth=stack_depth)
        for children, bits in ((2, 7), (4, box_bits))
    ]
    balanced = (count - 1).bit_length()
    for tree, bits in zip(trees, (7, box_bits), strict=True):
        check_tree(tree, vertices, faces, bits)
        assert tree.statistics.stack_bound <= max(stack_depth, balanced)
    np.testing.assert_array_equal(trees[0].order, trees[1].order)
    assert sorted(trees[0].leaf_first.tolist()) == sorted(trees[1].leaf_first.tolist())


def planes_of_children(tree: Bvh, vertices: Integers, faces: Integers) -> tuple[Wide, Wide]:
    """The boxes of all children, int64 [n, 4, 3]: a leaf's is exact, a node's the union of those in its own record."""
    present = (tree.kinds != EMPTY)[..., None]
    shift, origin = tree.exponent[:, None, :].astype(np.int64), tree.origin[:, None, :].astype(np.int64)
    own_low = np.where(present, origin + (tree.low.astype(np.int64) << shift), 1 << 40).min(axis=1)
    own_high = np.where(present, origin + (tree.high.astype(np.int64) << shift), -1).max(axis=1)
    corners = vertices[faces[tree.order]].astype(np.int64)
    last = tree.leaf_first + tree.leaf_count - 1
    leaf_low = np.minimum(corners[tree.leaf_first].min(axis=1), corners[last].min(axis=1))
    leaf_high = np.maximum(corners[tree.leaf_first].max(axis=1), corners[last].max(axis=1))
    low, high = np.zeros(tree.low.shape, np.int64), np.zeros(tree.low.shape, np.int64)
    for kind, first, (lows, highs) in (
        (NODE, tree.first_child, (own_low, own_high)),
        (LEAF, tree.first_triangles, (leaf_low, leaf_high)),
    ):
        is_kind = tree.kinds == kind
        index = (first[:, None] + np.cumsum(is_kind, axis=1) - 1)[is_kind]
        low[is_kind], high[is_kind] = lows[index], highs[index]
    return low, high


def check_nested(tree: Bvh, vertices: Integers, faces: Integers, box_bits: int) -> None:
    """Each node is the function of its children's records that docs/numbers.md, section 3 gives."""
    low, high = planes_of_children(tree, vertices, faces)
    present = (tree.kinds != EMPTY)[..., None]
    whole_low, whole_high = np.where(present, low, 1 << 40).min(axis=1), np.where(present, high, -1).max(axis=1)
    exponent = np.zeros(whole_low.shape, np.int64)
    while (wide := -(-whole_high >> exponent) - (whole_low >> exponent) >= 1 << box_bits).any():
        exponent += wide
    np.testing.assert_array_equal(tree.exponent, exponent)
    np.testing.assert_array_equal(tree.origin, whole_low >> exponent << exponent)
    shift, corner = exponent[:, None], (whole_low >> exponent)[:, None]
    np.testing.assert_array_equal(tree.low, np.where(present, (low >> shift) - corner, 0))
    np.testing.assert_array_equal(tree.high, np.where(present, -(-high >> shift) - corner, 0))


@settings(max_examples=30)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 2000),
    spread=st.sampled_from([1, 3, 1000]),
    vertex_bits=st.sampled_from([10, 16, 19]),
    box_bits=st.integers(4, 7),
    children=st.sampled_from([2, 4]),
)
def test_a_node_follows_from_the_records_of_its_children(
    seed: int, count: int, spread: int, vertex_bits: int, box_bits: int, children: int
) -> None:
    vertices, faces = random_triangles(seed, count, spread, vertex_bits)
    check_nested(build(vertices, faces, children=children, box_bits=box_bits), vertices, faces, box_bits)


@pytest.mark.matrix
def test_a_million_nodes_follow_from_the_records_of_their_children() -> None:
    nodes = 0
    for seed in itertools.count():
        vertices, faces = random_triangles(seed, 60_000, (1, 30, 60_000)[seed % 3], (16, 19)[seed % 2])
        tree = build(vertices, faces)
        check_nested(tree, vertices, faces, 7)
        nodes += len(tree.kinds)
        if nodes >= 1_000_000:
            break


@dataclass
class Subtree:
    """A binary subtree: half its box's area, and its two children unless it is a leaf."""

    area: int
    children: tuple[Subtree, Subtree] | None


def binary_tree(tree: Bvh, vertices: Integers, faces: Integers) -> Subtree:
    """The tree of two children a node with exact boxes."""

    def below(node: int) -> tuple[Subtree, Integers]:
        found, node_child, leaf_child = [], int(tree.first_child[node]), int(tree.first_triangles[node])
        for kind in tree.kinds[node][tree.kinds[node] != EMPTY]:
            if kind == NODE:
                found.append(below(node_child))
                node_child += 1
            else:
                first, count = int(tree.leaf_first[leaf_child]), int(tree.leaf_count[leaf_child])
                points = vertices[faces[tree.order[first : first + count]]].reshape(-1, 3)
                found.append((Subtree(half_area(points), None), points))
                leaf_child += 1
        if len(found) == 1:
            return found[0]
        points = np.concatenate([points for _, points in found])
        return Subtree(half_area(points), (found[0][0], found[1][0])), points

    return below(0)[0]


def half_area(points: Integers) -> int:
    x, y, z = np.ptp(points.astype(np.int64), axis=0).tolist()
    return int(x * y + y * z + z * x)


def cuts(subtree: Subtree, max_count: int) -> Iterator[list[Subtree]]:
    """All lists of at most `max_count` subtrees that together are `subtree`."""
    yield [subtree]
    if subtree.children is not None:
        for count in range(1, max_count):
            for left in cuts(subtree.children[0], count):
                if len(left) == count:
                    yield from (left + right for right in cuts(subtree.children[1], max_count - count))


def least_area(subtree: Subtree, stack: int) -> float:
    """Least sum of areas of nodes of four children within a stack, over all collapses."""
    if subtree.children is None:
        return 0
    areas = [
        sum(least_area(child, stack - len(cut) + 1) for child in cut)
        for cut in cuts(subtree, 4)
        if 1 < len(cut) <= stack + 1
    ]
    return subtree.area + min(areas, default=math.inf)


@settings(max_examples=40)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(2, 14),
    spread=st.sampled_from([1, 3, 1000]),
    stack_depth=st.integers(4, 9),
)
def test_no_collapse_within_the_stack_reads_fewer_nodes(seed: int, count: int, spread: int, stack_depth: int) -> None:
    vertices, faces = random_triangles(seed, count, spread)
    binary = binary_tree(build(vertices, faces, children=2, stack_depth=stack_depth), vertices, faces)
    tree = build(vertices, faces, stack_depth=stack_depth)
    corners = vertices[faces].reshape(-1, 3, 3)
    leaves = sum(half_area(triangle) for triangle in corners)
    assert tree.statistics.cost * binary.area == pytest.approx(least_area(binary, stack_depth) + leaves, rel=1e-9)


def levels(tree: Bvh) -> dict[int, int]:
    """The number of nodes above each leaf, by the first triangle of the leaf."""
    found, tasks = {}, [(0, 1)]
    while tasks:
        node, level = tasks.pop()
        node_child, leaf_child = int(tree.first_child[node]), int(tree.first_triangles[node])
        for kind in tree.kinds[node]:
            if kind == NODE:
                tasks.append((node_child, level + 1))
                node_child += 1
            elif kind == LEAF:
                found[int(tree.order[tree.leaf_first[leaf_child]])] = level
                leaf_child += 1
    return found


def test_large_triangles_among_small_ones_move_up() -> None:
    """Splits by position leave them beside the small triangles at their centres, and every box above is large."""

    def moved(x: Integers, corners: list[list[int]]) -> Integers:
        return np.stack([x, 0 * x, 0 * x], axis=1)[:, None] + np.array(corners, dtype=np.int32)

    small = moved(
        np.arange(0, 64_000, 1000, dtype=np.int32), [[0, 15_000, 15_000], [9, 15_009, 15_000], [0, 15_000, 15_009]]
    )
    large = moved(np.arange(0, 32_000, 10_000, dtype=np.int32), [[0, 0, 0], [31_000, 30_009, 0], [31_000, 0, 30_009]])
    vertices = np.concatenate([small, large]).reshape(-1, 3)
    tree = build(vertices, np.arange(len(vertices), dtype=np.int32).reshape(-1, 3), children=2)
    level = levels(tree)
    assert max(level[len(small) + i] for i in range(len(large))) <= 5 < 8 <= max(level.values())


@pytest.mark.parametrize("children", [2, 4])
def test_one_triangle_has_a_root_with_one_leaf(children: int) -> None:
    vertices, faces = random_triangles(1, 1, 1)
    tree = build(vertices, faces, children=children)
    assert tree.kinds.tolist() == [[LEAF] + [EMPTY] * 3]
    assert tree.statistics.stack_bound == 0
    check_tree(tree, vertices, faces, 7)


@pytest.mark.parametrize("count", [2, 3, 500, 4000])
def test_triangles_in_one_place_are_halved(count: int) -> None:
    """Coincident centres cannot be split by position; the tree stays balanced and small."""
    vertices = np.array([[0, 0, 0], [9, 0, 0], [0, 9, 0]], dtype=np.int32)
    faces = np.tile(np.array([[0, 1, 2]], dtype=np.int32), (count, 1))
    tree = build(vertices, faces)
    check_tree(tree, vertices, faces, 7)
    assert len(tree.leaf_first) == count


def one_sided(count: int = 3000) -> tuple[Integers, Integers]:
    """Triangles whose sizes and positions grow geometrically: good splits separate only a few at a time."""
    at = np.unique(np.rint(1.004 ** np.arange(count)).astype(np.int64))
    at = at[at < 60000]
    vertices = np.stack(
        [np.stack([at, 0 * at, 0 * at], 1), np.stack([at, at, 0 * at], 1), np.stack([at, at, at], 1)], 1
    )
    return vertices.reshape(-1, 3).astype(np.int32), np.arange(3 * len(at), dtype=np.int32).reshape(-1, 3)


def test_a_tree_too_deep_for_the_stack_is_balanced() -> None:
    vertices, faces = one_sided()
    free = build(vertices, faces, stack_depth=256, children=2)
    assert free.statistics.height_limit == 0
    short = free.statistics.stack_bound - 2
    for children in (2, 4):
        tree = build(vertices, faces, stack_depth=max(short, 18), children=children)
        assert tree.statistics.stack_bound <= max(short, 18)
        check_tree(tree, vertices, faces, 7)


def test_the_order_does_not_depend_on_the_children_when_balanced() -> None:
    vertices, faces = one_sided()
    for stack_depth in (12, 16, 20, 4):
        trees = [build(vertices, faces, stack_depth=stack_depth, children=children) for children in (2, 4)]
        np.testing.assert_array_equal(trees[0].order, trees[1].order)
        assert trees[0].statistics.height_limit == trees[1].statistics.height_limit


def test_a_tree_that_does_not_fit_reports_its_needs() -> None:
    vertices, faces = random_triangles(3, 4096, 1000)
    tree = build(vertices, faces, stack_depth=4, children=2)
    assert tree.statistics.stack_bound == 12  # 4,096 leaves, balanced
