"""Materials of mesh files: mirror and glass by file format, and the material of each face."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from textured_files import gltf, of_mtl
from trimesh.visual.material import PBRMaterial

from colonnade.common.errors import UserError
from colonnade.common.srgb import linear_from_srgb
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.materials import PLAIN, MeshMaterial, from_gltf


def test_gltf_materials() -> None:
    surface = {"baseColorFactor": [0.5, 0.25, 0.125, 1.0], "metallicFactor": 0.2}
    assert from_gltf({"pbrMetallicRoughness": surface}) == MeshMaterial("diffuse", (0.5, 0.25, 0.125))
    assert (
        from_gltf({"pbrMetallicRoughness": surface | {"metallicFactor": 0.5, "roughnessFactor": 0.2}}).kind == "mirror"
    )
    assert from_gltf({"pbrMetallicRoughness": {}}) == MeshMaterial("mirror", (1.0, 1.0, 1.0), roughness=1.0)
    assert from_gltf({}).kind == "diffuse"
    textured = surface | {"metallicFactor": 1.0, "metallicRoughnessTexture": {"index": 0}}
    assert from_gltf({"pbrMetallicRoughness": textured}).kind == "diffuse"
    extensions = {"KHR_materials_transmission": {"transmissionFactor": 0.9}, "KHR_materials_ior": {"ior": 1.33}}
    assert from_gltf({"pbrMetallicRoughness": surface, "extensions": extensions}) == MeshMaterial(
        "glass", (0.5, 0.25, 0.125), 1.33, roughness=1.0
    )


def test_an_unlit_material_is_matt_and_noted(tmp_path: Path) -> None:
    surface = {"baseColorFactor": [0.5, 0.25, 0.125, 1.0]}
    matt = MeshMaterial("diffuse", (0.5, 0.25, 0.125))
    for more in ({}, {"metallicFactor": 1.0, "roughnessFactor": 0.0}, {"metallicRoughnessTexture": {"index": 0}}):
        material = {"pbrMetallicRoughness": surface | more, "extensions": {"KHR_materials_unlit": {}}}
        mesh = load_mesh(gltf(tmp_path, materials=[material | {"doubleSided": True}]))
        assert mesh.materials == (matt,)
        assert [note.partition(": ")[2] for note in mesh.notes] == [
            "1 unlit material is lit: a matt surface has its base colour"
        ]


def test_an_emission_beyond_1_keeps_its_hue_and_is_noted(tmp_path: Path) -> None:
    surface = {"pbrMetallicRoughness": {"metallicFactor": 0}, "doubleSided": True}
    strong = {"KHR_materials_emissive_strength": {"emissiveStrength": 5}}
    note = "1 material shines brighter than the hardware shows: the largest channel of an emission is 1"
    for change, notes in (
        ({"emissiveFactor": [1, 0.5, 0.25], "extensions": strong}, [note]),
        ({"emissiveFactor": [5, 2.5, 1.25]}, [note]),
        ({"emissiveFactor": [1, 0.5, 0.25]}, []),
    ):
        mesh = load_mesh(gltf(tmp_path, materials=[surface | change]))
        assert mesh.materials[0].emission == pytest.approx((1.0, 0.5, 0.25))
        assert [one.partition(": ")[2] for one in mesh.notes] == notes
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    for head, green in (("# Blender", 0.5), ("", 0.2)):
        (tmp_path / "a.mtl").write_text(f"{head}\nnewmtl a\nKe 5 2.5 0\n")
        mesh = load_mesh(tmp_path / "a.obj")
        assert mesh.materials[0].emission == pytest.approx((1.0, green, 0.0), abs=0.02)
        assert [one.partition(": ")[2] for one in mesh.notes] == [note]


def test_mtl_materials(tmp_path: Path) -> None:
    for lines, material in (
        (["Kd 0.1 0.2 0.3", "illum 2"], MeshMaterial("diffuse", (0.1, 0.2, 0.3))),
        (["Kd 0.1 0.2 0.3", "Pm 1.0"], MeshMaterial("mirror", (0.1, 0.2, 0.3))),
        (["illum 3"], MeshMaterial("mirror", PLAIN.albedo)),
        (["d 0.1", "Ni 1.0", "Tf 1 0.5 2"], MeshMaterial("glass", (1.0, 0.5, 1.0))),
        (["Tr 0.8", "Ni 1.45"], MeshMaterial("glass", PLAIN.albedo, 1.45)),
        (["Tr 1.0"], PLAIN),  # as MeshLab writes opaque ones
        (["Tr 0.9", "d 1"], PLAIN),
        (["Kd noise", "d -", "illum"], PLAIN),
    ):
        assert of_mtl(tmp_path, *lines) == material, lines


@pytest.mark.parametrize("texture", [{}, {"baseColorTexture": {"index": 0}}], ids=["plain", "textured"])
def test_comparisons_of_materials_grow_with_their_number(
    texture: dict[str, object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of each with all would take minutes."""
    primitive = {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}}
    numbers = range(250)
    compared = []
    equal = MeshMaterial.__eq__
    monkeypatch.setattr(MeshMaterial, "__eq__", lambda one, other: compared.append(1) or equal(one, other))
    file = gltf(
        tmp_path,
        meshes=[{"primitives": [primitive | {"material": number} for number in numbers]}],
        materials=[
            {"pbrMetallicRoughness": {"baseColorFactor": [number / 250, 0, 0, 1], "metallicFactor": 0, **texture}}
            for number in numbers
        ],
    )
    load_mesh(file, corner_colours=True)
    assert len(compared) < 20 * len(numbers)


def test_a_glb_file_keeps_its_materials_apart(tmp_path: Path) -> None:
    parts = []
    for shape, metallic in ((trimesh.creation.icosphere(1), 0.9), (trimesh.creation.box(), 0.0)):
        material = PBRMaterial(
            baseColorFactor=[0.2, 0.4, 0.6, 1.0], metallicFactor=metallic, roughnessFactor=0.1, name="same"
        )
        shape.visual = trimesh.visual.TextureVisuals(material=material)
        parts.append(shape)
    trimesh.Scene(parts).export(tmp_path / "two.glb")
    mesh = load_mesh(tmp_path / "two.glb")
    kinds = np.array([material.kind for material in mesh.materials])[mesh.face_materials]
    assert len(mesh.materials) == 2 and np.count_nonzero(kinds == "mirror") == 80
    corners = mesh.vertices[mesh.faces]
    assert np.isin(np.abs(corners[kinds == "diffuse"]), [0.5]).all()
    assert mesh.materials[0].albedo == pytest.approx((0.2, 0.4, 0.6), abs=1 / 255)


def test_an_obj_file_keeps_its_materials_apart(tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_text("newmtl red\nKd 1 0 0\nnewmtl clear\nKd 0 1 1\nd 0.2\nNi 1.4\n")
    vertices = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
    faces = "usemtl red\nf 1 2 3\nf 1 1 2\nusemtl clear\nf 1 2 4\nf 2 3 4\n"
    (tmp_path / "m.obj").write_text(vertices + faces)
    mesh = load_mesh(tmp_path / "m.obj")
    # The face without area is removed, and with it its material.
    kinds = [mesh.materials[index] for index in mesh.face_materials]
    assert sorted(kinds, key=str) == sorted(
        [MeshMaterial("diffuse", (1.0, 0.0, 0.0))] + 2 * [MeshMaterial("glass", (0.0, 1.0, 1.0), 1.4)], key=str
    )


@pytest.mark.parametrize(
    ("head", "is_linear"),
    [
        ("", False),
        ("# Blender 4.2.0 MTL File: 'a.blend'\n", True),
        ("# Blender: linear colours\n", True),
        ("\n#Blender\n", True),
        ("# Blenderer\n", False),
        ("# Blender\u00e4\n", False),
    ],
)
def test_colours_of_mtl_files_are_srgb_but_of_blender(tmp_path: Path, head: str, is_linear: bool) -> None:
    """Most viewers take Kd as sRGB; Blender writes and reads linear colours."""
    (tmp_path / "m.mtl").write_text(f"{head}newmtl a\nKd 0.5 0.25 2\nKe 0.5 0 0\nTf 0.5 0.5 0.5\nnewmtl b\nKd x 1 1\n")
    (tmp_path / "m.obj").write_text(
        "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl a\nf 1 2 3\nusemtl b\nf 1 2 4\n"
    )
    found = {material.albedo: material.emission for material in load_mesh(tmp_path / "m.obj").materials}
    half, quarter = (0.5, 0.25) if is_linear else linear_from_srgb(np.array([0.5, 0.25])).tolist()
    assert found == {(half, quarter, 1.0): (half, 0.0, 0.0), (0.8, 1.0, 1.0): (0.0, 0.0, 0.0)}


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "gbk"])
def test_names_stay_apart_in_any_encoding(tmp_path: Path, encoding: str) -> None:
    colours, names = ("1 0 0", "0 1 0", "0 0 1"), ("铁 #1", "铁 #2", "木")
    materials = "".join(f"newmtl {name}\nKd {colour} # sRGB\n" for name, colour in zip(names, colours, strict=True))
    faces = "".join(f"usemtl {name}\nf 1 2 3 # {name}\nf 1 2 4\nf 2 3 4\n" for name in names)
    (tmp_path / "a.mtl").write_bytes(materials.encode(encoding))
    (tmp_path / "a.obj").write_bytes(f"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nmtllib a.mtl\n{faces}".encode(encoding))
    mesh = load_mesh(tmp_path / "a.obj")
    assert mesh.notes == () and {material.albedo for material in mesh.materials} >= {(1, 0, 0), (0, 1, 0), (0, 0, 1)}


def test_files_of_windows_and_pictures_beside_the_materials_are_found(tmp_path: Path) -> None:
    (tmp_path / "materials" / "maps").mkdir(parents=True)
    Image.new("RGB", (4, 4), (255, 0, 0)).save(tmp_path / "materials" / "maps" / "red.png")
    (tmp_path / "materials" / "a.mtl").write_text("newmtl a\nKd 1 1 1\nmap_Kd maps\\red.png\n")
    faces = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl a\nf 1/1 2/2 3/3\n"
    (tmp_path / "a.obj").write_text(f"mtllib materials\\a.mtl\n{faces}")
    mesh = load_mesh(tmp_path / "a.obj", corner_colours=True)
    assert mesh.notes == () and mesh.corner_colours is not None
    assert mesh.corner_colours[0] == pytest.approx(np.array([[1.0, 0.0, 0.0]] * 3))


def test_names_without_materials_are_noted(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n")
    assert (
        load_mesh(tmp_path / "a.obj")
        .notes[0]
        .endswith("1 material name is not defined: faces have the default material")
    )


def test_files_without_materials_have_the_default(tmp_path: Path) -> None:
    trimesh.creation.box().export(tmp_path / "b.stl")
    for mesh in (load_mesh(tmp_path / "b.stl"), load_mesh("cube")):
        assert mesh.materials == (PLAIN,) and not mesh.face_materials.any()


def test_a_broken_gltf_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "b.gltf").write_text("{")
    with pytest.raises(UserError, match="cannot be read as a mesh"):
        load_mesh(tmp_path / "b.gltf")
