"""Triangulation of polygons: areas, winding and concave outlines."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from colonnade.common.errors import UserError
from colonnade.mesh.load import load_mesh
from colonnade.mesh.polygons import MAX_CORNERS, triangulate

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
@settings(deadline=None)
def test_a_star_shaped_polygon_is_covered_once(radii: list[float], tilt: float, stretch: float) -> None:
    """The triangles of a polygon have its area, and none is turned over."""
    angle = 2 * np.pi * np.arange(len(radii)) / len(radii)
    flat = np.array(radii)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1) * (1.0, stretch)
    across, up = np.array([np.cos(tilt), 0.0, np.sin(tilt)]), np.array([0.0, 1.0, 0.0])
    found = areas(flat[:, :1] * across + flat[:, 1:] * up, np.cross(across, up))
    assert found.min() >= -1e-9 * stretch
    assert found.sum() == pytest.approx(shoelace(flat), rel=1e-9)


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
