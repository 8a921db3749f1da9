"""Colours at the corners of faces: from the file to the records, and the device's frame against the reference's."""

from __future__ import annotations

import base64
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from leaves import leaves_of

from colonnade.common import notes
from colonnade.common.errors import UserError
from colonnade.common.image_io import encode_srgb
from colonnade.common.srgb import linear_from_srgb
from colonnade.design.generator import manifest_for
from colonnade.design.manifest import Manifest
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.materials import MeshMaterial
from colonnade.mesh.materials.mesh import Mesh
from colonnade.mesh.materials.palette import with_face_colours
from colonnade.quality.image_metrics import psnr
from colonnade.reference.object import PlacedObject
from colonnade.reference.render import render_reference
from colonnade.registers.frame import frame_registers
from colonnade.render.device_frames import render_model
from colonnade.scene.model import Background, Camera, Light, Material, MeshSource, Scene
from colonnade.scene.object_mesh import SurfaceFeatures, with_materials
from colonnade.scene.object_pose import Placed
from colonnade.scene.view import make_view, with_overrides
from colonnade.scene_image.packer import pack

SIZE = (160, 120)
SKY = Background((0.25, 0.45, 0.7))
ON = ("geometry.cornerColours=true",)
OFF = ("geometry.cornerColours=false", "geometry.textureBytes=0")


def coloured(config: str = "small") -> Manifest:
    return manifest_for(config, ON).manifest


def rainbow(points: np.ndarray) -> np.ndarray:
    """Colours from 0 to 255 by position, uint8 [n, 3]."""
    place = (points - points.min(axis=0)) / np.ptp(points, axis=0)
    phase = 1.5 * place[:, 1:2] + np.arange(3) / 3
    return np.rint(255 * (0.4 + 0.4 * np.cos(2 * np.pi * phase) + 0.2 * place)).astype(np.uint8)


def ply(file: Path, name: str, kind: str = "uchar", inward: bool = False) -> Path:
    """Write a mesh with a colour at each vertex; its faces point outward, or inward."""
    mesh = load_mesh(name)
    colours = rainbow(mesh.vertices) / (1 if kind == "uchar" else 255)
    properties = [f"property float {axis}" for axis in "xyz"]
    properties += [f"property {kind} {channel}" for channel in ("red", "green", "blue")]
    lines = ["ply", "format ascii 1.0", f"element vertex {len(mesh.vertices)}", *properties]
    lines += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices", "end_header"]
    for point, colour in zip(mesh.vertices, colours, strict=True):
        lines.append(" ".join(f"{value:.9g}" for value in (*point, *colour)))
    lines += [f"3 {a} {b} {c}" for a, b, c in (mesh.faces[:, ::-1] if inward else mesh.faces)]
    file.write_text("\n".join(lines))
    return file


@pytest.mark.parametrize("kind", ["uchar", "float"])
def test_vertices_of_a_ply_file_keep_their_srgb_colours(tmp_path: Path, kind: str) -> None:
    mesh = load_mesh(ply(tmp_path / "a.ply", "sphere:1", kind), corner_colours=True)
    assert mesh.notes == () and mesh.materials == (MeshMaterial(albedo=(1.0, 1.0, 1.0), has_corner_colours=True),)
    expected = linear_from_srgb(rainbow(mesh.vertices) / 255)[mesh.faces]
    np.testing.assert_allclose(mesh.corner_colours, expected, atol=2e-6)


def test_colours_stay_at_their_vertices_where_faces_are_reversed(tmp_path: Path) -> None:
    mesh = load_mesh(ply(tmp_path / "a.ply", "sphere:1", inward=True), corner_colours=True)
    assert "turned outward" in mesh.notes[0]
    expected = linear_from_srgb(rainbow(mesh.vertices) / 255)[mesh.faces]
    np.testing.assert_allclose(mesh.corner_colours, expected, atol=2e-6)


def gltf(folder: Path, colours: list[list[float]]) -> Path:
    """Two triangles: one with COLOR_0 and a base colour, one without colours."""
    arrays = [np.eye(3, dtype=np.float32), np.array(colours, np.float32), np.eye(3, dtype=np.float32) + 2]
    data = b"".join(array.tobytes() for array in arrays)
    document = {
        "asset": {"version": "2.0"},
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "meshes": [
            {
                "primitives": [
                    {"attributes": {"POSITION": 0, "COLOR_0": 1}, "material": 0},
                    {"attributes": {"POSITION": 2}, "material": 0},
                ]
            }
        ],
        "materials": [
            {
                "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1.0, 1.0], "roughnessFactor": 0},
                "doubleSided": True,
            }
        ],
        "accessors": [{"bufferView": i, "componentType": 5126, "count": 3, "type": "VEC3"} for i in range(3)],
        "bufferViews": [{"buffer": 0, "byteOffset": 36 * i, "byteLength": 36} for i in range(3)],
        "buffers": [{"byteLength": 108, "uri": "data:;base64," + base64.b64encode(data).decode()}],
    }
    file = folder / "a.gltf"
    file.write_text(json.dumps(document))
    return file


def test_gltf_colours_are_linear_and_times_the_base_colour(tmp_path: Path) -> None:
    """Of one material, faces with colours and faces without."""
    colours = [[0.2, 0.4, 0.6], [1.0, 0.0, 0.5], [0.0, 1.0, 0.25]]
    mesh = load_mesh(gltf(tmp_path, colours), corner_colours=True)
    assert mesh.corner_colours is not None and mesh.notes == ()
    np.testing.assert_allclose(mesh.corner_colours[0], np.array(colours) * (0.5, 0.25, 1.0), atol=1e-6)
    found = [mesh.materials[index] for index in mesh.face_materials]
    assert found == [
        MeshMaterial("mirror", (1.0, 1.0, 1.0), has_corner_colours=True),
        MeshMaterial("mirror", (0.5, 0.25, 1.0)),
    ]


def test_hardware_without_corner_colours_has_a_colour_a_face(tmp_path: Path) -> None:
    """Reduced early or late, the mesh is the same and the line is told."""
    file = ply(tmp_path / "a.ply", "sphere:2")
    early, late = load_mesh(file), load_mesh(file, corner_colours=True)
    line = "colours of vertices or faces are the albedo of their faces: a face has one colour, the mean of its corners"
    told: list[str] = []
    with notes.opened(told.append):
        reduced = with_materials(Scene(MeshSource(name="sphere:2")), late, SurfaceFeatures(256))
    assert line in early.notes[0] and line in " ".join(told)
    assert reduced.materials == early.materials and reduced.corner_colours is None
    np.testing.assert_array_equal(reduced.face_materials, early.face_materials)
    assert with_face_colours(early) == (early, ())
    with pytest.raises(UserError, match=r"the hardware has none: set geometry.cornerColours=true"):
        pack(late, manifest_for("small", OFF).manifest)


def test_any_number_of_colours_needs_one_material(tmp_path: Path) -> None:
    mesh = load_mesh(ply(tmp_path / "a.ply", "sphere:4"), corner_colours=True)
    ready = with_materials(Scene(MeshSource(name="sphere:4")), mesh, SurfaceFeatures(1, corner_colours=True))
    assert ready.materials == mesh.materials and ready.corner_colours is mesh.corner_colours
    header = pack(mesh, coloured()).header
    registers = frame_registers(Scene(MeshSource(name="sphere:4")), header, coloured(), *SIZE)
    assert registers["materials[0].hasCornerColours"] == 1 and "materials[0].hasCornerColours" in coloured().registers


def test_an_albedo_of_the_scene_replaces_the_colours_and_a_kind_does_not(tmp_path: Path) -> None:
    mesh = load_mesh(ply(tmp_path / "a.ply", "sphere:1"), corner_colours=True)
    (plain,) = with_overrides(mesh.materials, Material(albedo=(0.1, 0.2, 0.3)))
    assert plain == MeshMaterial(albedo=(0.1, 0.2, 0.3))
    (mirror,) = with_overrides(mesh.materials, Material(kind="mirror"))
    assert mirror.kind == "mirror" and mirror.has_corner_colours


@pytest.mark.parametrize("headroom", [1.0, 2.5])
def test_records_hold_the_colours_of_their_face(tmp_path: Path, headroom: float) -> None:
    """Linear with 12 bits, darker by the headroom of the lights, a companion a leaf; each with its corner's normal."""
    mesh = load_mesh(ply(tmp_path / "a.ply", "sphere:4"), corner_colours=True)
    assert mesh.corner_colours is not None
    manifest = coloured()
    image = pack(mesh, manifest, None, headroom)
    values = manifest.layouts["colours"].unpack(image.records)
    colours = np.array([[values[f"colours[{k}].{c}"] for c in "rgb"] for k in range(4)]).transpose(2, 0, 1)
    ids, leaves = leaves_of(image, manifest)
    order = image.source_faces[ids]
    leaf, triangle = np.divmod(ids, 2)
    found = colours[leaf[:, None] + 1, np.array([[0, 1, 2], [1, 0, 3]])[triangle]]
    expected = np.rint(mesh.corner_colours[order] * 4095 / headroom)
    turned = [(found == np.roll(expected, -k, axis=1)).all(axis=(1, 2)) for k in range(3)]
    assert np.logical_or.reduce(turned).all() and any(each.any() for each in turned[1:])
    normals = leaves["normals"] / 2047
    for k, is_turned in enumerate(turned):
        np.testing.assert_allclose(
            normals[is_turned], np.roll(mesh.corner_normals[order], -k, axis=1)[is_turned], atol=0.011
        )


@settings(max_examples=40)
@given(st.lists(st.floats(0.0, 1.0), min_size=3, max_size=3), st.integers(0, 2**32 - 1))
def test_the_reference_interpolates_between_the_corners(weights: list[float], seed: int) -> None:
    """At any point of a triangle the weighted mean of its corners; the albedo of faces without stays."""
    random = np.random.default_rng(seed)
    mix = np.array(weights) + 1e-3
    mix /= mix.sum()
    mesh = load_mesh("square")
    colours = np.zeros((2, 3, 3))
    colours[0] = random.random((3, 3))
    materials = (MeshMaterial(albedo=(0.5, 0.5, 1.0), has_corner_colours=True), MeshMaterial(albedo=(0.1, 0.2, 0.3)))
    mesh = replace(mesh, materials=materials, face_materials=np.array([0, 1], np.uint8), corner_colours=colours)
    view = make_view(Placed(Scene(MeshSource(name="square")), mesh.extent), 8, 8, mesh.materials)
    origins = mix @ mesh.vertices[mesh.faces] + (0.0, 0.0, 1.0)
    points = PlacedObject(mesh, view).points(np.array([0, 1]), origins, np.array([[0.0, 0.0, -1.0]] * 2))
    np.testing.assert_allclose(points.albedo[0], mix @ colours[0] * (0.5, 0.5, 1.0), atol=1e-9)
    np.testing.assert_array_equal(points.albedo[1], (0.1, 0.2, 0.3))


def quality(mesh: Mesh, manifest: Manifest, material: Material) -> float:
    """PSNR of the model's frame against the reference's, which knows all colours."""
    camera = Camera(position=(1.5, 1.2, 3.4), target=(0.0, 0.0, 0.0), fov=38.0)
    scene = Scene(MeshSource(name="cube"), camera=camera, light=Light(), background=SKY, material=material)
    truth = make_view(Placed(scene, mesh.extent), *SIZE, mesh.materials)
    device = render_model(scene, mesh, manifest, SIZE)
    return psnr(encode_srgb(render_reference(mesh, truth).image), encode_srgb(device.image))


@pytest.mark.parametrize("kind", ["diffuse", "mirror", "glass"])
@pytest.mark.parametrize("config", ["16b16s32d", "24b24s64d", "32b32s64d"])
def test_the_device_shows_the_colours_of_the_reference(tmp_path: Path, config: str, kind: str) -> None:
    """Far nearer than with one colour a face."""
    mesh = load_mesh(ply(tmp_path / "a.ply", "sphere:2"), corner_colours=True)
    found = quality(mesh, coloured(config), Material(kind=kind))
    faces = quality(mesh, manifest_for(config, OFF).manifest, Material(kind=kind))
    print(f"{config}, {kind}: {found:.1f} dB, {faces:.1f} dB with a colour a face")
    assert found > 40.0 and found > faces + 5.0
