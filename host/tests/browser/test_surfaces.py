"""The browser tab's textures and materials of a glTF file, beside the host's."""

from __future__ import annotations

import base64
import json
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from animated_documents import painted
from built_page import MODULE, NEEDS_MODULE, ROOT, run_node
from PIL import Image
from textured_files import png

from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import render_model
from colonnade.mesh.files.catalog import VARIABLE
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.materials import as_rendered, in_layer
from colonnade.mesh.materials.mesh import Mesh
from colonnade.scene.parser import load_scene
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene_image.bending import Bending
from colonnade.scene_image.packer import pack

pytestmark = NEEDS_MODULE
KINDS = {"rough metal": "metal"}


def textured_sheet(folder: Path, strength: float = 0.0) -> Path:
    """A bent sheet with a picture and a normal map, half of it metal or aglow by a map, and one with colours."""
    steps = 12
    random = np.random.default_rng(5)
    base = random.integers(0, 256, (96, 64, 3)).astype(np.uint8)
    metal = np.zeros((32, 32, 3), np.uint8)
    metal[:, 16:, 2] = 255
    metal[..., 1] = np.linspace(160, 250, 32)[:, None]
    u, v = (each.ravel() for each in np.meshgrid(np.linspace(0, 1, steps), np.linspace(0, 1, steps)))
    corner = (np.arange(steps - 1)[:, None] * steps + np.arange(steps - 1)).ravel()
    first, second = (
        np.stack([corner, corner + a, corner + b], axis=1) for a, b in ((1, steps + 1), (steps + 1, steps))
    )
    arrays = [
        np.stack([u, v, 0.3 * np.sin(3 * u)], axis=1).astype(np.float32),
        np.stack([1.7 * u - 0.4, 1.3 * v], axis=1).astype(np.float32),
        np.stack([u, 1 - v, 0.5 + 0 * u], axis=1).astype(np.float32),
        np.concatenate([first, second]).astype(np.uint16).ravel(),
        np.stack([u, v, 1 + 0.3 * np.cos(3 * u)], axis=1).astype(np.float32),
    ]
    bumps = np.repeat(np.repeat(random.integers(80, 176, (4, 4, 3)), 8, axis=0), 8, axis=1).astype(np.uint8)
    bumps[..., 2] = 255
    parts = [array.tobytes() for array in arrays] + [png(base), png(metal), png(bumps)]
    starts = np.cumsum([0] + [-(-len(part) // 4) * 4 for part in parts])
    data = b"".join(part.ljust(-(-len(part) // 4) * 4, b"\0") for part in parts)
    kinds = ("VEC3", "VEC2", "VEC3", "SCALAR", "VEC3")
    sheet = {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 3, "material": 0}
    document = {
        "asset": {"version": "2.0"},
        "nodes": [{"mesh": 0}],
        "meshes": [
            {"primitives": [sheet, {"attributes": {"POSITION": 4, "COLOR_0": 2}, "indices": 3, "material": 1}]},
        ],
        "materials": [
            {
                "pbrMetallicRoughness": {
                    "baseColorTexture": {"index": 0},
                    "baseColorFactor": [0.9, 0.8, 1.0, 1.0],
                    "metallicRoughnessTexture": {
                        "index": 1,
                        "extensions": {"KHR_texture_transform": {"scale": [1, 1]}},
                    },
                    "roughnessFactor": 0.9,
                },
                "normalTexture": {"index": 2, "scale": 0.7},
            },
            {"pbrMetallicRoughness": {"metallicFactor": 0.0, "baseColorFactor": [0.5, 1.0, 0.25, 1.0]}},
        ],
        "textures": [{"source": 0, "sampler": 0}, {"source": 1}, {"source": 2}],
        "samplers": [{"wrapS": 33648, "wrapT": 10497}],
        "images": [{"bufferView": 5}, {"bufferView": 6}, {"bufferView": 7}],
        "accessors": [
            {"bufferView": i, "componentType": 5123 if i == 3 else 5126, "count": array.size // width, "type": kind}
            for i, (array, kind, width) in enumerate(zip(arrays, kinds, (3, 2, 3, 1, 3), strict=True))
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": int(start), "byteLength": len(part)}
            for start, part in zip(starts, parts, strict=False)
        ],
        "buffers": [{"byteLength": len(data), "uri": "data:;base64," + base64.b64encode(data).decode()}],
    }
    if strength > 0:
        surface = document["materials"][0]
        emissive = surface["pbrMetallicRoughness"].pop("metallicRoughnessTexture")
        surface["pbrMetallicRoughness"]["metallicFactor"] = 0.0
        surface |= {"emissiveTexture": emissive, "emissiveFactor": [1.0, 0.4, 0.7]}
        surface["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
    (folder / "sheet.gltf").write_text(json.dumps(document))
    return folder / "sheet.gltf"


def beside_host(folder: Path, file: Path, headroom: float = 1.0, **job: Any) -> dict[str, Any]:
    """What the tab makes of a glTF file: its entries, its notes."""
    text = json.loads((ROOT / "configs" / "golden" / "small.json").read_text())
    others = [other.name for other in file.parent.iterdir() if other.is_file() and other != file]
    job |= {"module": str(MODULE), "manifest": text, "headroom": headroom, "gathers": "frame" not in job}
    job |= {"file": file.name, "path": str(file), "beside": str(file.parent), "files": others}
    run_node("surfaces.mjs", folder, job)
    pictures = []
    for number in range(len(list(folder.glob("picture-*")))):
        with Image.open(folder / f"picture-{number}") as picture:
            rgba = np.asarray(picture.convert("RGBA"))
        rgba.tofile(folder / f"{number}.bin")
        height, width = rgba.shape[:2]
        pictures.append({"width": width, "height": height, "hasAlpha": bool((rgba[..., 3] < 255).any())})
    run_node("surfaces.mjs", folder, job | {"pictures": pictures})
    found: dict[str, Any] = json.loads((folder / "entries.json").read_text())
    return found


@pytest.mark.parametrize("headroom", [1.0, 2.0])
def test_a_textured_file_is_packed_as_by_the_host(tmp_path: Path, headroom: float) -> None:
    """Records, texture memory and the material table, whose order is the tab's own: the largest first."""
    (tmp_path / "file").mkdir()
    file = textured_sheet(tmp_path / "file")
    found = beside_host(tmp_path, file, headroom)
    mesh = load_mesh(file, corner_colours=True)
    assert len(mesh.faces) > 1000  # split by the normal map
    rendered = [in_layer(as_rendered(one, gathers=True), "surface") for one in mesh.materials]
    keys = [(KINDS.get(one.kind, one.kind), one.roughness, one.texture is not None) for one in rendered]
    order = [keys.index((one["kind"], one["roughness"], one["hasTexture"])) for one in found["entries"]]
    assert sorted(order) == list(range(len(mesh.materials))) and len(order) > 4
    assert found["notes"] == []
    same_memories(tmp_path, mesh, order, headroom)


def test_metal_that_glows_is_that_of_the_host(tmp_path: Path) -> None:
    """Faces are metal or not as a whole, also where the emission splits them."""
    (tmp_path / "file").mkdir()
    file = textured_sheet(tmp_path / "file")
    document = json.loads(file.read_text())
    document["materials"][0] |= {"emissiveTexture": {"index": 1}, "emissiveFactor": [0.0, 0.0, 1.0]}
    del document["materials"][0]["normalTexture"]
    file.write_text(json.dumps(document))
    found = beside_host(tmp_path, file)
    mesh = load_mesh(file, corner_colours=True)
    mirrors = np.array([one.kind == "mirror" for one in mesh.materials])[mesh.face_materials]
    assert mirrors.sum() > 1000
    assert found["kinds"].count("mirror") == mirrors.sum() and len(found["kinds"]) == len(mirrors)


def same_memories(folder: Path, mesh: Mesh, order: list[int], headroom: float = 1.0) -> None:
    """Compare records, texture memories and the clip file of the tab, whose table has materials in an order."""
    manifest = Manifest.load(ROOT / "configs" / "golden" / "small.json")
    numbers = np.argsort(order).astype(np.uint8)[mesh.face_materials]
    mesh = replace(mesh, materials=tuple(mesh.materials[number] for number in order), face_materials=numbers)
    image = pack(mesh, manifest, headroom=headroom, encoder="live")
    for section in image.attributes:
        assert (folder / section.memory).read_bytes() == section.words.tobytes(), section.memory
    assert (folder / "records.bin").read_bytes() == image.records.tobytes()
    assert (folder / "clip.bin").read_bytes() == (image.moves.file if isinstance(image.moves, Bending) else b"")


@pytest.mark.parametrize("glows", [False, True])
def test_an_animated_file_with_alpha_bumps_and_a_glow_is_packed_as_by_the_host(tmp_path: Path, glows: bool) -> None:
    """Faces of skins, of mirrored nodes and of morph targets, which are cut and split, and the clip of their pieces."""
    (tmp_path / "file").mkdir()
    file = painted(glows).write(tmp_path / "file" / "painted.gltf")
    found = beside_host(tmp_path, file, animation=0)
    mesh = load_mesh(file, corner_colours=True, animation="bend")
    assert len(mesh.faces) > 2000 and any(one.kind == "glass" for one in mesh.materials) != glows

    def key(kind: str, has_texture: bool, emission: Sequence[float], albedo: Sequence[float]) -> tuple[Any, ...]:
        return kind, has_texture, *(round(value, 9) for value in (*emission, *(albedo if kind == "glass" else ())))

    keys = [key(one.kind, one.texture is not None, one.emission, one.albedo) for one in mesh.materials]
    names = ("kind", "hasTexture", "emission", "albedo")
    order = [keys.index(key(*(entry[name] for name in names))) for entry in found["entries"]]
    same_memories(tmp_path, mesh, order)


@pytest.mark.parametrize("strength", [1.0, 4.0])
def test_a_sheet_glows_as_by_the_host(tmp_path: Path, strength: float) -> None:
    (tmp_path / "file").mkdir()
    file = textured_sheet(tmp_path / "file", strength=strength)
    found = beside_host(tmp_path, file)
    mesh = load_mesh(file, corner_colours=True)
    used = {mesh.materials[number].emission for number in np.unique(mesh.face_materials)}
    entries = np.array(sorted(one["emission"] for one in found["entries"]))
    assert found["notes"] == ["emission above 1 is scaled to 1"] * (strength > 1)
    assert len(used) > 3
    np.testing.assert_allclose(np.unique(entries, axis=0), np.array(sorted(used)), atol=1e-12)


def same_picture(folder: Path, file: Path, size: tuple[int, int] = (160, 120)) -> dict[str, Any]:
    """Compare the tab's pass of a glTF file with the host's; returns what it found, and how many pixels show panes."""
    manifest = Manifest.load(ROOT / "configs" / "golden" / "small.json")
    (folder / "scene.toml").write_text(f"[mesh]\npath = {json.dumps(str(file))}\n[frame]\nsamples = 4\n")
    prepared = DeviceScene.of(load_scene(folder / "scene.toml"), manifest, encoder="live")
    one = prepared.passes()[1]
    registers = prepared.registers(size, one)
    frame = render_model(manifest, prepared.image, registers)
    writes = [pair for name, value in registers.items() for pair in manifest.registers[name].encode(value)]
    job = {"writes": writes, "width": size[0], "height": size[1], "threshold": one.sample.coverage}
    found = beside_host(folder, file, prepared.scene.headroom, frame=job)
    colours = np.fromfile(folder / "colours.bin", "<u2").reshape(frame.colour.shape)
    triangles = np.fromfile(folder / "triangles.bin", "<i4").reshape(frame.triangle.shape)
    np.testing.assert_array_equal(triangles >= 0, frame.is_object)
    assert frame.is_object.sum() > 500
    np.testing.assert_array_equal(colours, frame.colour)
    panes = [number for number, entry in enumerate(found["entries"]) if entry["kind"] == "glass"]
    opaque = render_model(manifest, prepared.image, registers | {f"materials[{number}].kind": 0 for number in panes})
    found["seenPanes"] = int((opaque.colour != colours).any(axis=2).sum())
    return found


@pytest.mark.parametrize("mode", ["MASK", "BLEND"])
def test_a_file_with_alpha_looks_as_by_the_host(tmp_path: Path, mode: str) -> None:
    """A picture with a hole, thin and of one colour in parts, and a material that covers in part."""
    (tmp_path / "file").mkdir()
    file = textured_sheet(tmp_path / "file")
    y, x = np.mgrid[:96, :64]
    picture = np.random.default_rng(7).integers(0, 256, (96, 64, 4)).astype(np.uint8)
    picture[:, 24:, :3] = (200, 40, 90)
    picture[..., 3] = np.where((x - 20) ** 2 + (y - 40) ** 2 < 300, 0, np.where(y > 60, 60, 255))
    document = json.loads(file.read_text())
    document["images"][0] = {"uri": "data:image/png;base64," + base64.b64encode(png(picture)).decode()}
    document["materials"][0] |= {"alphaMode": mode}
    document["materials"][1] |= {"alphaMode": "BLEND"}
    document["materials"][1]["pbrMetallicRoughness"]["baseColorFactor"][3] = 0.6
    file.write_text(json.dumps(document))
    found = same_picture(tmp_path, file)
    assert 0.6 in [entry["coverage"] for entry in found["entries"]]
    assert (found["seenPanes"] > 50) == (mode == "BLEND")


#: Files of Khronos in the folders of COLONNADE_MESHES.
KHRONOS = ("AlphaBlendModeTest", "BoxInterleaved", "BoxTextured", "CesiumMilkTruck", "Duck", "FlightHelmet", "Fox")
KHRONOS += ("2CylinderEngine", "Avocado", "BoomBox", "DamagedHelmet", "Lantern", "Suzanne")
KHRONOS += ("TextureTransformTest", "WaterBottle")


def khronos(name: str) -> Path | None:
    folders = os.environ.get(VARIABLE, "").split(os.pathsep)
    paths = (Path(folder) / name / "glTF" / f"{name}.gltf" for folder in folders)
    flat = (Path(folder) / f"{name}.{kind}" for folder in folders for kind in ("gltf", "glb"))
    return next((path for path in (*paths, *flat) if path.is_file()), None)


@pytest.mark.parametrize("name", KHRONOS)
def test_files_of_khronos_look_as_by_the_host(tmp_path: Path, name: str) -> None:
    file = khronos(name)
    if file is None:
        pytest.skip(f"{name} is in the folders of {VARIABLE}")
    same_picture(tmp_path, file)
