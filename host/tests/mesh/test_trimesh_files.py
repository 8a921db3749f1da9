"""3MF, COLLADA, 3DXML and XAML come through trimesh with places, colours and pictures, and lines on what is lost."""

from __future__ import annotations

import io
import logging
import struct
import subprocess
import sys
import tracemalloc
import warnings
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
from interchange_files import MESH, POINTS, SQUARE, TEXTURED, L, archive, dae, threemf
from PIL import Image
from textured_files import FOUR, png

from colonnade.common import decoder_process
from colonnade.common.errors import UserError
from colonnade.common.srgb import linear_from_srgb
from colonnade.mesh.files import trimesh_counts, trimesh_files, trimesh_program
from colonnade.mesh.files.mesh_archive import MeshArchive
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.mesh import Mesh


@pytest.fixture(autouse=True)
def reader(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read in this process, since the start of another one takes a second; `test_hostile_meshes.py` starts it."""

    def decode(module: str, *arguments: object, data: bytes) -> subprocess.CompletedProcess[bytes]:
        out, errors, status = io.TextIOWrapper(io.BytesIO()), io.StringIO(), 0
        with monkeypatch.context() as patch, warnings.catch_warnings():
            patch.setattr(sys, "argv", [module, *map(str, arguments)])
            patch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))
            patch.setattr(sys, "stdout", out)
            patch.setattr(sys, "stderr", errors)
            patch.setattr(logging.getLogger("trimesh"), "handlers", [])
            patch.setattr(trimesh_program, "limit_this_process", lambda *_: None)
            try:
                trimesh_program._main()
            except SystemExit as end:
                status = int(end.code or 0)
            return subprocess.CompletedProcess([], status, out.detach().getvalue(), errors.getvalue().encode())

    monkeypatch.setattr(trimesh_files, "decode", decode)


def loaded(folder: Path, name: str, content: bytes | str) -> Mesh:
    (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
    return load_mesh(folder / name)


def notes(mesh: Mesh) -> list[str]:
    return [note.split(": ", 1)[1] for note in mesh.notes]


def area(mesh: Mesh) -> float:
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def box(mesh: Mesh) -> list[list[float]]:
    return np.round([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)], 6).tolist()


def test_the_items_of_3mf_are_instances_in_metres(tmp_path: Path) -> None:
    build = '<item objectid="2" transform="1 0 0 0 1 0 0 0 1 0 0 5"/><item objectid="1"/>'
    parts = f'<object id="1">{MESH}</object><object id="2"><components><component objectid="1"/></components></object>'
    mesh = loaded(tmp_path, "a.3mf", threemf(parts, build, 'unit="inch"'))
    assert (len(mesh.faces), mesh.notes) == (4, ())
    assert box(mesh) == [[0, 0, 0], [0.0254, 0.0254, 0.127]]
    assert box(loaded(tmp_path, "b.3MF", threemf()))[1] == [0.001, 0.001, 0]


@pytest.mark.parametrize("suffix", ["3mf", "dae"])
def test_a_file_of_trimesh_has_the_triangles_of_its_mesh(suffix: str, tmp_path: Path) -> None:
    sphere = trimesh.creation.icosphere(2)
    mesh = loaded(tmp_path, f"a.{suffix}", sphere.export(file_type=suffix))
    scale = np.ptp(mesh.vertices, axis=0) / sphere.extents
    np.testing.assert_allclose(scale, 0.001 if suffix == "3mf" else 1.0, rtol=1e-6)
    assert len(mesh.faces) == len(sphere.faces)
    assert area(mesh) == pytest.approx(sphere.area * scale[0] ** 2, rel=1e-6)


def test_collada_has_its_axis_its_unit_and_its_nodes(tmp_path: Path) -> None:
    asset = '<unit meter="0.5"/><up_axis>{}_UP</up_axis>'
    place = "<translate>1 2 3</translate>"
    mesh = loaded(tmp_path, "a.dae", dae(asset=asset.format("Z"), instance=place))
    assert box(mesh) == [[0.5, 1.5, -1.5], [1, 1.5, -1]]
    assert box(loaded(tmp_path, "b.dae", dae(asset=asset.format("X"), instance=place))) == [
        [-1.5, 0.5, 1.5],
        [-1, 1, 1.5],
    ]
    assert box(loaded(tmp_path, "c.dae", dae(instance=place))) == [[1, 2, 3], [2, 3, 3]]


def test_concave_polygons_of_collada_are_no_fans(tmp_path: Path) -> None:
    mesh = loaded(tmp_path, "a.dae", dae(L))
    assert (len(mesh.faces), area(mesh), mesh.notes) == (4, pytest.approx(3.0), ())


def test_colours_of_collada_are_srgb_but_those_of_blender(tmp_path: Path) -> None:
    blender = "<contributor><authoring_tool>Blender 2.79.0</authoring_tool></contributor>"
    effect = "<diffuse><color>0.4 1 0 1</color></diffuse><transparent><color>0 0 0 0</color></transparent>"
    for asset, expected in (("", linear_from_srgb(np.array([0.4]))[0]), (blender, 0.4)):
        (material,) = loaded(tmp_path, "a.dae", dae(asset=asset, effect=effect)).materials
        assert material.albedo == (pytest.approx(expected, abs=1e-6), 1, 0)
    colours = f"""<source id="k"><float_array id="ka" count="30">{"0.4 1 0 " * 10}</float_array><technique_common>
<accessor source="#ka" count="10" stride="3"><param name="R" type="float"/><param name="G" type="float"/>
<param name="B" type="float"/></accessor></technique_common></source>"""
    inputs = '<input semantic="COLOR" source="#k" offset="0"/>'
    mesh = loaded(tmp_path, "a.dae", dae(effect="", arrays=colours, inputs=inputs))
    assert mesh.materials[0].albedo == (pytest.approx(linear_from_srgb(np.array([0.4]))[0]), 1, 0)


def test_pictures_of_collada_lie_beside_it_or_in_its_archive(tmp_path: Path) -> None:
    targa = io.BytesIO()
    Image.fromarray(FOUR).save(targa, "TGA")
    (tmp_path / "a b.tga").write_bytes(targa.getvalue())
    for name, image, content in (
        ("a.dae", "./a%20b.tga", None),
        ("b.dae", r"C:\\models\\a b.tga", None),
        ("a.zae", "../maps/a.png", {"maps_a__png": png(FOUR)}),
        ("b.zae", "a.tga", {"dae_a__tga": targa.getvalue()}),
    ):
        text = dae(image=image, **TEXTURED)
        mesh = loaded(tmp_path, name, text if content is None else archive(dae_a__dae=text, **content))
        assert mesh.notes == () and [texture.pixels.tolist() for texture in mesh.textures] == [FOUR.tolist()]
        assert mesh.corner_uvs is not None
        places = np.concatenate([mesh.vertices[mesh.faces][:, :, :1], 1 - mesh.vertices[mesh.faces][:, :, 1:2]], axis=2)
        np.testing.assert_allclose(mesh.corner_uvs, places)
    for file, content in (("c.dae", None), ("c.zae", {"other__png": png(FOUR)})):
        text = dae(image="none.png", **TEXTURED)
        mesh = loaded(tmp_path, file, text if content is None else archive(a__dae=text, **content))
        assert notes(mesh)[0] == "1 picture of a texture is missing (none.png): surfaces have their base colour"
    (tmp_path / "inner").mkdir()
    mesh = loaded(tmp_path / "inner", "a.dae", dae(image="../a%20b.tga", **TEXTURED))
    assert "1 picture of a texture is outside of the mesh's folder (../a b.tga)" in notes(mesh)[0]


def test_normals_of_the_file_stay_and_missing_ones_follow_the_crease_angle(tmp_path: Path) -> None:
    box_ = trimesh.creation.box()
    smooth = loaded(
        tmp_path, "a.dae", trimesh.Trimesh(box_.vertices, box_.faces, process=False).export(file_type="dae")
    )
    flat = loaded(tmp_path, "a.3mf", box_.export(file_type="3mf"))
    corners = smooth.vertices[smooth.faces]
    directions = corners / np.linalg.norm(corners, axis=2, keepdims=True)
    assert ((smooth.corner_normals * directions).sum(axis=2) > 0.8).all()
    assert (np.abs(flat.corner_normals).max(axis=2) > 0.999).all()


XAML = """<Page xmlns="http://schemas.microsoft.com/winfx/2006/xaml/presentation"><ModelVisual3D><GeometryModel3D>
<GeometryModel3D.Geometry><MeshGeometry3D Positions="0,0,0 1,0,0 0,1,0" Normals="0,0,1 0,0,1 0,0,1"
 TriangleIndices="0 1 2"/></GeometryModel3D.Geometry><GeometryModel3D.Material><DiffuseMaterial><DiffuseMaterial.Brush>
<SolidColorBrush Color="#FF0000" Opacity="1"/></DiffuseMaterial.Brush></DiffuseMaterial></GeometryModel3D.Material>
</GeometryModel3D></ModelVisual3D></Page>"""
MANIFEST = "<Manifest><Root>a.3dxml</Root></Manifest>"
STRUCTURE = """<Model_3dxml xmlns="http://www.3ds.com/xsd/3DXML"><ProductStructure root="1">
<Reference3D id="1" name="A"/><Reference3D id="2" name="B"/>
<Instance3D id="3" name="B"><IsAggregatedBy>1</IsAggregatedBy><IsInstanceOf>2</IsInstanceOf>
<RelativeMatrix>1 0 0 0 1 0 0 0 1 0 0 5</RelativeMatrix></Instance3D>
<ReferenceRep id="5" name="C" format="TESSELLATED" associatedFile="urn:3DXML:a.3DRep"/><InstanceRep id="4" name="D">
<IsAggregatedBy>2</IsAggregatedBy><IsInstanceOf>5</IsInstanceOf></InstanceRep></ProductStructure></Model_3dxml>"""
REP = """<R xmlns="http://www.3ds.com/xsd/3DXML" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"><Rep>
<Faces><Face fans="0 1 2 3"><SurfaceAttributes><Color xsi:type="RGBAColorType" red="1" green="0" blue="0"/>
</SurfaceAttributes></Face></Faces><VertexBuffer><Positions>0 0 0,1 0 0,1 1 0,0 1 0</Positions>
<Normals>0 0 1,0 0 1,0 0 1,0 0 1</Normals></VertexBuffer></Rep></R>"""


def test_3dxml_and_xaml_have_the_colours_of_their_faces(tmp_path: Path) -> None:
    mesh = loaded(tmp_path, "a.xaml", XAML)
    note = "{} the albedo of {} faces: a face has one colour, the mean of its corners"
    assert (box(mesh), notes(mesh)) == (
        [[0, 0, 0], [1, 1, 0]],
        [note.format("1 colour of vertices or faces is", "its")],
    )
    assert [material.albedo for material in mesh.materials] == [(1, 0, 0)]
    mesh = loaded(tmp_path, "a.3dxml", archive(Manifest__xml=MANIFEST, a__3dxml=STRUCTURE, a__3DRep=REP))
    assert (len(mesh.faces), box(mesh)) == (2, [[0, 0, 0.005], [0.001, 0.001, 0.005]])
    assert [material.albedo for material in mesh.materials] == [(1, 0, 0)]


def source(name: str, kind: str, values: str, parameter: str) -> str:
    """A source of COLLADA with one value, or one matrix."""
    count = len(values.split())
    return (
        f'<source id="{name}"><{kind}_array id="{name}a" count="{count}">{values}</{kind}_array><technique_common>'
        f'<accessor source="#{name}a" count="1" stride="{count}">{parameter}</accessor></technique_common></source>'
    )


def test_skins_of_collada_have_the_pose_in_which_they_were_bound(tmp_path: Path) -> None:
    moved = "1 0 0 5 0 1 0 0 0 0 1 0 0 0 0 1"
    skin = (
        f'<skin source="#g"><bind_shape_matrix>{moved}</bind_shape_matrix>'
        + source("j", "Name", "bone", '<param name="JOINT" type="name"/>')
        + source("b", "float", moved, '<param name="TRANSFORM" type="float4x4"/>')
        + source("z", "float", "1", '<param name="WEIGHT" type="float"/>')
        + '<joints><input semantic="JOINT" source="#j"/><input semantic="INV_BIND_MATRIX" source="#b"/></joints>'
        '<vertex_weights count="1"><input semantic="JOINT" source="#j" offset="0"/><input semantic="WEIGHT" source="#z"'
        ' offset="1"/><vcount>1</vcount><v>0 0</v></vertex_weights></skin>'
    )
    library = (
        f'<library_controllers><controller id="k">{skin}</controller></library_controllers><library_visual_scenes>'
    )
    text = dae().replace("<library_visual_scenes>", library).replace('_geometry url="#g"', '_controller url="#k"')
    mesh = loaded(tmp_path, "a.dae", text.replace("</instance_geometry>", "</instance_controller>"))
    assert box(mesh) == [[5, 0, 0], [6, 1, 0]] and mesh.materials[0].albedo[1] == 1
    assert notes(mesh) == ["1 skin is not applied: meshes have the pose in which they were bound"]


def test_what_trimesh_passes_over_is_noted(tmp_path: Path) -> None:
    asset = '<x><animation id="a"/><animation/></x><instance_light/><wrap_s>CLAMP</wrap_s>'
    broken = dae(asset=asset).replace(
        "<library_materials>", '<library_lights><light id="l"/></library_lights><library_materials>'
    )
    assert notes(loaded(tmp_path, "a.dae", broken)) == [
        "2 animations are not played: nodes stand as the file places them",
        "1 light is not used: the scene file has the lights",
        "1 wrap of a texture is not used: pictures repeat",
        "1 part is not read as it stands: DaeIncompleteError: Missing common technique in light",
    ]
    crossing = dae((4, "0 2 1 3"))
    assert "1 polygon crosses or folds over itself: triangles may overlap" in notes(loaded(tmp_path, "a.dae", crossing))
    groups = f'<m:colorgroup xmlns:m="m" id="3"/><basematerials id="4"/><object id="1">{MESH}</object>'
    assert notes(loaded(tmp_path, "a.3mf", threemf(groups))) == [
        "2 groups of materials or colours are not read: faces have the default material"
    ]
    two = archive(a__dae=dae(), b__dae=dae())
    assert notes(loaded(tmp_path, "a.zae", two)) == ["1 further scene is not shown: only the default scene is rendered"]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.dae", dae().replace("POSITION", "PLACE"), "has no faces|cannot be read"),
        ("a.dae", dae((4, "0 1 2 99")), "has no faces|cannot be read"),
        ("a.dae", dae().replace(POINTS, POINTS.replace("4 1 0", "4 x 0")), "has no faces|cannot be read"),
        ("a.dae", dae(SQUARE).replace("0 0 0 1 0 0", "nan 0 0 1 0 0"), "a value is not a finite number"),
        ("a.dae", dae(SQUARE).replace("0 0 0 1 0 0", "inf 0 0 1 0 0"), "vertex 0 is not a finite number"),
        ("a.dae", dae(instance="<translate>1 inf 0</translate>"), "the transform of g is not finite"),
        ("a.3mf", threemf(f'<object id="1">{MESH.replace("1", "x", 1)}</object>'), "cannot be read as a mesh: "),
        ("a.3mf", threemf(f'<object id="1">{MESH.replace("v3=", "w3=")}</object>'), "cannot be read as a mesh: "),
        (
            "a.3mf",
            threemf(f'<object id="1">{MESH.replace(chr(34) + "3" + chr(34), chr(34) + "9" + chr(34))}</object>'),
            "names vertex 9",
        ),
        ("a.3mf", threemf(unit='unit="cubit"'), "its unit is cubit: 3MF has micron, "),
        ("a.3mf", threemf(unit='unit="parsec"'), "its unit is parsec: 3MF has micron, "),
        ("a.dae", dae(asset='<unit meter="-1"/>'), "its unit has -1.0 metres: it must be a positive length"),
        ("a.dae", dae(asset='<unit meter="0"/>'), "its unit has 0.0 metres"),
        ("a.dae", dae(asset='<unit meter="1e999"/>'), "its unit has inf metres"),
        ("a.dae", dae((4, "0 1 2 -2")), "a face names vertex -2, which does not exist"),
        ("a.dae", dae((3, "0 1 -2")).replace("polylist", "triangles"), "a face names vertex -2, which does not exist"),
        ("a.xaml", XAML.replace("0 1 2", "0 1 -1"), "a face names vertex -1, which does not exist"),
        ("a.3mf", archive(a__txt=""), "its archive holds no file that ends with 3d/3dmodel.model"),
        ("a.3mf", b"PK", "File is not a zip file"),
        ("a.zae", archive(a__txt=""), "its archive holds no file that ends with .dae"),
        ("a.3dxml", archive(a__3dxml="<a/>"), "cannot be read as a mesh: KeyError"),
        ("a.3dxml", archive(a__txt=""), "its archive holds no file that ends with .3dxml"),
        ("a.xaml", "<a/>", "has no faces|cannot be read"),
        ("a.xaml", XAML[:-9], "cannot be read as a mesh: XMLSyntaxError"),
    ],
)
def test_invalid_files_are_one_line(name: str, content: bytes | str, message: str, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=message) as refused:
        loaded(tmp_path, name, content)
    assert str(tmp_path / name) in str(refused.value)


def test_names_of_equal_parts_are_found_in_proportion_to_their_number() -> None:
    class Names(set[str]):
        asked = 0

        def __contains__(self, name: object) -> bool:
            self.asked += 1
            return super().__contains__(name)

    names = Names()
    trimesh_counts.bound_parts(1)
    for _ in range(300):
        names.add(trimesh.exchange.threemf.unique_name("part", names))
    assert (len(names), names.asked) == (300, 600 - 1)


def test_a_member_is_unpacked_to_the_size_that_its_archive_states() -> None:
    data = archive(a__dae="<a>" + " " * (1 << 24))
    directory = data.index(b"PK\1\2")
    lying = MeshArchive(data[: directory + 24] + struct.pack("<I", 100) + data[directory + 28 :])
    tracemalloc.start()
    try:
        with pytest.raises(zipfile.BadZipFile):
            lying.read("a.dae")
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()


def test_pictures_of_an_archive_are_not_held_together(tmp_path: Path) -> None:
    """The host reads them from the archive, one after the other; the other process names them."""
    picture = Image.fromarray(np.random.default_rng(1).integers(0, 255, (512, 512, 3), dtype=np.uint8))
    content = io.BytesIO()
    picture.save(content, "PNG")
    (tmp_path / "a.zae").write_bytes(archive(a__dae=dae(image="a.png", **TEXTURED), a__png=content.getvalue()))
    done = trimesh_files.decode("trimesh_program", 0, 0, ".zae", data=(tmp_path / "a.zae").read_bytes())
    assert len(done.stdout) < 10_000 < len(content.getvalue())
    assert load_mesh(tmp_path / "a.zae").textures[0].size == (512, 512)


def test_a_reader_that_does_not_start_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trimesh_files, "decode", decoder_process.decode)
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with pytest.raises(UserError, match="trimesh_program does not start: no reason given: install Colonnade"):
        loaded(tmp_path, "a.3mf", threemf())


def test_the_host_does_not_import_trimesh(tmp_path: Path) -> None:
    (tmp_path / "a.3mf").write_bytes(threemf())
    code = (
        "import sys; from colonnade.mesh.load import load_mesh; load_mesh(sys.argv[1]); print(*sys.modules, sep='\\n')"
    )
    command = [sys.executable, "-I", "-c", code, tmp_path / "a.3mf"]
    modules = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    assert {"trimesh", "lxml", "collada", "networkx"}.isdisjoint(modules) and trimesh_files.__name__ in modules
