"""Triangulation of polygons: areas, winding and concave outlines."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from colonnade.common.errors import UserError
from colonnade.mesh.geometry.polygons import triangulate
from colonnade.mesh.load import load_mesh

#: Corners of a concave polygon, at most.
MAX_CORNERS = 2000
#: An L of area 2.5, whose fan from the first corner has the area 2.79.
L_SHAPE = [(0, 0), (2, 0), (2, 0.5), (1.0, 0.5), (1.0, 2), (0, 2)]


def areas(points: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Signed areas of the triangles of one polygon, seen against a normal."""
    corners = points[triangulate(points, np.array([len(points)])).corners]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ normal / 2


def shoelace(flat: np.ndarray) -> float:
    x, y = flat.T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)


@pytest.mark.parametrize("suffix", ["obj", "ply", "off"])
@pytest.mark.parametrize("first", range(6))
def test_an_l_shaped_face_has_its_area(tmp_path: Path, suffix: str, first: int) -> None:
    outline = L_SHAPE[first:] + L_SHAPE[:first]
    rows = "\n".join(f"{x} {y} 0" for x, y in outline)
    texts = {
        "obj": "\n".join(f"v {row}" for row in rows.split("\n")) + "\nf 1 2 3 4 5 6\n",
        "ply": "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face 1\nproperty list uchar int vertex_indices\nend_header\n{rows}\n6 0 1 2 3 4 5\n",
        "off": f"OFF\n6 1 0\n{rows}\n6 0 1 2 3 4 5\n",
    }
    (tmp_path / f"l.{suffix}").write_text(texts[suffix])
    mesh = load_mesh(tmp_path / f"l.{suffix}")
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert normals[:, 2].sum() / 2 == pytest.approx(2.5, abs=1e-12) == abs(normals[:, 2]).sum() / 2


@given(
    radii=st.lists(st.floats(0.1, 1.0), min_size=3, max_size=24),
    tilt=st.floats(-3.0, 3.0),
    stretch=st.floats(1e-3, 1e3),
)
def test_a_star_shaped_polygon_is_covered_once(radii: list[float], tilt: float, stretch: float) -> None:
    """The triangles of a polygon have its area, and none is turned over."""
    angle = 2 * np.pi * np.arange(len(radii)) / len(radii)
    flat = np.array(radii)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1) * (1.0, stretch)
    across, up = np.array([np.cos(tilt), 0.0, np.sin(tilt)]), np.array([0.0, 1.0, 0.0])
    found = areas(flat[:, :1] * across + flat[:, 1:] * up, np.cross(across, up))
    assert found.min() >= -1e-9 * stretch
    assert found.sum() == pytest.approx(shoelace(flat), rel=1e-9)


def turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> int:
    """Twice the signed area of a triangle of whole numbers."""
    return int((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def meet(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> bool:
    """Whether two line segments have a common point."""

    def holds(low: np.ndarray, high: np.ndarray, point: np.ndarray) -> bool:
        return turn(low, high, point) == 0 and bool(((point - low) * (point - high) <= 0).all())

    if turn(a, b, c) * turn(a, b, d) < 0 and turn(c, d, a) * turn(c, d, b) < 0:
        return True
    return holds(a, b, c) or holds(a, b, d) or holds(c, d, a) or holds(c, d, b)


def untangled(points: list[tuple[int, int]]) -> np.ndarray | None:
    """The points in the order of a counter-clockwise polygon that does not touch itself; None: not found."""
    flat, size = np.array(points), len(points)
    pairs = [(i, j) for i, j in combinations(range(size), 2) if 1 < j - i < size - 1]
    for _ in range(50):
        crossing = [(i, j) for i, j in pairs if meet(flat[i], flat[i + 1], flat[j], flat[(j + 1) % size])]
        if not crossing:
            spikes = [turn(flat[k - 2], flat[k - 1], flat[k]) == 0 for k in range(size)]
            folds = [(flat[k - 2] - flat[k - 1]) @ (flat[k] - flat[k - 1]) > 0 for k in range(size)]
            if any(spike and fold for spike, fold in zip(spikes, folds, strict=True)):
                return None
            return flat if shoelace(flat) > 0 else flat[::-1]
        i, j = crossing[0]
        flat[i + 1 : j + 1] = flat[i + 1 : j + 1][::-1]
    return None


@given(st.lists(st.tuples(st.integers(0, 7), st.integers(0, 7)), min_size=5, max_size=13, unique=True))
@settings(max_examples=150)
def test_a_simple_polygon_is_covered_exactly_once(points: list[tuple[int, int]]) -> None:
    """Areas are positive, their sum is the polygon's, every corner is used, and the border is the polygon's."""
    flat = untangled(points)
    assume(flat is not None)
    assert flat is not None
    split = triangulate(np.column_stack([flat, 0 * flat[:, 0]]).astype(np.float64), np.array([len(flat)]))
    doubled = [turn(*flat[corners]) for corners in split.corners]
    assert min(doubled) > 0 and sum(doubled) == 2 * shoelace(flat) and split.crossed == 0
    edges = [(int(c[k]), int(c[(k + 1) % 3])) for c in split.corners for k in range(3)]
    border = {edge for edge in edges if edge[::-1] not in edges}
    assert border == {(k, (k + 1) % len(flat)) for k in range(len(flat))} and len(set(edges)) == len(edges)


def test_a_corner_level_with_one_neighbour_and_above_the_other_is_in_the_way() -> None:
    """(6, 6) shares a coordinate with each end of the cut from (6, 1) to (4, 6), and lies beyond it."""
    flat = np.array([(0, 0), (3, 0), (6, 1), (7, 7), (4, 6), (4, 5), (6, 6), (4, 1), (2, 1)], dtype=np.float64)
    found = areas(np.column_stack([flat, np.zeros(9)]), np.array([0.0, 0, 1]))
    assert found.min() >= 0 and found.sum() == shoelace(flat)


def test_a_polygon_of_many_corners_takes_few_tests() -> None:
    """A star that winds 95 times around its centre; and a comb, whose teeth all hold other corners."""
    number = np.arange(600)
    radius = 1.0 + number % 2
    star = np.stack([radius * np.cos(number), radius * np.sin(number), 0 * radius], axis=1)
    split = triangulate(star, np.array([600]))
    assert split.crossed == 1 and split.tests <= 20 * 600 + 1
    number = np.arange(MAX_CORNERS)
    comb = np.column_stack([number, 100.0 * (number % 2), 0 * number])
    comb[-2:, :2] = [(MAX_CORNERS, 101), (0, 101)]
    assert areas(comb, np.array([0.0, 0, 1])).sum() == shoelace(comb[:, :2])
    assert 0 < triangulate(comb, np.array([MAX_CORNERS])).tests <= 4 * MAX_CORNERS


def test_straight_corners_stay_corners_of_triangles_with_area() -> None:
    """Corners on the sides of a square: no triangle without area, which would leave a gap to the neighbour."""
    flat = np.array([(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1)], dtype=np.float64)
    for first in range(8):
        found = areas(np.column_stack([np.roll(flat, first, axis=0), np.zeros(8)]), np.array([0.0, 0, 1]))
        assert found.min() > 0.1 and found.sum() == pytest.approx(4.0)


def test_a_quadrilateral_is_split_at_its_concave_corner() -> None:
    flat = np.array([(0, 0), (4, 0), (1, 1), (0, 4)], dtype=np.float64)
    for first in range(4):
        found = areas(np.column_stack([np.roll(flat, first, axis=0), np.zeros(4)]), np.array([0.0, 0, 1]))
        assert found.min() > 0 and found.sum() == pytest.approx(4.0)


def test_polygons_keep_their_order_and_short_ones_are_counted() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1]])
    corners = np.array([0, 1, 2, 3, 0, 1, 0, 1, 4])
    split = triangulate(points[corners], np.array([4, 2, 3]))
    assert split.polygons.tolist() == [0, 0, 2] and split.short == 1
    assert split.corners[2].tolist() == [6, 7, 8]


def test_a_pentagram_counts_as_crossed() -> None:
    angle = 4 * np.pi * np.arange(5) / 5
    points = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    assert triangulate(points, np.array([5])).crossed == 1


def test_a_huge_concave_polygon_is_refused() -> None:
    angle = 2 * np.pi * np.arange(MAX_CORNERS + 2) / (MAX_CORNERS + 2)
    radius = 1.0 + 0.5 * (np.arange(len(angle)) % 2)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], axis=1)
    with pytest.raises(UserError, match="split it, 2,000 are supported"):
        triangulate(points, np.array([len(points)]))
