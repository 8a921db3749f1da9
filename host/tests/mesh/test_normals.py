"""Corner normals: creases, and the normals of files."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colonnade.mesh.geometry.normals import face_normals
from colonnade.mesh.load import clean_mesh, load_mesh
from colonnade.mesh.materials.mesh import Mesh


def heights(mesh: Mesh) -> np.ndarray:
    """Cosine between each corner's normal and its face's, float64 [m, 3]."""
    return np.einsum("mcx,mx->mc", mesh.corner_normals, face_normals(mesh.vertices, mesh.faces))


@pytest.mark.parametrize("name", ["cube", "tetrahedron", "octahedron", "square"])
def test_a_solid_with_sharp_edges_keeps_them(name: str) -> None:
    np.testing.assert_allclose(heights(load_mesh(name)), 1.0)


def test_a_cylinder_is_smooth_around_its_axis_and_has_flat_caps() -> None:
    mesh = load_mesh("cylinder:24")
    is_cap = np.abs(face_normals(mesh.vertices, mesh.faces)[:, 1]) > 0.5
    np.testing.assert_allclose(heights(mesh)[is_cap], 1.0)
    corners = mesh.vertices[mesh.faces[~is_cap]] * (1.0, 0.0, 1.0)
    np.testing.assert_allclose(mesh.corner_normals[~is_cap], corners / 0.6, atol=1e-12)


def test_a_sphere_is_smooth() -> None:
    mesh = load_mesh("sphere:3")
    outward = np.einsum("mcx,mcx->mc", mesh.corner_normals, mesh.vertices[mesh.faces])
    assert outward.min() > 0.999


def test_without_a_crease_all_faces_are_flat_and_with_180_degrees_all_edges_are_smooth() -> None:
    flat, smooth = load_mesh("octahedron", crease=0.0), load_mesh("octahedron", crease=180.0)
    np.testing.assert_allclose(heights(flat), 1.0)
    np.testing.assert_allclose(smooth.corner_normals, smooth.vertices[smooth.faces], atol=1e-12)


def test_parts_that_touch_at_a_vertex_only_are_not_smoothed() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0.3], [0, -1, 0.3]])
    faces = np.array([[0, 1, 2], [0, 3, 4]], dtype=np.int32)
    np.testing.assert_allclose(heights(clean_mesh(vertices, faces, "touching", crease=180.0)), 1.0)


def test_faces_of_opposite_winding_do_not_cancel() -> None:
    """An open sheet whose triangles disagree is flat on both sides of their edge."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    mesh = clean_mesh(vertices, np.array([[0, 1, 2], [0, 3, 2]], dtype=np.int32), "sheet")
    np.testing.assert_allclose(heights(mesh), 1.0)


@given(angle=st.floats(1.0, 179.0), crease=st.floats(0.0, 180.0))
def test_an_edge_is_smooth_up_to_the_crease_angle(angle: float, crease: float) -> None:
    if abs(angle - crease) < 0.01:
        return
    turn = np.radians(angle)
    vertices = np.array([[0.0, 0, 0], [0, 1, 0], [-1, 0, 0], [np.cos(turn), 0, -np.sin(turn)]])
    faces = np.array([[0, 1, 2], [1, 0, 3]], dtype=np.int32)
    normals = clean_mesh(vertices, faces, "a", crease=crease).corner_normals
    edge = np.abs(normals[0, 0] - normals[1, 1]).max()
    assert (edge < 1e-9) == (angle < crease)


def test_normals_of_a_file_come_first_and_a_crease_replaces_them() -> None:
    vertices, faces = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0]]), np.array([[0, 1, 2]], dtype=np.int32)
    tilted = np.array([[[0.6, 0.0, 0.8], [0.0, 0.0, 5.0], [0.0, 0.6, 0.8]]])
    mesh = clean_mesh(vertices, faces, "a", normals=tilted)
    np.testing.assert_allclose(mesh.corner_normals[0], [[0.6, 0, 0.8], [0, 0, 1], [0, 0.6, 0.8]])
    assert mesh.notes == ()
    np.testing.assert_allclose(heights(clean_mesh(vertices, faces, "a", normals=tilted, crease=30.0)), 1.0)


def test_normals_that_point_to_the_back_are_negated_or_computed_and_noted() -> None:
    vertices = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0], [2, 2, 0], [4, 0, 0]])
    faces = np.array([[0, 1, 2], [1, 3, 2], [1, 4, 3]], dtype=np.int32)
    up, down = [0.0, 0.6, 0.8], [0.0, 0.6, -0.8]
    authored = np.array([[down, down, down], [up, down, up], [up, [0.0, 0, 0], [np.nan, 0, 1]]])
    mesh = clean_mesh(vertices, faces, "a", normals=authored)
    np.testing.assert_allclose(mesh.corner_normals[0], [[0.0, -0.6, 0.8]] * 3)
    np.testing.assert_allclose(mesh.corner_normals[1], [up, [0, 0, 1], up])
    np.testing.assert_allclose(mesh.corner_normals[2], [up, [0, 0, 1], [0, 0, 1]])
    assert mesh.notes == (
        "mesh a: 1 face has normals that point to its back: they are negated",
        "mesh a: 1 corner normal points to the back of its face: normals are computed from the faces",
        "mesh a: 2 corners have no normal: normals are computed from the faces",
    )
