"""Mesh files: normals, colours and strips of each format, and the lines on what is lost."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from colonnade.common.errors import UserError
from colonnade.common.limits import MAX_TRIANGLES
from colonnade.common.srgb import linear_from_srgb
from colonnade.mesh.geometry.normals import face_normals
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.mesh import Mesh

POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
#: Normals that lean away from the middle of `POINTS`.
LEANING = np.array([[-0.6, 0, 0.8], [0.6, 0, 0.8], [0, 0.6, 0.8], [0.6, 0.0, 0.8]])
OBJ_POINTS = "".join(f"v {x} {y} {z}\n" for x, y, z in POINTS)
OBJ_NORMALS = "".join(f"vn {x} {y} {z}\n" for x, y, z in LEANING)


def written(path: Path, content: str | bytes) -> Path:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def lost(mesh: Mesh) -> list[str]:
    """The notes of a mesh without its name."""
    return [note.partition(": ")[2] for note in mesh.notes]


def gltf(folder: Path, primitives: list[dict[str, Any]], arrays: list[np.ndarray], **changes: Any) -> Path:
    """A glTF file whose accessors are the arrays, in order."""
    data, views, accessors = b"", [], []
    for array in arrays:
        kinds = {"f4": 5126, "u2": 5123, "u1": 5121, "i1": 5120, "u4": 5125}
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes})
        shape = "SCALAR" if array.ndim == 1 else f"VEC{array.shape[1]}"
        accessors.append(
            {
                "bufferView": len(views) - 1,
                "componentType": kinds[array.dtype.str[1:]],
                "count": len(array),
                "type": shape,
            }
        )
        data += array.tobytes() + b"\0" * (-array.nbytes % 4)
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": primitives}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data), "uri": "data:;base64," + base64.b64encode(data).decode()}],
    }
    return written(folder / "a.gltf", json.dumps(document | changes))


def floats(values: np.ndarray) -> np.ndarray:
    return values.astype(np.float32)


def corner_table(mesh: Mesh) -> set[tuple[float, ...]]:
    """Position and normal of each corner, rounded."""
    rows = np.concatenate([mesh.vertices[mesh.faces], mesh.corner_normals], axis=2).reshape(-1, 6)
    return {tuple(np.round(row, 6) + 0.0) for row in rows}


EXPECTED = {tuple(np.round(np.append(point, normal), 6)) for point, normal in zip(POINTS, LEANING, strict=True)}


def test_normals_of_obj_ply_off_and_gltf(tmp_path: Path) -> None:
    rows = "".join(" ".join(map(str, np.append(p, n))) + "\n" for p, n in zip(POINTS, LEANING, strict=True))
    header = "".join(f"property double {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
    lists = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    ply = f"ply\nformat {{}} 1.0\nelement vertex 4\n{header}{lists}"
    values = np.concatenate([POINTS, LEANING], axis=1)
    files = [
        written(tmp_path / "a.obj", f"{OBJ_POINTS}{OBJ_NORMALS}f 1//1 2//2 4//4 3//3\n"),
        written(tmp_path / "r.obj", f"{OBJ_POINTS}{OBJ_NORMALS}f -4/7/-4 -3//-3 \\\n -1//-1 -2//-2\n"),
        written(tmp_path / "a.ply", ply.format("ascii") + rows + "4 0 1 3 2\n"),
        written(
            tmp_path / "b.ply",
            ply.format("binary_big_endian").encode()
            + values.astype(">f8").tobytes()
            + struct.pack(">B4i", 4, 0, 1, 3, 2),
        ),
        written(tmp_path / "a.off", f"NOFF\n4 1 0\n{rows}4 0 1 3 2\n"),
        gltf(
            tmp_path,
            [{"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 2}],
            [floats(POINTS), floats(LEANING), np.array([0, 1, 3, 0, 3, 2], np.uint16)],
        ),
    ]
    for file in files:
        mesh = load_mesh(file)
        assert corner_table(mesh) == EXPECTED and mesh.notes == (), file.name


@given(
    scale=st.tuples(*[st.floats(0.2, 5.0) | st.floats(-5.0, -0.2)] * 3),
    rotation=st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: sum(c * c for c in q) > 0.1),
)
@settings(max_examples=40)
def test_normals_of_a_transformed_node_stay_normal(
    tmp_path_factory: pytest.TempPathFactory, scale: tuple[float, ...], rotation: tuple[float, ...]
) -> None:
    """The normals of a flat face are the transformed face's, also under mirrored and uneven scaling."""
    tilted = POINTS[:3] + np.array([[0.0, 0, 0], [0, 0, 0.5], [0, 0, -0.7]])
    normal = np.cross(tilted[1] - tilted[0], tilted[2] - tilted[0])
    length = float(np.linalg.norm(rotation))
    node = {"mesh": 0, "scale": scale, "rotation": [c / length for c in rotation], "translation": [1, 2, 3]}
    file = gltf(
        tmp_path_factory.mktemp("gltf"),
        [{"attributes": {"POSITION": 0, "NORMAL": 1}}],
        [floats(tilted), floats(np.tile(normal, (3, 1)))],
        nodes=[node],
    )
    mesh = load_mesh(file)
    assert mesh.notes == ()
    expected = face_normals(mesh.vertices, mesh.faces)[0]
    np.testing.assert_allclose(mesh.corner_normals[0], np.tile(expected, (3, 1)), atol=1e-5)


@pytest.mark.parametrize(("mode", "order"), [(4, [0, 1, 2, 2, 1, 3]), (5, [0, 1, 2, 3]), (6, [0, 1, 3, 2])])
def test_strips_and_fans_of_gltf(tmp_path: Path, mode: int, order: list[int]) -> None:
    primitive = {"attributes": {"POSITION": 0}, "indices": 1, "mode": mode}
    mesh = load_mesh(gltf(tmp_path, [primitive], [floats(POINTS), np.array(order, np.uint8)]))
    assert len(mesh.faces) == 2
    np.testing.assert_allclose(face_normals(mesh.vertices, mesh.faces), [[0, 0, 1]] * 2)


def test_quantised_and_sparse_accessors_of_gltf(tmp_path: Path) -> None:
    """Positions as bytes, 127 for 1, of which a sparse accessor replaces the second."""
    whole = np.array([[0, 0, 0, 0], [0, 0, 0, 0], [0, 127, 0, 0]], np.int8)  # with padding to 4 bytes
    arrays = [whole, np.array([1], np.uint16), np.array([[127, 0, 0, 0]], np.int8)]
    file = gltf(tmp_path, [{"attributes": {"POSITION": 0}}], arrays, extensionsRequired=["KHR_mesh_quantization"])
    document = json.loads(file.read_text())
    document["bufferViews"][0]["byteStride"] = 4
    sparse = {"count": 1, "indices": {"bufferView": 1, "componentType": 5123}, "values": {"bufferView": 2}}
    document["accessors"] = [document["accessors"][0] | {"type": "VEC3", "normalized": True, "sparse": sparse}]
    mesh = load_mesh(written(file, json.dumps(document)))
    np.testing.assert_array_equal(mesh.vertices[mesh.faces[0]], [[0, 0, 0], [1, 0, 0], [0, 1, 0]])


def test_transparent_vertices_are_noted(tmp_path: Path) -> None:
    clear = floats(np.array([[1, 1, 1, 1.0], [1, 1, 1, 0.5], [1, 1, 1, 0.0]]))
    file = gltf(tmp_path, [{"attributes": {"POSITION": 0, "COLOR_0": 1}}], [floats(POINTS[:3]), clear])
    assert lost(load_mesh(file)) == ["2 partly transparent vertices are opaque: transparency is not rendered"]


def test_strips_of_ply(tmp_path: Path) -> None:
    header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    strips = "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    rows = "".join(f"{x} {y} {z}\n" for x, y, z in POINTS)
    mesh = load_mesh(written(tmp_path / "a.ply", f"{header}{strips}{rows}8 0 1 2 3 -1 1 3 2\n"))
    assert mesh.source_count == 3
    np.testing.assert_allclose(face_normals(mesh.vertices, mesh.faces), [[0, 0, 1]] * 2)


def test_a_file_of_too_many_triangles_is_refused(tmp_path: Path) -> None:
    corners = MAX_TRIANGLES + 3
    header = "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty uchar x\nproperty uchar y\n"
    header += "property uchar z\nelement face 1\nproperty list int uchar vertex_indices\nend_header\n"
    file = tmp_path / "a.ply"
    file.write_bytes(header.encode() + bytes(3) + corners.to_bytes(4, "little") + bytes(corners))
    with pytest.raises(UserError, match=f"it has more than {MAX_TRIANGLES:,} triangles: leave some out"):
        load_mesh(file)


def test_colours_of_faces_and_vertices_become_albedo(tmp_path: Path) -> None:
    header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    colours = "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
    rows = [f"{x} {y} {z}" for x, y, z in POINTS]
    faces = "element face 2\nproperty list uchar int vertex_indices\n"
    half = tuple(float(channel) for channel in linear_from_srgb(np.array([128, 0, 255]) / 255))
    of_faces = f"{header}{faces}{colours}end_header\n" + "\n".join(rows) + "\n3 0 1 2 128 0 255\n3 1 3 2 255 255 255\n"
    mesh = load_mesh(written(tmp_path / "faces.ply", of_faces))
    albedo = [mesh.materials[index].albedo for index in mesh.face_materials]
    assert albedo == [pytest.approx(half), pytest.approx((1.0, 1.0, 1.0))]
    assert lost(mesh)[0].startswith("2 colours of vertices or faces are the albedo of their faces")
    of_vertices = (
        f"{header}{colours}{faces}end_header\n" + "".join(f"{row} 128 0 255\n" for row in rows) + "3 0 1 2\n3 1 3 2\n"
    )
    assert load_mesh(written(tmp_path / "vertices.ply", of_vertices)).materials[0].albedo == pytest.approx(half)
    off = "COFF\n4 1 0\n" + "".join(f"{row} 128 0 255 255\n" for row in rows) + "4 0 1 3 2\n"
    assert load_mesh(written(tmp_path / "a.off", off)).materials[0].albedo == pytest.approx(half)
    assert load_mesh(written(tmp_path / "b.off", off[1:])).materials[0].albedo == pytest.approx(half)
    off = "OFF\n4 2 0\n" + "\n".join(rows) + "\n3 0 1 2 0.5 0.0 1.0\n3 1 3 2\n"
    assert len(load_mesh(written(tmp_path / "f.off", off)).materials) == 2
    obj = "".join(f"v {row} 1.0 0.0 0.0\n" for row in rows) + "f 1 2 4 3\n"
    assert load_mesh(written(tmp_path / "a.obj", obj)).materials[0].albedo == (1.0, 0.0, 0.0)
    tint = np.tile(np.array([0, 255, 0], np.uint8), (4, 1))
    primitive = {"attributes": {"POSITION": 0, "COLOR_0": 1}, "indices": 2, "material": 0}
    file = gltf(
        tmp_path,
        [primitive],
        [floats(POINTS), floats(tint / 255.0), np.array([0, 1, 2], np.uint16)],
        materials=[{"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0}}],
    )
    assert load_mesh(file).materials[0].albedo == pytest.approx((0.0, 0.5, 0.0), abs=3e-3)


def test_what_a_gltf_file_loses_is_named(tmp_path: Path) -> None:
    material = {
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "roughnessFactor": 0.8},
        "normalTexture": {"index": 0},
        "emissiveFactor": [1, 0, 0],
        "alphaMode": "BLEND",
        "extensions": {"KHR_materials_sheen": {}},
    }
    triangle = {"attributes": {"POSITION": 0}, "material": 0, "targets": [{"POSITION": 0}]}
    file = gltf(
        tmp_path,
        [triangle, {"attributes": {"POSITION": 0}, "mode": 1}, {"attributes": {"POSITION": 0}, "mode": 0}],
        [floats(POINTS[:3])],
        materials=[material, {"emissiveFactor": [1, 1, 1]}],  # the second is not used
        nodes=[{"mesh": 0, "skin": 0}],
        scenes=[{"nodes": [0]}, {"nodes": []}],
        cameras=[{}, {}],
        animations=[{}],
        extensions={"KHR_lights_punctual": {"lights": [{}, {}, {}]}},
        textures=[{"source": 0}],
        images=[{"uri": "none.png"}],
    )
    assert lost(load_mesh(file)) == [
        "1 further scene is not shown: only the default scene is rendered",
        "1 skin is not applied: meshes have the pose in which they were bound; mesh.animation of a scene plays an"
        " animation",
        "1 morph target is not applied: meshes have their base shape",
        "1 picture of a texture is missing (none.png): surfaces have their base colour",
        "1 line primitive is not shown: only faces are rendered",
        "1 point primitive is not shown: only faces are rendered",
        "1 use of the extension KHR_materials_sheen is ignored: not supported",
        "2 cameras are not used: the scene file has the camera",
        "1 animation is not played: nodes stand as the file places them",
        "3 lights are not used: the scene file has the lights",
        "open single-sided surfaces are shown from behind: viewers show their front only",
    ]


def test_what_an_obj_file_loses_is_named(tmp_path: Path) -> None:
    written(tmp_path / "a.mtl", "newmtl a\nKd 1 0 0\nKs 1 1 1\nd 0.7\nKe 1 1 0\nmap_Kd a.png\nmap_Bump b.png\n")
    faces = "mtllib a.mtl none.mtl\nusemtl a\ns 1\nf 1 2 3\ns 2\nusemtl other\nf 2 4 3\nf 1 2\nl 1 2 3\np 1\n"
    mesh = load_mesh(written(tmp_path / "a.obj", OBJ_POINTS + faces))
    assert lost(mesh) == [
        "1 point primitive is not shown: only faces are rendered",
        "1 line primitive is not shown: only faces are rendered",
        "2 smoothing groups are not used: edges are smooth up to the crease angle",
        "1 file of materials is missing: faces have the default material",
        "1 picture of a texture is missing (a.png): surfaces have their base colour",
        "1 texture map is not shown: only map_Kd is",
        "1 partly transparent material is not blended: from alpha 1/2 on it is opaque, else a tinted pane or not shown",
        "1 glossy material is diffuse: highlights are not rendered",
        "1 material name is not defined: faces have the default material",
        "1 face of fewer than three corners is left out: they have no area",
    ]


def test_colours_of_some_vertices_are_noted(tmp_path: Path) -> None:
    lines = "v 0 0 0 1 0 0\nv  1  0  0\nv 0 1 0 1 0 0 1\nf 1 2 3\n"
    mesh = load_mesh(written(tmp_path / "a.obj", lines))
    assert lost(mesh) == ["2 colours of vertices are not shown: not all vertices have one"]


def test_a_plain_file_loses_nothing(tmp_path: Path) -> None:
    written(tmp_path / "a.mtl", "newmtl a\nKa 0 0 0\nKd 1 0 0\nKs 0 0 0\nd 1\nillum 2\n")
    mesh = load_mesh(written(tmp_path / "a.obj", f"mtllib a.mtl\n{OBJ_POINTS}usemtl a\ns off\nf 1 2 4 3\n"))
    assert mesh.notes == () and mesh.materials[0].albedo == (1.0, 0.0, 0.0)


def test_a_file_without_faces_says_what_it_holds(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="has no faces: 1 line primitive is not shown"):
        load_mesh(written(tmp_path / "a.obj", f"{OBJ_POINTS}l 1 2\n"))
    triangle = {"attributes": {"POSITION": 0}}
    file = gltf(tmp_path, [triangle], [floats(POINTS[:3])], scenes=[{"nodes": []}, {"nodes": [0]}])
    with pytest.raises(UserError, match="its default scene has no faces: choose another one"):
        load_mesh(file)


def test_what_follows_the_last_triangle_is_noted(tmp_path: Path) -> None:
    for count, note in ((3, []), (4, ["1 corner after the last triangle is left out: a triangle has three"])):
        order = np.array([0, 1, 2, 3], np.uint16)[:count]
        file = gltf(tmp_path, [{"attributes": {"POSITION": 0}, "indices": 1}], [floats(POINTS), order])
        assert lost(load_mesh(file)) == note and len(load_mesh(file).faces) == 1
    facet = struct.pack("<12fH", 0, 0, 1, *POINTS[:3].ravel(), 0)
    for facets, note in (
        (1, []),
        (3, ["100 bytes after the last facet are not read: the header has the number of facets"]),
    ):
        mesh = load_mesh(written(tmp_path / "a.stl", bytes(80) + struct.pack("<I", 1) + facet * facets))
        assert lost(mesh) == note and len(mesh.faces) == 1


@given(data=st.data())
@settings(max_examples=60)
def test_a_damaged_binary_file_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    """Any byte of a PLY, STL or GLB file may be wrong, or missing at the end."""
    suffix = data.draw(st.sampled_from(["ply", "stl", "glb"]))
    content = bytearray(_binary_file(suffix))
    for _ in range(data.draw(st.integers(0, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    del content[data.draw(st.integers(0, len(content))) + 1 :]
    file = written(tmp_path_factory.mktemp("damaged") / f"a.{suffix}", bytes(content))
    try:
        mesh = load_mesh(file)
    except UserError as error:
        assert "\n" not in str(error)
    else:
        assert np.isfinite(mesh.corner_normals).all() and mesh.faces.max() < len(mesh.vertices)


def _binary_file(suffix: str) -> bytes:
    corners = floats(POINTS[[0, 1, 2, 2, 1, 3]].reshape(2, 9))
    if suffix == "stl":
        facets = [struct.pack("<3f", 0, 0, 1) + row.tobytes() + b"\0\0" for row in corners]
        return b"\0" * 80 + struct.pack("<I", 2) + b"".join(facets)
    if suffix == "ply":
        header = b"ply\nformat binary_little_endian 1.0\nelement vertex 6\n" + b"".join(
            b"property float %s\n" % name for name in (b"x", b"y", b"z")
        )
        faces = b"element face 2\nproperty list uchar int vertex_indices\nend_header\n"
        return header + faces + corners.tobytes() + struct.pack("<B3iB3i", 3, 0, 1, 2, 3, 3, 4, 5)
    document = {
        "asset": {"version": "2.0"},
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 6, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 72}],
        "buffers": [{"byteLength": 72}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I", len(text)) + b"JSON" + text + struct.pack("<I", 72) + b"BIN\0" + corners.tobytes()
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks
