"""Winding: closed parts point outward, cavities and open parts stay."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colonnade.mesh.geometry.primitives import Geometry, cube, sphere, square
from colonnade.mesh.load import clean_mesh
from colonnade.mesh.materials.mesh import Mesh


def volume(mesh: Mesh) -> float:
    corners = mesh.vertices[mesh.faces]
    return float(np.einsum("mx,mx->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)


def of(*parts: Geometry) -> Geometry:
    """Several solids as one mesh."""
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in parts[:-1]])
    faces = [faces + start for (_, faces), start in zip(parts, starts, strict=True)]
    return np.concatenate([vertices for vertices, _ in parts]), np.concatenate(faces).astype(np.int32)


def moved(part: Geometry, scale: float, shift: float = 0.0, inverted: bool = False) -> Geometry:
    vertices, faces = part
    return vertices * scale + (shift, 0.0, 0.0), faces[:, ::-1] if inverted else faces


@given(choices=st.lists(st.booleans(), min_size=12, max_size=12))
def test_any_winding_of_a_cube_is_repaired(choices: list[bool]) -> None:
    vertices, faces = cube()
    faces[choices] = faces[choices][:, ::-1]
    mesh = clean_mesh(vertices, faces, "cube")
    assert volume(mesh) == pytest.approx(8.0)
    expected = () if not any(choices) else ("inside-out closed part is turned" if all(choices) else "mixed winding",)
    assert len(mesh.notes) == len(expected)
    assert all(part in note for part, note in zip(expected, mesh.notes, strict=True))


def test_an_inside_out_part_beside_another_is_turned() -> None:
    mesh = clean_mesh(*of(cube(), moved(sphere(1), 0.5, 3.0, inverted=True)), "two")
    assert mesh.notes == ("mesh two: 1 inside-out closed part is turned outward: the faces are reversed",)
    assert volume(mesh) > 8.0


def test_a_cavity_stays_and_what_lies_in_it_is_turned() -> None:
    shell = (moved(sphere(2), 1.0), moved(sphere(2), 0.9, inverted=True))
    hollow = clean_mesh(*of(*shell), "hollow")
    assert hollow.notes == () and 0 < volume(hollow) < 1.5
    filled = clean_mesh(*of(*shell, moved(sphere(2), 0.5, inverted=True)), "filled")
    assert len(filled.notes) == 1 and volume(filled) > volume(hollow)


def test_cubes_that_share_an_edge_are_closed() -> None:
    vertices, faces = cube()
    other = vertices + np.array([2.0, 2.0, 0.0])
    mesh = clean_mesh(*of((vertices, faces), (other, faces[:, ::-1])), "edge")
    assert volume(mesh) == pytest.approx(16.0) and "1 inside-out" in mesh.notes[0]


def test_open_parts_are_left_alone() -> None:
    vertices, faces = square()
    faces[1] = faces[1][::-1]
    mesh = clean_mesh(vertices, faces, "open")
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], vertices[faces])
    assert mesh.notes == ()
    opened = clean_mesh(cube()[0], cube()[1][1:, ::-1], "box without a side")
    assert volume(opened) < 0 and opened.notes == ()


def test_normals_go_with_reversed_faces() -> None:
    vertices, faces = cube()
    outward = (vertices / np.sqrt(3))[faces[:, ::-1]]
    mesh = clean_mesh(vertices, faces[:, ::-1].astype(np.int32), "cube", normals=outward)
    np.testing.assert_allclose(mesh.corner_normals, mesh.vertices[mesh.faces] / np.sqrt(3))
    assert len(mesh.notes) == 1
