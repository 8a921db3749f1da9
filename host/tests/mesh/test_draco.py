"""Draco-compressed primitives equal the originals, and a hostile stream is one line of an error."""

from __future__ import annotations

import base64
import json
import struct
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import DracoPy
import numpy as np
import pytest
from textured_files import FOUR, gltf, png

from colonnade.common.errors import UserError
from colonnade.mesh.files import draco
from colonnade.mesh.files.formats import read_surface
from colonnade.mesh.geometry.primitives import sphere
from colonnade.mesh.load import load_mesh

DRACO = "KHR_draco_mesh_compression"
#: Component types of glTF, and widths of its types.
CODES = {"f": 5126, "B": 5121, "H": 5123, "I": 5125, "b": 5120, "h": 5122}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


def encoded(points: np.ndarray, faces: np.ndarray, **attributes: Any) -> bytes:
    return bytes(DracoPy.encode(points.astype(np.float32), faces.astype(np.uint32), **attributes))


def written(
    folder: Path,
    arrays: Mapping[str, np.ndarray],
    streams: list[tuple[bytes, Mapping[str, int]]],
    faces: np.ndarray | None = None,
    required: bool = True,
    normalized: tuple[str, ...] = ("COLOR_0",),
    **mesh: Any,
) -> Path:
    """A glTF file of a primitive for each stream; `arrays` are its accessors, with data if there are faces."""
    views: list[dict[str, int]] = []
    data = b""

    def view(content: bytes) -> int:
        nonlocal data
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(content)})
        data += content + bytes(-len(content) % 4)
        return len(views) - 1

    accessors: list[dict[str, Any]] = []
    for name, values in arrays.items():
        accessors.append(
            {
                "componentType": CODES[values.dtype.char],
                "count": len(values),
                "type": TYPES[values.shape[1]],
                "normalized": name in normalized,
            }
        )
        if faces is not None:
            accessors[-1]["bufferView"] = view(values.tobytes())
    accessors.append({"componentType": 5125, "count": 3 * len(faces) if faces is not None else 3, "type": "SCALAR"})
    if faces is not None:
        accessors[-1]["bufferView"] = view(faces.astype(np.uint32).tobytes())
    primitives = []
    for stream, ids in streams:
        extension = {DRACO: {"bufferView": view(stream), "attributes": dict(ids)}}
        attributes = {name: number for number, name in enumerate(arrays)}
        primitives.append({"attributes": attributes, "indices": len(arrays), "extensions": extension} | mesh)
    document: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": primitives}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data), "uri": "data:;base64," + base64.b64encode(data).decode()}],
    }
    if required:
        document |= {"extensionsRequired": [DRACO]}
    (folder / "a.gltf").write_text(json.dumps(document))
    return folder / "a.gltf"


def ids_of(stream: bytes) -> dict[str, int]:
    """The unique ids of a stream's attributes by their name in glTF."""
    names = {0: "POSITION", 1: "NORMAL", 2: "COLOR_0", 3: "TEXCOORD_0"}
    attributes = DracoPy.decode(stream).attributes
    return {names[one["attribute_type"]]: one["unique_id"] for one in attributes if one["attribute_type"] in names}


def ball() -> tuple[dict[str, np.ndarray], np.ndarray, bytes]:
    """Attributes and faces of a sphere, and its stream in the same order, quantised."""
    points, faces = sphere(2)
    colours = np.rint((points + 1) / 2 * 255).astype(np.uint8)
    colours = np.column_stack([colours, np.full(len(points), 255, np.uint8)])
    arrays = {
        "POSITION": points.astype(np.float32),
        "NORMAL": points.astype(np.float32),
        "TEXCOORD_0": points[:, :2].astype(np.float32),
        "COLOR_0": colours,
    }
    stream = encoded(
        points,
        faces,
        colors=colours,
        normals=points,
        tex_coord=points[:, :2],
        preserve_order=True,
        quantization_bits=14,
        normal_quantization_bits=10,
        tex_coord_quantization_bits=12,
    )
    return arrays, faces, stream


def test_all_attributes_are_those_that_were_compressed(tmp_path: Path) -> None:
    """Positions, normals, colours and faces of a quantised stream, beside the same arrays as they were."""
    arrays, faces, stream = ball()
    found = load_mesh(written(tmp_path, arrays, [(stream, ids_of(stream))]), corner_colours=True)
    plain = load_mesh(
        written(tmp_path, arrays, [(b"\0" * 8, {})], faces, required=False, extensions={}), corner_colours=True
    )
    assert found.notes == plain.notes
    np.testing.assert_allclose(found.vertices[found.faces], plain.vertices[plain.faces], atol=1e-3)
    np.testing.assert_allclose(found.corner_normals, plain.corner_normals, atol=1e-2)
    assert found.corner_colours is not None and plain.corner_colours is not None
    np.testing.assert_array_equal(found.corner_colours, plain.corner_colours)


def test_a_texture_is_placed_by_the_stream(tmp_path: Path) -> None:
    path = gltf(tmp_path)
    document = json.loads(path.read_text())
    plain = read_surface(path).surface
    stream = encoded(np.eye(3), np.array([[0, 1, 2]]), tex_coord=np.array([(0.0, 0), (1, 0), (0, 1)]))
    document["meshes"][0]["primitives"][0]["extensions"] = {DRACO: {"bufferView": 3, "attributes": ids_of(stream)}}
    for accessor in document["accessors"]:
        del accessor["bufferView"]
    document["bufferViews"].append({"buffer": 1, "byteLength": len(stream)})
    document["buffers"].append({"byteLength": len(stream), "uri": "a.bin"})
    (tmp_path / "a.bin").write_bytes(stream)
    path.write_text(json.dumps(document))
    found = read_surface(path).surface
    assert found.uvs is not None and plain.uvs is not None and len(found.textures) == 1
    order = [int(np.abs(plain.vertices - vertex).sum(axis=1).argmin()) for vertex in found.vertices[found.faces[0]]]
    np.testing.assert_allclose(found.uvs[0], plain.uvs[0][order], atol=1e-6)


@pytest.mark.parametrize("required", [True, False])
def test_an_optional_use_takes_the_uncompressed_data_if_there_are_any(tmp_path: Path, required: bool) -> None:
    arrays, faces, stream = ball()
    small = {"POSITION": arrays["POSITION"] / 2}
    assert np.ptp(load_mesh(written(tmp_path, small, [(stream, ids_of(stream))], faces, required)).vertices) < 1.5
    assert np.ptp(load_mesh(written(tmp_path, small, [(stream, ids_of(stream))], None, required)).vertices) > 1.5


@pytest.mark.parametrize("is_compressed", [True, False])
def test_the_changes_of_a_sparse_accessor_are_made(tmp_path: Path, is_compressed: bool) -> None:
    """Those of a compressed accessor after decoding; normalised ones are scaled."""
    arrays, faces, stream = ball()
    arrays = {name: arrays[name] for name in ("POSITION", "COLOR_0")}
    streams = [(stream, ids_of(stream) if is_compressed else {})]
    path = written(tmp_path, arrays, streams, None if is_compressed else faces, required=is_compressed)
    before = read_surface(path).surface
    document = json.loads(path.read_text())
    changes = {0: np.array([(2.0, 3.0, 4.0)], np.float32), 1: np.array([(255, 0, 51, 255)], np.uint8)}
    for accessor, values in changes.items():
        content = struct.pack("<I", 7) + values.tobytes()
        document["buffers"].append(
            {"byteLength": len(content), "uri": "data:;base64," + base64.b64encode(content).decode()}
        )
        document["bufferViews"].append({"buffer": len(document["buffers"]) - 1, "byteLength": len(content)})
        view = len(document["bufferViews"]) - 1
        document["accessors"][accessor]["sparse"] = {
            "count": 1,
            "indices": {"bufferView": view, "componentType": 5125},
            "values": {"bufferView": view, "byteOffset": 4},
        }
    path.write_text(json.dumps(document))
    found = read_surface(path).surface
    assert found.colours is not None and before.colours is not None
    is_changed = found.faces == 7
    np.testing.assert_array_equal(found.vertices[7], (2.0, 3.0, 4.0))
    np.testing.assert_array_equal(np.delete(found.vertices, 7, 0), np.delete(before.vertices, 7, 0))
    albedo = np.array(found.materials[-1].albedo)
    np.testing.assert_allclose(found.colours[is_changed] / albedo, [(1.0, 0.0, 0.2)] * is_changed.sum(), atol=1e-9)
    np.testing.assert_array_equal(found.colours[~is_changed], before.colours[~is_changed])


def test_changes_of_a_compressed_order_are_refused(tmp_path: Path) -> None:
    arrays, faces, stream = ball()
    path = written(tmp_path, {"POSITION": arrays["POSITION"]}, [(stream, ids_of(stream))])
    document = json.loads(path.read_text())
    changes = {
        "count": 1,
        "indices": {"bufferView": 0, "componentType": 5125},
        "values": {"bufferView": 0, "byteOffset": 4},
    }
    document["accessors"].append({"componentType": 5125, "count": faces.size, "type": "SCALAR", "sparse": changes})
    document["meshes"][0]["primitives"][0]["indices"] = len(document["accessors"]) - 1
    path.write_text(json.dumps(document))
    with pytest.raises(UserError, match="the indices of a Draco primitive are sparse"):
        read_surface(path)


@pytest.mark.parametrize("mode", [4, 5])
def test_triangles_are_a_list_in_any_mode(tmp_path: Path, mode: int) -> None:
    """A primitive may be a strip for a reader that wants one; the decoder gives triangles."""
    arrays, faces, stream = ball()
    mesh = load_mesh(written(tmp_path, {"POSITION": arrays["POSITION"]}, [(stream, ids_of(stream))], mode=mode))
    assert len(mesh.faces) == len(faces)


def test_whole_numbers_are_scaled_as_their_accessor_says(tmp_path: Path) -> None:
    """As of KHR_mesh_quantization: positions of 16 bits, taken as they are or from 0 to 1."""
    points, faces = sphere(1)
    whole = np.rint((points + 1) / 2 * 65535).astype(np.uint16)
    stream = encoded(points, faces, generic_attributes={7: whole}, preserve_order=True)
    for normalized, scale in (((), 65535.0), (("POSITION",), 1.0)):
        path = written(tmp_path, {"POSITION": whole}, [(stream, {"POSITION": 7})], normalized=normalized)
        vertices = read_surface(path).surface.vertices
        np.testing.assert_allclose(vertices, whole / 65535.0 * scale, atol=1e-9)


def test_all_primitives_are_decoded_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also primitives that share a stream."""
    arrays, faces, stream = ball()
    calls = []
    monkeypatch.setattr(
        "colonnade.mesh.files.gltf_draco.decode_draco",
        lambda streams: calls.append(len(streams)) or draco.decode_draco(streams),
    )
    path = written(tmp_path, {"POSITION": arrays["POSITION"]}, [(stream, ids_of(stream))] * 3)
    assert len(read_surface(path).surface.faces) == 3 * len(faces) and calls == [3]


def bomb() -> bytes:
    """A stream of one triangle that states 2^28 points, for whose attribute a decoder takes more than 3 GB."""
    stream = encoded(np.eye(3), np.array([[0, 1, 2]]), preserve_order=True)
    assert stream[11:17] == bytes([1, 3, 1, 0, 1, 2])
    return stream[:11] + b"\x01\xff\xff\xff\x7f\x01" + struct.pack("<3I", 0, 1, 2) + stream[17:]


@pytest.mark.parametrize(
    ("stream", "says"),
    [
        (b"DRACO" + b"\xff" * 90, "its Draco data are damaged, or take more than 512 MiB or 60 s"),
        (b"\0", "its Draco data are damaged"),
        (ball()[2][:-9], "its Draco data are damaged"),
        (bomb(), "its Draco data are damaged, or take more than 512 MiB"),
        (bytes(DracoPy.encode(np.eye(3, dtype=np.float32))), "its Draco data are damaged"),
    ],
    ids=["noise", "short", "cut", "bomb", "points"],
)
def test_a_hostile_stream_is_refused(tmp_path: Path, stream: bytes, says: str) -> None:
    with pytest.raises(UserError, match=says) as raised:
        load_mesh(written(tmp_path, {"POSITION": np.eye(3, dtype=np.float32)}, [(stream, {"POSITION": 0})]))
    assert "\n" not in str(raised.value) and "a.gltf" in str(raised.value)


def test_the_limits_grow_with_the_streams_up_to_a_most() -> None:
    with pytest.raises(UserError, match="more than 1,012 MiB or 61 s"):
        draco.decode_draco([bytes(1 << 20)])
    with pytest.raises(UserError, match="more than 8,192 MiB or 76 s"):
        draco.decode_draco([bytes(1 << 20)] * 16)


def test_the_process_ends_at_its_limit_of_time() -> None:
    program = (
        "from colonnade.common.machine_limits import limit_this_process as limit\nlimit(1 << 28, 1)\nwhile True: pass"
    )
    assert subprocess.run([sys.executable, "-I", "-c", program], check=False).returncode < 0


@pytest.mark.parametrize(
    ("ids", "says"),
    [
        ({"POSITION": 99}, "the Draco data of a primitive have no POSITION"),
        ({"POSITION": 0, "TEXCOORD_0": 0}, "accessor 1 has 2 components, its compressed data 3"),
        ({}, "accessor 0 has no data"),
    ],
)
def test_attributes_that_do_not_fit_are_refused(tmp_path: Path, ids: dict[str, int], says: str) -> None:
    arrays, _, _ = ball()
    points, faces = sphere(2)
    stream = encoded(points, faces, preserve_order=True)
    path = written(tmp_path, {"POSITION": arrays["POSITION"], "TEXCOORD_0": arrays["TEXCOORD_0"]}, [(stream, ids)])
    document = json.loads(path.read_text())
    document["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    document["textures"], document["images"] = [{"source": 0}], [{"uri": "a.png"}]
    document["meshes"][0]["primitives"][0]["material"] = 0
    path.write_text(json.dumps(document))
    (tmp_path / "a.png").write_bytes(png(FOUR))
    with pytest.raises(UserError, match=says):
        load_mesh(path)
