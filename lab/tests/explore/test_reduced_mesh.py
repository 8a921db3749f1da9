"""Reduced meshes have few triangles, all of them with an area, and the shape of the mesh."""

from __future__ import annotations

import numpy as np
import pytest
from colonnade.common.errors import UserError
from colonnade.mesh.load import load_mesh

from colonnade_lab.explore.reduced_mesh import reduced_mesh


@pytest.mark.parametrize("maximum", [30, 200, 2000])
@pytest.mark.parametrize("name", ["teapot", "sphere:6000", "torus"])
def test_a_reduced_mesh_keeps_its_shape_with_at_most_so_many_triangles(name: str, maximum: int) -> None:
    mesh = load_mesh(name)
    found = reduced_mesh(mesh, maximum)
    assert 0.2 * maximum <= len(found.faces) <= maximum
    assert len(np.unique(np.sort(found.faces, axis=1), axis=0)) == len(found.faces)
    assert np.abs(found.corner_normals).max() <= 1.0 + 1e-12
    assert np.abs(found.extent.low - mesh.extent.low).max() < mesh.extent.edge / 3
    assert np.abs(found.extent.high - mesh.extent.high).max() < mesh.extent.edge / 3


def test_a_small_mesh_stays_as_it_is() -> None:
    mesh = load_mesh("cube")
    assert reduced_mesh(mesh, 12) is mesh


def test_what_no_grid_reduces_so_far_is_refused() -> None:
    with pytest.raises(UserError, match="mesh teapot cannot be reduced to 3 triangles: allow more"):
        reduced_mesh(load_mesh("teapot"), 3)
