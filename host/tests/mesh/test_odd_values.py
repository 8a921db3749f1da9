"""Values in mesh files that no exporter should write: refused or noted in plain words, without warnings."""

from __future__ import annotations

import copy
import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from colonnade.common.errors import UserError
from colonnade.common.srgb import linear_from_srgb
from colonnade.mesh.load import load_mesh

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
ODD = [None, True, -1, 1, 99, 1e300, 2**40, "x", [], {}, [[]], [{}], [None], [1e300] * 3, [0, 0, 0, 1e300], {"a": 1}]


def document(folder: Path, colours: list[list[float]] | None = None, **node: Any) -> dict[str, Any]:
    """A triangle with colours, whose material has a base-colour texture."""
    arrays = [np.eye(3), np.eye(3) if colours is None else np.array(colours), np.eye(3)[:, :2]]
    data = b"".join(array.astype("<f4").tobytes() for array in arrays)
    (folder / "a.bin").write_bytes(data)
    attributes = {"POSITION": 0, "COLOR_0": 1, "TEXCOORD_0": 2}
    return {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, **node}],
        "meshes": [{"primitives": [{"attributes": attributes, "material": 0}]}],
        "materials": [
            {"emissiveFactor": [0, 0, 0], "extensions": {}, "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
        ],
        "textures": [{"source": 0}],
        "images": [{"uri": "none.png"}],
        "accessors": [
            {"bufferView": k, "componentType": 5126, "count": 3, "type": "VEC2" if k == 2 else "VEC3"} for k in range(3)
        ],
        "bufferViews": [{"buffer": 0, "byteOffset": 36 * k, "byteLength": 24 if k == 2 else 36} for k in range(3)],
        "buffers": [{"byteLength": len(data), "uri": "a.bin"}],
    }


def loaded(folder: Path, content: dict[str, Any]) -> tuple[str, ...]:
    """The notes of a glTF document; warnings are errors."""
    (folder / "a.gltf").write_text(json.dumps(content))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return load_mesh(folder / "a.gltf").notes


@pytest.mark.parametrize(
    "node",
    [
        {"rotation": [1e300, 0, 0, 1e300]},
        {"scale": [1e200, 1, 1]},
        {"matrix": [1e300] * 16},
        {"translation": [1e300] * 3},
    ],
)
def test_huge_transforms_are_refused_or_normalised_without_warnings(tmp_path: Path, node: dict[str, Any]) -> None:
    if "rotation" in node:
        assert loaded(tmp_path, document(tmp_path, **node))
    else:
        with pytest.raises(UserError, match="the transform of node 0 is not finite, or too large"):
            loaded(tmp_path, document(tmp_path, **node))


def test_colours_that_are_not_colours_are_refused_or_noted(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="a COLOR_0 that is not a finite number"):
        loaded(tmp_path, document(tmp_path, [[np.nan, 0, 0]] * 3))
    notes = loaded(tmp_path, document(tmp_path, [[1e30, 0, 0], [-1, 0, 0], [0, 0, 0]]))
    assert any("2 colours of vertices are clipped: colours are from 0 to 1" in note for note in notes)


def test_colours_of_text_files_are_bytes_or_shares_or_noted(tmp_path: Path) -> None:
    def read(red: str) -> tuple[list[float], tuple[str, ...]]:
        (tmp_path / "a.obj").write_text(
            "".join(f"v {at} {red} 0 0\n" for at in ("0 0 0", "1 0 0", "0 1 0")) + "f 1 2 3"
        )
        mesh = load_mesh(tmp_path / "a.obj", corner_colours=True)
        assert mesh.corner_colours is not None
        return mesh.corner_colours[0, :, 0].tolist(), tuple(note.partition(".obj: ")[2] for note in mesh.notes)

    assert read("51") == read("0.2") == (pytest.approx([0.0331] * 3, abs=1e-4), ())
    assert read("1.5") == ([1.0] * 3, ("3 colours of vertices are clipped: colours are from 0 to 1",))
    assert read("nan") == ([0.0] * 3, ("3 colours of vertices are black: colours are finite numbers",))


def test_what_unread_extensions_hold_is_not_checked(tmp_path: Path) -> None:
    content = document(tmp_path)
    content["textures"] = [{"extensions": {"MSFT_texture_dds": {"source": 0}}}]
    content["extensionsRequired"] = ["KHR_materials_emissive_strength", "KHR_materials_unlit"]
    content["bufferViews"][0]["extensions"] = {"EXT_meshopt_compression": {"mode": "ATTRIBUTES"}}
    assert "1 picture of a texture is not readable" in loaded(tmp_path, content)[0]


@pytest.mark.parametrize("name", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
def test_compressed_meshes_are_refused_with_what_to_do(name: str, tmp_path: Path) -> None:
    """Also of a file that does not require the extension, and whose buffer in its place has no data."""
    required = document(tmp_path) | {"extensionsRequired": [name]}
    optional = document(tmp_path)
    optional["buffers"] = [{"byteLength": 96, "extensions": {name: {"fallback": True}}}]
    for content in (required, optional):
        with pytest.raises(UserError, match=rf"its meshes are compressed \({name}\): export it without compression"):
            loaded(tmp_path, content)


def test_a_negative_emission_is_refused(tmp_path: Path) -> None:
    content = document(tmp_path)
    content["materials"][0]["emissiveFactor"] = [-1, 0, 0]
    with pytest.raises(UserError, match="material 0 has a factor that is negative"):
        loaded(tmp_path, content)


@given(st.data())
@settings(max_examples=200)
def test_odd_types_in_gltf_are_refused_in_plain_words(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    folder = tmp_path_factory.mktemp("odd")
    content = document(folder)
    place: Any = content
    while True:
        key = data.draw(st.sampled_from(sorted(place) if isinstance(place, dict) else list(range(len(place)))))
        if not isinstance(place[key], dict | list) or not place[key] or data.draw(st.integers(0, 4)) == 0:
            break
        place = place[key]
    place[key] = copy.deepcopy(data.draw(st.sampled_from(ODD)))
    try:
        loaded(folder, content)
    except UserError as error:
        assert "Error:" not in str(error) and "Warning" not in str(error)


def test_texture_positions_of_one_number_and_of_huge_indices(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(f"{TRIANGLE}vt 0.5\nf 1/1 2/1 3/{'9' * 20}\n")
    assert len(load_mesh(tmp_path / "a.obj").faces) == 1


def test_a_negative_shininess_is_noted(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text("newmtl a\nKd 0.25 0.5 0.75\nNs -1.96\n")
    (tmp_path / "a.obj").write_text(f"mtllib a.mtl\nusemtl a\n{TRIANGLE}f 1 2 3\n")
    mesh = load_mesh(tmp_path / "a.obj")
    assert mesh.materials[0].albedo == pytest.approx(linear_from_srgb(np.array([0.25, 0.5, 0.75])))
    assert mesh.notes[0].endswith("1 material's negative Ns is taken as 0: highlights are not rendered")


@pytest.mark.parametrize(
    ("line", "note"),
    [
        ("Kd red", "1 value of a material is not read (Kd red)"),
        ("Kd 0.5", "1 value of a material is not read (Kd 0.5)"),
        ("Kd 1 1 x\nillum a", "2 values of materials are not read (the first is Kd 1 1 x)"),
        ("Kd 1 1 1 # red\nd 1.0", ""),
    ],
)
def test_values_of_materials_that_are_no_numbers_are_noted(tmp_path: Path, line: str, note: str) -> None:
    (tmp_path / "a.mtl").write_text(f"newmtl a\n{line}\n")
    (tmp_path / "a.obj").write_text(f"mtllib a.mtl\nusemtl a\n{TRIANGLE}f 1 2 3\n")
    notes = [one.partition(".obj: ")[2] for one in load_mesh(tmp_path / "a.obj").notes]
    assert notes == [f"{note}: a colour has three numbers, others have one"] * bool(note)


@pytest.mark.parametrize("normal", ["-nan(ind) 0 0", "-1.#IND 0 0", "0 0"])
def test_normals_of_stl_that_are_no_numbers_print_nothing(
    tmp_path: Path, normal: str, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    """Normals of STL are not used; some programs write these for facets without area."""
    corners = "".join(f"vertex {corner}\n" for corner in ("0 0 0", "1 0 0", "0 1e0 0"))
    facet = f"facet normal {normal}\nouter loop\n{corners}endloop\nendfacet\n"
    (tmp_path / "a.stl").write_text(f"solid a\n{facet}endsolid a\nsolid b\n{facet.replace('1e0', '-1')}endsolid b\n")
    mesh = load_mesh(tmp_path / "a.stl")
    assert len(mesh.faces) == 2 and mesh.notes == ()
    assert caplog.records == [] and capfd.readouterr().err == ""


PLY = (
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 2\nproperty list uchar int vertex_indices\nproperty uchar red\nproperty uchar green\n"
    "property uchar blue\nend_header\n"
)


def test_rows_of_ply_that_are_longer_than_the_header_states(tmp_path: Path) -> None:
    """Of a line is read what the header states; a row may also go over several lines."""
    plain = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 255 0 0\n3 0 2 3 255 0 0\n"
    longer = "".join(f"{line} 6 0.5\n" for line in plain.splitlines())
    for text, values in ((plain, ""), (plain.replace(" ", "\n"), ""), (longer, "12"), (plain + "0 0 0\n", "3")):
        (tmp_path / "a.ply").write_text(PLY + text)
        mesh = load_mesh(tmp_path / "a.ply")
        assert [material.albedo for material in mesh.materials] == [(1, 0, 0)]
        assert sorted(map(tuple, mesh.vertices[mesh.faces].reshape(-1, 3)))[::2] == [(0, 0, 0), (0, 1, 0), (1, 1, 0)]
        note = "values beyond those of the header are not read: a row has those of the header"
        assert [one for one in mesh.notes if "values" in one] == [f"mesh {tmp_path}/a.ply: {values} {note}"] * bool(
            values
        )


def test_faces_of_obj_with_normals_that_the_file_lacks(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(f"{TRIANGLE}f 1//7 2//8 3\n")
    mesh = load_mesh(tmp_path / "a.obj")
    assert len(mesh.faces) == 1 and mesh.notes[0].endswith(
        "2 corners have no normal: normals are computed from the faces"
    )
    (tmp_path / "a.obj").write_text(f"vn 0 0 1\n{TRIANGLE}f 1//1 2//1 3//2\n")
    with pytest.raises(UserError, match="a face names normal 2, but the file has 1 normals"):
        load_mesh(tmp_path / "a.obj")
