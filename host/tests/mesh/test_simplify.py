"""Simplified meshes: the shape, what corners and faces have, and one line."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from colonnade.common import notes
from colonnade.common.types import Floats
from colonnade.mesh.geometry.primitives import sphere, torus
from colonnade.mesh.load import _simplified, clean_mesh, load_mesh
from colonnade.mesh.materials.materials import PLAIN
from colonnade.mesh.materials.mesh import Mesh
from colonnade.mesh.materials.texture import Texture


def with_attributes(vertices: Floats, faces: npt.NDArray[np.int32], uvs: Floats | None = None) -> Mesh:
    """Two materials by the sign of x, and colours that are positions."""
    corners = vertices[faces]
    texture = () if uvs is None else (Texture("squares", np.zeros((4, 4, 3), dtype=np.uint8)),)
    of_side = (corners.mean(axis=1)[:, 0] > 0).astype(np.uint8)
    return clean_mesh(
        vertices, faces, "ball", None, (PLAIN, PLAIN), of_side, colours=(corners + 1) / 2, textures=texture, uvs=uvs
    )


def test_a_sphere_keeps_its_shape_and_attributes() -> None:
    before = with_attributes(*sphere(5000))
    after = _simplified(before, 600)
    corners = after.vertices[after.faces]
    assert 550 <= len(after.faces) <= 600
    edges = np.sort(after.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    np.testing.assert_allclose(np.linalg.norm(after.vertices, axis=1), 1.0, atol=0.02)
    assert ((after.corner_normals * corners).sum(axis=2) > 0.98).all()
    assert after.corner_colours is not None
    np.testing.assert_allclose(after.corner_colours, (corners + 1) / 2, atol=0.03)
    middles = corners.mean(axis=1)
    clear = np.abs(middles[:, 0]) > 0.1
    np.testing.assert_array_equal(after.face_materials[clear], (middles[:, 0] > 0)[clear])
    sources = before.vertices[before.faces[after.source_faces]].mean(axis=1)
    assert np.linalg.norm(sources - middles, axis=1).max() < 0.1 and after.source_count == before.source_count


def test_texture_coordinates_do_not_run_back_across_a_seam() -> None:
    vertices, faces = torus(96)
    corners = vertices[faces]
    around = np.arctan2(corners[..., 2], corners[..., 0]) / (2 * np.pi)
    around += (around < around.max(axis=1, keepdims=True) - 0.5) * 1.0
    before = with_attributes(vertices, faces, np.stack([around, corners[..., 1]], axis=2))
    uvs = _simplified(before, 600).corner_uvs
    assert uvs is not None
    assert np.ptp(uvs[..., 0], axis=1).max() < 0.3


def test_one_line_has_both_numbers_and_is_no_error() -> None:
    lines: list[str] = []
    with notes.opened(lines.append):
        notes.be_strict()
        assert len(load_mesh("torus", simplify=500).faces) == 500
        assert len(load_mesh("cube", simplify=500).faces) == 12
        load_mesh("cylinder:500", simplify=50)
    assert lines == [
        "mesh torus: 2,304 triangles are simplified to 500",
        "mesh cylinder:500: 2,000 triangles are simplified to 2,000, not to 50, since more would fold it",
    ]


def test_the_size_of_the_units_does_not_matter() -> None:
    vertices, faces = sphere(2000)
    large, small = (_simplified(clean_mesh(vertices * size, faces, "ball"), 300) for size in (1e4, 1e-4))
    np.testing.assert_array_equal(large.faces, small.faces)
    np.testing.assert_allclose(large.vertices, small.vertices * 1e8, rtol=1e-6, atol=1e-6)
