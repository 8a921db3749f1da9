"""The alpha of materials: what it hides is cut away, and what stays looks as the file says."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from textured_files import gltf, png

from colonnade.common.errors import UserError
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials import coverage
from colonnade.mesh.materials.mesh import Mesh

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
    assert 100 < len(mesh.faces) < coverage.MAX_SPLIT_FACES and mesh.notes == ()
    assert mesh.source_count == 1 and not mesh.source_faces.any()
    assert all(material.alpha is None for material in mesh.materials)


def test_materials_that_differ_in_emission_share_the_faces_of_their_alpha(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(coverage, "MAX_SPLIT_FACES", 400)
    surface = {"baseColorTexture": {"index": 0}, "metallicFactor": 0}
    dark = {"pbrMetallicRoughness": surface, "alphaMode": "BLEND", "doubleSided": True}
    primitives = [[{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": material}] for material in range(2)]
    file = gltf(
        tmp_path,
        np.tile(disc(32), (4, 4, 1)),
        materials=[dark, dark | {"emissiveFactor": [0, 1, 0]}],
        meshes=[{"primitives": one} for one in primitives],
        nodes=[{"mesh": 0}, {"mesh": 1, "translation": [2, 0, 0]}],
    )
    mesh = load_mesh(file, corner_colours=True)
    glows = np.array([any(material.emission) for material in mesh.materials])[mesh.face_materials]
    assert len(glows) > 150 and 0.3 < glows.mean() < 0.7
    assert any("1 alpha mask is cut coarsely" in note for note in mesh.notes)
    assert len({one.texture for one in mesh.materials if one.texture is not None}) <= 1


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


def test_the_factor_of_a_blended_material_is_its_coverage(tmp_path: Path) -> None:
    """Of one with a picture, too, whose own alpha is cut at 1/2; without any it is left out."""
    white = np.full((4, 4, 4), 255, np.uint8)
    for factor in (0.25, 0.75):
        mesh = masked(tmp_path, white, factor, alphaMode="BLEND")
        assert [(one.kind, one.coverage) for one in mesh.materials] == [("diffuse", factor)] and mesh.notes == ()
        cut = masked(tmp_path, disc(64, 200, 0), factor, alphaMode="BLEND")
        assert cut.materials[0].coverage == factor and 0.0 < area(cut) < np.sqrt(3) / 2
    with pytest.raises(UserError, match="all its faces are transparent"):
        masked(tmp_path, white, 0.0, alphaMode="BLEND")


def test_a_clear_coat_of_gltf_is_read(tmp_path: Path) -> None:
    """Its factors; what is not a share is clipped."""
    for given, expected in (
        ({"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.25}, (0.5, 0.25)),
        ({"clearcoatFactor": 3.0}, (1.0, 0.0)),
        ({"clearcoatRoughnessFactor": 0.25}, (0.0, 0.0)),
    ):
        mesh = masked(tmp_path, np.full((4, 4, 4), 255, np.uint8), extensions={"KHR_materials_clearcoat": given})
        assert [one.clear_coat for one in mesh.materials] == [expected] and mesh.notes == ()


def test_an_outline_with_more_detail_than_faces_is_noted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(coverage, "MAX_SPLIT_FACES", 500)
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


def painted(folder: Path, alphas: list[float], picture: np.ndarray | None = None, **material: Any) -> Mesh:
    """The triangle of the unit points, green, with an alpha at each corner; as of `masked` with a picture."""
    path = gltf(folder, np.full((2, 2, 3), 255, np.uint8) if picture is None else picture)
    document = json.loads(path.read_text())
    colours = np.array([(0.0, 1.0, 0.0, alpha) for alpha in alphas], np.float32).tobytes()
    document["buffers"].append({"byteLength": 48, "uri": "data:;base64," + base64.b64encode(colours).decode()})
    document["bufferViews"].append({"buffer": 1, "byteLength": 48})
    document["accessors"].append({"bufferView": 3, "componentType": 5126, "count": 3, "type": "VEC4"})
    document["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = 2
    if picture is None:
        del document["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]
    document["materials"][0] |= material
    path.write_text(json.dumps(document))
    return load_mesh(path, corner_colours=True)


def test_alpha_of_vertices_cuts_a_mask_along_a_line(tmp_path: Path) -> None:
    """With 1, 0 and 0 at the corners, alpha 1/2 is half way: a quarter of the area, as one triangle."""
    whole = np.sqrt(3) / 2
    quarter = painted(tmp_path, [1, 0, 0], alphaMode="MASK")
    assert area(quarter) == pytest.approx(whole / 4) and len(quarter.faces) == 1 and quarter.notes == ()
    assert area(painted(tmp_path, [0, 1, 1], alphaMode="MASK")) == pytest.approx(whole * 3 / 4)
    assert area(painted(tmp_path, [1, 0, 0], alphaMode="MASK", alphaCutoff=0.9)) == pytest.approx(whole / 100)
    assert area(painted(tmp_path, [0.6, 0.7, 1], alphaMode="MASK")) == pytest.approx(whole)
    with pytest.raises(UserError, match="all its faces are transparent"):
        painted(tmp_path, [0.1, 0.2, 0.4], alphaMode="MASK")


def test_alpha_of_vertices_is_blended_as_that_of_a_texture(tmp_path: Path) -> None:
    line = "1 partly transparent material is not blended"
    pane = painted(tmp_path, [0.1, 0.2, 0.3], alphaMode="BLEND")
    assert pane.materials[0].kind == "glass" and line in pane.notes[0]
    np.testing.assert_allclose(pane.materials[0].albedo, (0.8, 1.0, 0.8), atol=1e-3)
    cut = painted(tmp_path, [1, 0, 0], alphaMode="BLEND")
    assert cut.materials[0].kind == "diffuse" and line in cut.notes[0]
    assert painted(tmp_path, [1, 1, 1], alphaMode="BLEND").notes == ()
    # The format ignores it without a mode, and it is noted
    opaque = painted(tmp_path, [1, 0, 0])
    assert len(opaque.faces) == 1 and "2 partly transparent vertices are opaque" in opaque.notes[0]


def test_alpha_of_vertices_multiplies_that_of_the_texture(tmp_path: Path) -> None:
    """A picture of alpha 0.8 with 1, 0, 0 at the corners: shown where the weight of the first is 5/8."""
    picture = np.full((64, 64, 4), (255, 255, 255, 204), np.uint8)
    picture[::2, ::2] = (0, 0, 255, 204)
    mesh = painted(tmp_path, [1, 0, 0], picture, alphaMode="MASK")
    assert area(mesh) == pytest.approx(np.sqrt(3) / 2 * (3 / 8) ** 2, rel=0.02)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.obj", "v 0 0 0 1 0 0 1\nv 1 0 0 1 0 0 0.5\nv 0 1 0 1 0 0 0\nf 1 2 3\n", "2 partly transparent vertices"),
        ("a.off", "COFF\n3 1 0\n0 0 0 9 9 9 255\n1 0 0 9 9 9 128\n0 1 0 9 9 9 0\n3 0 1 2\n", "2 partly transparent v"),
        ("b.off", "COFF\n3 1 0\n0 0 0 0 0 1 1\n1 0 0 0 0 1 1\n0 1 0 0 0 1 0\n3 0 1 2\n", "1 partly transparent vertex"),
        ("c.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 200 9 9 20\n", "1 partly transparent face is opaque"),
    ],
)
def test_alpha_of_formats_without_a_mode_is_noted(tmp_path: Path, name: str, content: str, says: str) -> None:
    (tmp_path / name).write_text(content)
    assert says in load_mesh(tmp_path / name, corner_colours=True).notes[0]
