"""Newell's teapot: number of triangles, watertight patches, outward normals."""

from __future__ import annotations

import numpy as np
import pytest

from colonnade.mesh.geometry.teapot import tessellate
from colonnade.mesh.load import load_mesh


@pytest.mark.parametrize("level", [2, 3, 10])
def test_its_poles_leave_no_degenerate_faces(level: int) -> None:
    _, faces = tessellate(level)
    assert len(faces) == 64 * level * level - 8 * level
    assert len(load_mesh(f"teapot:{level}").faces) == len(faces)


def test_the_default_is_the_benchmarks() -> None:
    mesh = load_mesh("teapot")
    assert (len(mesh.faces), mesh.source_count) == (6320, 6320)
    np.testing.assert_allclose(mesh.vertices.min(axis=0), [-3.0, 0.0, -2.0])
    np.testing.assert_allclose(mesh.vertices.max(axis=0), [3.434, 3.15, 2.0], atol=5e-3)


def test_patches_meet_bit_for_bit() -> None:
    """Only the ends of parts have edges with one face: lid, rim, and the ends of handle and spout."""
    mesh = load_mesh("teapot")
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    assert count.max() == 2
    # Circles of 40 edges at rim and lid, loops of 20 edges at both ends of handle and spout.
    assert (count == 1).sum() == 2 * 40 + 4 * 20


def test_its_normals_point_outward() -> None:
    """Tested on the body, where the outward direction is obvious."""
    mesh = load_mesh("teapot")
    corners = mesh.vertices[mesh.faces]
    body = (np.abs(np.hypot(corners[..., 0], corners[..., 2]) - 2.0) < 0.05) & (np.abs(corners[..., 2]) > 1.0)
    outward = np.einsum("nx,nx->n", mesh.corner_normals[body][:, [0, 2]], corners[body][:, [0, 2]])
    assert body.any() and (outward > 0).all()
