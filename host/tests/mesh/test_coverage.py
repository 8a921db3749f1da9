"""The alpha of materials: what it hides is cut away, and what stays looks as the file says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from textured_files import gltf, png

from colonnade.common.errors import UserError
from colonnade.mesh import coverage
from colonnade.mesh.load import load_mesh
from colonnade.mesh.mesh import Mesh

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n"


def disc(edge: int, alpha_inside: int = 255, alpha_outside: int = 0) -> np.ndarray:
    """A green disc of radius 0.4 on pink, uint8 [edge, edge, 4]."""
    v, u = (np.mgrid[:edge, :edge] + 0.5) / edge
    inside = np.hypot(u - 0.5, v - 0.5) < 0.4
    pixels = np.where(inside[..., None], (0, 200, 0, alpha_inside), (255, 0, 255, alpha_outside))
    return pixels.astype(np.uint8)


def masked(folder: Path, picture: np.ndarray, factor: float = 1.0, **material: Any) -> Mesh:
    """A glTF triangle of the corners (0, 0), (1, 0) and (0, 1) of a picture, with an alpha."""
    surface = {"baseColorTexture": {"index": 0}, "baseColorFactor": [1, 1, 1, factor], "metallicFactor": 0}
    whole = {"pbrMetallicRoughness": surface, "doubleSided": True} | material
    return load_mesh(gltf(folder, picture, materials=[whole]), corner_colours=True)


def area(mesh: Mesh) -> float:
    corners = mesh.vertices[mesh.faces]
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return float(np.linalg.norm(doubled, axis=1).sum()) / 2


def square(folder: Path, picture: np.ndarray, mtl: str) -> Mesh:
    (folder / "a.png").write_bytes(png(picture))
    (folder / "a.mtl").write_text(f"newmtl a\nKd 1 1 1\n{mtl}")
    (folder / "a.obj").write_text(f"mtllib a.mtl\nusemtl a\n{SQUARE}")
    return load_mesh(folder / "a.obj", corner_colours=True)


def test_a_mask_is_cut_along_its_outline(tmp_path: Path) -> None:
    """Half of the disc lies in the triangle, whose area is √3/2; no face is lost or shown where the mask is 0."""
    mesh = masked(tmp_path, disc(256), alphaMode="MASK")
    assert area(mesh) == pytest.approx(np.sqrt(3) * np.pi * 0.4**2 / 2, rel=0.01)
    assert 100 < len(mesh.faces) < coverage._FACES and mesh.notes == ()
    assert mesh.source_count == 1 and not mesh.source_faces.any()
    assert all(material.alpha is None for material in mesh.materials)


@pytest.mark.parametrize(("cutoff", "factor", "share"), [(0.5, 1.0, 1.0), (0.2, 0.3, 1.0), (0.9, 1.0, 0.0)])
def test_the_cutoff_is_that_of_the_file(tmp_path: Path, cutoff: float, factor: float, share: float) -> None:
    picture = disc(64, alpha_inside=200, alpha_outside=200)
    if share == 0.0:
        with pytest.raises(UserError, match="all its faces are transparent by their alpha"):
            masked(tmp_path, picture, factor, alphaMode="MASK", alphaCutoff=cutoff)
        return
    mesh = masked(tmp_path, picture, factor, alphaMode="MASK", alphaCutoff=cutoff)
    assert len(mesh.faces) == 1 and mesh.notes == ()


def test_colours_under_alpha_0_do_not_bleed_into_the_atlas(tmp_path: Path) -> None:
    from colonnade.scene_image.atlas import make_atlas

    mesh = masked(tmp_path, disc(64), alphaMode="MASK")
    atlas = make_atlas(mesh, mesh.materials, 1.0, 512)
    if atlas is None:  # the disc is of one colour, which the corners hold
        assert mesh.corner_colours is not None
        np.testing.assert_allclose(mesh.corner_colours[..., [0, 2]], 0.0)
    else:
        assert atlas.colours[..., 0].max() < 0.01


def test_an_opaque_material_ignores_alpha(tmp_path: Path) -> None:
    mesh = masked(tmp_path, disc(64))
    assert len(mesh.faces) == 1 and area(mesh) == pytest.approx(np.sqrt(3) / 2)
    assert (mesh.textures[0].pixels == (255, 0, 255)).all(axis=2).any()


def test_blending_is_rounded_and_noted(tmp_path: Path) -> None:
    """Alpha above 1/2 is opaque; a thin surface is a pane of its tint; an invisible one is left out."""
    line = "1 partly transparent material is not blended"
    opaque = masked(tmp_path, disc(64, 200, 200), alphaMode="BLEND")
    assert opaque.materials[0].kind == "diffuse" and line in opaque.notes[0]
    pane = masked(tmp_path, np.full((4, 4, 4), (255, 0, 0, 51), np.uint8), alphaMode="BLEND")
    assert line in pane.notes[0] and pane.materials[0].kind == "glass" and pane.materials[0].ior == 1.0
    np.testing.assert_allclose(pane.materials[0].albedo, (1.0, 0.8, 0.8), atol=1e-3)
    with pytest.raises(UserError, match="all its faces are transparent"):
        masked(tmp_path, np.full((4, 4, 4), (255, 0, 0, 2), np.uint8), alphaMode="BLEND")
    plain = masked(tmp_path, np.full((4, 4, 4), 255, np.uint8), alphaMode="BLEND")
    assert plain.notes == () and plain.materials[0].kind == "diffuse"


def test_an_outline_with_more_detail_than_faces_is_noted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(coverage, "_FACES", 500)
    picture = disc(64)
    picture[..., 3] = 255 * np.random.default_rng(1).integers(0, 2, (64, 64))
    mesh = masked(tmp_path, picture, alphaMode="MASK")
    assert len(mesh.faces) < 1500 and "1 alpha mask is cut coarsely" in mesh.notes[0]


def test_map_d_cuts_too(tmp_path: Path) -> None:
    cut = square(tmp_path, disc(128), "map_Kd a.png\nmap_d a.png\n")
    assert area(cut) == pytest.approx(np.pi * 0.4**2, rel=0.01) and cut.notes == ()
    whole = square(tmp_path, disc(128), "map_Kd a.png\n")
    assert area(whole) == pytest.approx(1.0)
    grey = np.repeat(disc(128)[..., 3:], 3, axis=2)
    assert area(square(tmp_path, grey, "map_d a.png\n")) == pytest.approx(np.pi * 0.4**2, rel=0.01)
