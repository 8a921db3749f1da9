"""Base-colour textures of mesh files: pictures, positions, wrapping, and the lines on what is lost."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from textured_files import FOUR, gltf, png

from colonnade.common import notes
from colonnade.common.errors import UserError
from colonnade.common.srgb import linear_from_srgb
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.materials import MeshMaterial
from colonnade.mesh.materials.mesh import Mesh
from colonnade.mesh.materials.texture import Texture, Wrap, sampled
from colonnade.scene.model import Material, MeshSource, Scene
from colonnade.scene.object_mesh import SurfaceFeatures, with_materials
from colonnade.scene.view import with_overrides

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"


def obj(folder: Path, faces: str, material: str = "map_Kd a.png") -> Path:
    (folder / "a.png").write_bytes(png(FOUR))
    (folder / "a.mtl").write_text(f"# Blender\nnewmtl a\nKd 0.5 1 1\n{material}\n")
    (folder / "a.obj").write_text(f"mtllib a.mtl\nusemtl a\n{SQUARE}{faces}\n")
    return folder / "a.obj"


def test_positions_of_an_obj_file_go_up_and_those_of_a_mesh_down(tmp_path: Path) -> None:
    mesh = load_mesh(obj(tmp_path, "f 1/1 2/2 3/3 4/4"))
    assert mesh.materials == (MeshMaterial(albedo=(0.5, 1.0, 1.0), texture=0),) and mesh.notes == ()
    assert mesh.corner_uvs is not None
    expected = mesh.vertices[mesh.faces][..., :2] * (1, -1) + (0, 1)
    np.testing.assert_allclose(mesh.corner_uvs, expected)
    np.testing.assert_array_equal(mesh.textures[0].pixels, FOUR)


def test_options_of_a_map_move_its_positions(tmp_path: Path) -> None:
    mesh = load_mesh(obj(tmp_path, "f 1/1 2/2 3/3", "map_Kd -clamp on -s 2 3 1 -o 0.5 -bm 1 a.png"))
    assert mesh.textures[0].wrap == ("clamp", "clamp") and mesh.corner_uvs is not None
    np.testing.assert_allclose(mesh.corner_uvs[0], [(0.5, 1), (2.5, 1), (2.5, -2)])
    assert mesh.notes[0].endswith("1 option of a texture map is not used: only -s, -o and -clamp are")


def test_faces_without_positions_have_the_plain_colour(tmp_path: Path) -> None:
    mesh = load_mesh(obj(tmp_path, "f 1/1 2/2 3/3\nf 1 3 4"))
    found = [mesh.materials[index] for index in mesh.face_materials]
    assert [material.texture for material in found] == [0, None]
    assert mesh.notes[0].endswith("1 face of a textured material is untextured: texture coordinates are missing")


def test_a_gltf_texture_is_embedded_and_wraps_as_its_sampler_says(tmp_path: Path) -> None:
    mesh = load_mesh(gltf(tmp_path))
    assert mesh.notes == () and mesh.materials[0] == MeshMaterial(albedo=(1.0, 1.0, 1.0), texture=0)
    assert mesh.textures[0].wrap == ("mirror", "clamp")
    np.testing.assert_array_equal(mesh.textures[0].pixels, FOUR)
    np.testing.assert_allclose(mesh.corner_uvs[0], [(0, 0), (1, 0), (0, 1)])  # type: ignore[index]


def test_a_texture_transform_scales_turns_and_moves(tmp_path: Path) -> None:
    transform = {"offset": [0.25, 1], "rotation": np.pi / 2, "scale": [2, 3]}
    texture = {"index": 0, "extensions": {"KHR_texture_transform": transform}}
    mesh = load_mesh(gltf(tmp_path, materials=[{"pbrMetallicRoughness": {"baseColorTexture": texture}}]))
    np.testing.assert_allclose(mesh.corner_uvs[0], [(0.25, 1), (0.25, -1), (3.25, 1)])  # type: ignore[index]


def test_hardware_without_textures_shows_their_mean(tmp_path: Path) -> None:
    mesh = load_mesh(obj(tmp_path, "f 1/1 2/2 3/3 4/4"))
    told: list[str] = []
    with notes.opened(told.append):
        plain = with_materials(Scene(MeshSource(name="square")), mesh, SurfaceFeatures(8))
    assert plain.materials == (MeshMaterial(albedo=(0.25, 0.5, 0.5)),) and plain.textures == ()
    assert "take --config small, or set geometry.cornerColours=true and geometry.textureBytes" in " ".join(told)
    (replaced,) = with_overrides(mesh.materials, Material(albedo=(0.1, 0.2, 0.3)))
    assert replaced.texture is None


@settings(max_examples=60)
@given(
    st.sampled_from(["repeat", "mirror", "clamp"]),
    st.floats(-4, 4, allow_subnormal=False),
    st.floats(-4, 4, allow_subnormal=False),
)
def test_a_texture_goes_on_beyond_its_picture(wrap: Wrap, u: float, v: float) -> None:
    """As the same picture in a larger one would."""
    random = np.random.default_rng(3)
    pixels = random.integers(0, 256, (5, 7, 3), dtype=np.uint8)
    large = {
        "repeat": np.tile(pixels, (10, 10, 1)),
        "mirror": np.pad(pixels, ((25, 20), (35, 28), (0, 0)), mode="symmetric"),
        "clamp": np.pad(pixels, ((25, 20), (35, 28), (0, 0)), mode="edge"),
    }[wrap]
    found = Texture("a", pixels, (wrap, wrap)).colours(np.array([[u, v]]))
    count = np.array(large.shape[1::-1]) / (7, 5)
    whole = Texture("b", large, ("clamp", "clamp")).colours((np.array([[u, v]]) + 5) / count)
    np.testing.assert_allclose(found, whole, atol=1e-9)


@pytest.mark.parametrize("kind", [np.uint8, np.float32])
def test_samples_have_the_bits_of_their_sum_in_order(kind: type) -> None:
    """Columns outside, rows inside, which decides words of the device; positions that are no numbers have a pixel."""
    random = np.random.default_rng(4)
    pixels, uvs = random.integers(0, 256, (4, 3, 2)).astype(kind), random.random((50, 2))
    at = uvs * (3, 4) - 0.5
    low = np.floor(at)
    far, expected = at - low, np.zeros((50, 2))
    for x, across in enumerate((1 - far[:, 0], far[:, 0])):
        for y, down in enumerate((1 - far[:, 1], far[:, 1])):
            place = (low + np.array([x, y])).astype(int) % (3, 4)
            expected += (across * down)[:, None] * pixels[place[:, 1], place[:, 0]]
    np.testing.assert_array_equal(sampled(pixels, uvs, ("repeat", "repeat")), expected)
    assert sampled(pixels, np.array([[np.nan, np.inf]]), ("mirror", "clamp")).shape == (1, 2)


def test_colours_are_bilinear_and_linear() -> None:
    texture = Texture("a", FOUR)
    np.testing.assert_allclose(texture.colours(np.array([[0.25, 0.25], [0.5, 0.25]])), [(1, 0, 0), (0.5, 0.5, 0)])
    np.testing.assert_allclose(texture.mean, (0.5, 0.5, 0.5))
    grey = Texture("b", np.full((1, 1, 3), 128, np.uint8))
    np.testing.assert_allclose(grey.mean, linear_from_srgb(np.full(3, 128 / 255)))


def painted(folder: Path, *pictures: bytes, suffix: str = "png") -> Path:
    """An OBJ file with a triangle for each picture."""
    for number, picture in enumerate(pictures):
        (folder / f"{number}.{suffix}").write_bytes(picture)
    numbers = range(len(pictures))
    (folder / "a.mtl").write_text("".join(f"newmtl {n}\nKd 1 1 1\nmap_Kd {n}.{suffix}\n" for n in numbers))
    faces = "".join(f"usemtl {n}\nf {n % 2 + 1}/1 {n % 2 + 2}/2 {n % 2 + 3}/3\n" for n in numbers)
    (folder / "a.obj").write_text(f"mtllib a.mtl\n{SQUARE}{faces}")
    return folder / "a.obj"


def test_the_textures_of_a_mesh_are_kept_within_a_bound(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond it all are halved, to linear means; far beyond it the mesh is refused."""
    file = painted(tmp_path, png(np.tile(FOUR, (2, 2, 1))), png(np.tile(FOUR, (2, 2, 1))[:3, :3]))
    monkeypatch.setattr("colonnade.mesh.materials.texture_reader.KEPT_TEXTURE_PIXELS", 24)
    mesh = load_mesh(file)
    assert [texture.size for texture in mesh.textures] == [(2, 2), (2, 2)]
    np.testing.assert_array_equal(mesh.textures[0].pixels, np.full((2, 2, 3), 188))
    np.testing.assert_array_equal(mesh.textures[1].pixels[1, 1], FOUR[0, 0])
    assert [note.partition(": ")[2] for note in mesh.notes[:1]] == [
        "2 textures are kept at 1/2 of the width and height: a mesh holds 33,554,432 pixels"
    ]
    monkeypatch.setattr("colonnade.mesh.materials.texture_reader.MAX_TEXTURE_PIXELS", 24)
    with pytest.raises(UserError, match="its textures have more than 24 pixels, the most of a mesh"):
        load_mesh(file)


def test_the_note_on_a_picture_says_what_is_wrong_with_it(tmp_path: Path) -> None:
    random = np.random.default_rng(1).integers(0, 256, (20, 20, 3), dtype=np.uint8)
    header = b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sIIBBBBB", 13, b"IHDR", 8192, 8192, 8, 2, 0, 0, 0)
    large = header + struct.pack(">I", zlib.crc32(header[12:])) + struct.pack(">I4sI", 0, b"IDAT", zlib.crc32(b"IDAT"))
    mesh = load_mesh(painted(tmp_path, png(random)[:-400], large, b"GIF89a"))
    assert mesh.textures == () and [note.partition(": ")[2] for note in mesh.notes] == [
        "1 picture of a texture is truncated or damaged (0.png): surfaces have their base colour",
        "1 picture of a texture is too large (1.png): a picture may have 33,554,432 pixels",
        "1 picture of a texture is not readable (2.png): pictures must be PNG, JPEG or WebP, or TGA outside a browser",
    ]
    assert "truncated" in load_mesh(painted(tmp_path, png(random)[:20])).notes[0]


def test_a_targa_picture_is_read(tmp_path: Path) -> None:
    stream = io.BytesIO()
    Image.fromarray(FOUR).save(stream, "TGA")
    mesh = load_mesh(painted(tmp_path, stream.getvalue(), suffix="tga"))
    assert mesh.notes == ()
    np.testing.assert_array_equal(mesh.textures[0].pixels, FOUR)


@pytest.mark.parametrize("kind", ["obj", "gltf", "ply"])
def test_a_picture_outside_of_the_folder_is_not_read_but_noted(tmp_path: Path, kind: str) -> None:
    (tmp_path / "source").mkdir()
    (tmp_path / "textures").mkdir()
    (tmp_path / "textures" / "wood.png").write_bytes(png(FOUR))
    folder, outside = tmp_path / "source", "../textures/wood.png"

    def read() -> Mesh:
        if kind == "obj":
            return load_mesh(obj(folder, "f 1/1 2/2 3/3", f"map_Kd {outside}"))
        if kind == "gltf":
            return load_mesh(gltf(folder, images=[{"uri": outside}]))
        return load_mesh(
            ply(folder, "float s;float t|", ["0 0", "1 0", "1 1", "0 1"], ["3 0 1 2"], f"TextureFile {outside}")
        )

    assert read().textures == () and [note.partition(": ")[2] for note in read().notes] == [
        "1 picture of a texture is outside of the mesh's folder (../textures/wood.png): surfaces have their base"
        " colour; copies in the folder are read"
    ]
    (folder / "wood.png").write_bytes(png(FOUR))
    assert read().notes == () and len(read().textures) == 1


def test_of_missing_pictures_the_first_is_named(tmp_path: Path) -> None:
    file = painted(tmp_path, b"", b"", b"")
    for number in range(3):
        (tmp_path / f"{number}.png").unlink()
    assert load_mesh(file).notes == (
        f"mesh {file}: 3 pictures of textures are missing (the first is 0.png): surfaces have their base colour",
    )


@pytest.mark.parametrize(
    ("written", "files", "is_found"),
    [
        ('"a b.png"', ["a b.png"], True),
        ('-s 1 1 1 "a b.tga"', ["a b.tga"], True),
        ("maps/case.png", ["Maps/Case.PNG"], True),
        ("case.png", ["Case.png", "CASE.png"], False),
        ("case.png", ["case.png", "CASE.png"], True),
    ],
)
def test_names_of_pictures_may_have_quotes_and_another_case(
    tmp_path: Path, written: str, files: list[str], is_found: bool
) -> None:
    for name in files:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        Image.fromarray(FOUR if name == files[0] else 255 - FOUR).save(tmp_path / name)
    mesh = load_mesh(obj(tmp_path, "f 1/1 2/2 3/3", f"map_Kd {written}"))
    assert [texture.pixels.tolist() for texture in mesh.textures] == [FOUR.tolist()] * is_found
    assert ["is missing (case.png): " in note for note in mesh.notes] == [True] * (not is_found)


@pytest.mark.parametrize("missing", ["images", "textures"])
def test_a_texture_that_does_not_exist_is_refused(tmp_path: Path, missing: str) -> None:
    with pytest.raises(UserError, match=rf"{missing}\[0\] is used, but does not exist"):
        load_mesh(gltf(tmp_path, **{missing: []}))


def test_specular_glossiness_gives_the_base_colour(tmp_path: Path) -> None:
    values = {"diffuseFactor": [0.5, 1, 1, 1], "diffuseTexture": {"index": 0}, "glossinessFactor": 0.2}
    material = {"extensions": {"KHR_materials_pbrSpecularGlossiness": values}, "doubleSided": True}
    mesh = load_mesh(gltf(tmp_path, materials=[material]))
    assert mesh.materials[0] == MeshMaterial(albedo=(0.5, 1.0, 1.0), texture=0) and mesh.notes == ()


def test_open_single_sided_faces_are_noted(tmp_path: Path) -> None:
    mesh = load_mesh(gltf(tmp_path, materials=[{"pbrMetallicRoughness": {"metallicFactor": 0}}]))
    assert mesh.notes[-1].endswith(
        "a.gltf: open single-sided surfaces are shown from behind: viewers show their front only"
    )


PLY_SQUARE = [(0, 0), (1, 0), (1, 1), (0, 1)]


def ply(
    folder: Path, header: str, vertices: list[str], faces: list[str], comment: str = "TextureFile a b.png "
) -> Path:
    """A PLY file of `PLY_SQUARE`, with further properties after `x y z` and after the corners."""
    (folder / "a b.png").write_bytes(png(FOUR))
    of_vertex, of_face = header.split("|")
    lines = ["ply", "format ascii 1.0", f"comment {comment}", "element vertex 4"]
    lines += [f"property float {name}" for name in "x y z".split()]
    lines += [f"property {words}" for words in of_vertex.split(";") if words]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    lines += [f"property {words}" for words in of_face.split(";") if words]
    rows = [f"{x} {y} 0 {more}" for (x, y), more in zip(PLY_SQUARE, vertices, strict=True)]
    (folder / "a.ply").write_text("\n".join([*lines, "end_header", *rows, *faces]) + "\n")
    return folder / "a.ply"


@pytest.mark.parametrize("names", ["s t", "u v", "texture_u texture_v"])
def test_positions_of_the_vertices_of_ply(tmp_path: Path, names: str) -> None:
    """The names of Blender, Assimp and MeshLab; v goes up."""
    header = ";".join(f"float {name}" for name in names.split()) + "|"
    mesh = load_mesh(ply(tmp_path, header, ["0 0", "1 0", "1 1", "0 1"], ["4 0 1 2 3"]))
    assert mesh.materials == (MeshMaterial(albedo=(1.0, 1.0, 1.0), texture=0),) and mesh.notes == ()
    assert mesh.corner_uvs is not None
    np.testing.assert_allclose(mesh.corner_uvs, mesh.vertices[mesh.faces][..., :2] * (1, -1) + (0, 1))
    np.testing.assert_array_equal(mesh.textures[0].pixels, FOUR)


def test_positions_of_the_corners_of_ply(tmp_path: Path) -> None:
    """MeshLab's form: a list of a face, and the number of its picture; one that does not fit shows none."""
    (tmp_path / "c.png").write_bytes(png(FOUR[::-1]))
    faces = ["3 0 1 2 6 0 0 1 0 1 1 1", "3 0 2 3 6 0 0 1 1 0 1 0", "3 0 1 3 2 0 0 0", "3 1 2 3 6 0 0 1 1 0 1 7"]
    header = "|list uchar float texcoord;int texnumber"
    mesh = load_mesh(ply(tmp_path, header, [""] * 4, faces, "TextureFile a b.png\ncomment TextureFile c.png"))
    textures = [mesh.materials[index].texture for index in mesh.face_materials]
    pixels = [None if texture is None else mesh.textures[texture].pixels[0, 0, 0] for texture in textures]
    assert pixels == [0, 255, None, None]
    assert mesh.notes[0].endswith("1 face of a textured material is untextured: texture coordinates are missing")
    assert mesh.corner_uvs is not None
    np.testing.assert_allclose(mesh.corner_uvs[0], mesh.vertices[mesh.faces[0]][:, :2] * (1, -1) + (0, 1))


@pytest.mark.parametrize("corner_colours", [True, False])
def test_a_texture_of_ply_is_shown_before_colours(tmp_path: Path, corner_colours: bool) -> None:
    header = "float s;float t;uchar red;uchar green;uchar blue;uchar alpha|"
    rows = ["0 0 255 0 0 255", "1 0 255 255 255 255", "1 1 255 255 255 9", "0 1 255 255 255 255"]
    mesh = load_mesh(ply(tmp_path, header, rows, ["3 0 1 2"]), corner_colours=corner_colours)
    assert mesh.materials == (MeshMaterial(albedo=(1.0, 1.0, 1.0), texture=0),) and mesh.corner_colours is None
    assert [note.partition(": ")[2] for note in mesh.notes] == [
        "1 partly transparent vertex is opaque: transparency is not rendered",
        "1 colour of a textured face is not shown: textures are",
    ]


def test_a_picture_of_ply_that_is_missing_is_noted(tmp_path: Path) -> None:
    mesh = load_mesh(ply(tmp_path, "float s;float t|", ["0 0"] * 4, ["3 0 1 2"], "TextureFile ../none.png"))
    assert mesh.notes[0].endswith("1 picture of a texture is missing (../none.png): surfaces have their base colour")
    assert mesh.materials == (MeshMaterial(),)


@pytest.mark.parametrize(
    "names", ["r g b a", "color_0 color_1 color_2 color_3", "diffuse_red diffuse_green diffuse_blue x_"]
)
def test_colours_of_ply_have_several_names(tmp_path: Path, names: str) -> None:
    header = ";".join(f"uchar {name}" for name in names.split()) + "|"
    mesh = load_mesh(ply(tmp_path, header, ["255 0 0 255"] * 4, ["3 0 1 2"], ""), corner_colours=True)
    assert mesh.corner_colours is not None
    np.testing.assert_allclose(mesh.corner_colours, np.full((1, 3, 3), (1.0, 0.0, 0.0)))


def test_properties_of_ply_that_are_not_read_are_named(tmp_path: Path) -> None:
    """But not the measures of a scan. Positions without a picture show nothing either."""
    header = "float confidence;float s;float t|uchar flags"
    mesh = load_mesh(ply(tmp_path, header, ["1 0 0"] * 4, ["3 0 1 2 0"], "none"))
    assert mesh.notes[0].endswith("3 properties are not read: vertex.s, vertex.t, face.flags")
    many = ";".join(f"float p{number}" for number in range(20))
    mesh = load_mesh(ply(tmp_path, f"{many}|", ["0 " * 20] * 4, ["3 0 1 2"], "none"))
    assert mesh.notes[0].endswith("20 properties are not read: " + ", ".join(f"vertex.p{n}" for n in range(8)) + " …")


def test_an_element_of_ply_without_rows_is_read(tmp_path: Path) -> None:
    file = tmp_path / "a.ply"
    file.write_text("ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header\n")
    with pytest.raises(UserError, match="its vertices lack x, y or z"):
        load_mesh(file)


@pytest.mark.parametrize("transform", [{"scale": [1e300, 1]}, {"offset": [0, -1e300]}])
def test_a_huge_transform_of_a_texture_is_refused(tmp_path: Path, transform: dict[str, list[float]]) -> None:
    """Also with an alpha, whose cut counts pixels by whole numbers."""
    info = {"index": 0, "extensions": {"KHR_texture_transform": transform}}
    material = {"pbrMetallicRoughness": {"baseColorTexture": info}, "alphaMode": "MASK"}
    picture = np.dstack([FOUR, np.full((2, 2), 100, np.uint8)])
    with pytest.raises(UserError, match="texture coordinates beyond 1,000,000"):
        load_mesh(gltf(tmp_path, picture, materials=[material]))
