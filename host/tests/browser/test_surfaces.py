"""The browser tab's textures and materials of a glTF file, beside the host's."""

from __future__ import annotations

import base64
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from built_page import MODULE, NEEDS_MODULE, ROOT, run_node
from textured_files import png

from colonnade.design.manifest import Manifest
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.materials import as_rendered, in_layer
from colonnade.scene_image.packer import pack

pytestmark = NEEDS_MODULE
KINDS = {"rough metal": "metal"}


def textured_sheet(folder: Path) -> list[np.ndarray]:
    """A bent sheet with a picture, half of it metal of several roughnesses, and one with colours of vertices."""
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
    parts = [array.tobytes() for array in arrays] + [png(base), png(metal)]
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
                }
            },
            {"pbrMetallicRoughness": {"metallicFactor": 0.0, "baseColorFactor": [0.5, 1.0, 0.25, 1.0]}},
        ],
        "textures": [{"source": 0, "sampler": 0}, {"source": 1}],
        "samplers": [{"wrapS": 33648, "wrapT": 10497}],
        "images": [{"bufferView": 5}, {"bufferView": 6}],
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
    (folder / "sheet.gltf").write_text(json.dumps(document))
    return [base, metal]


@pytest.mark.parametrize("headroom", [1.0, 2.0])
def test_a_textured_file_is_packed_as_by_the_host(tmp_path: Path, headroom: float) -> None:
    """Records, texture memory and the material table, whose order is the tab's own: the largest first."""
    pictures = textured_sheet(tmp_path)
    for number, pixels in enumerate(pictures):
        pixels.tofile(tmp_path / f"{number}.bin")
    text = json.loads((ROOT / "configs" / "golden" / "small.json").read_text())
    manifest = Manifest.from_dict(text)
    sizes = [{"name": f"{n}.bin", "width": p.shape[1], "height": p.shape[0]} for n, p in enumerate(pictures)]
    job = {"module": str(MODULE), "manifest": text, "file": "sheet.gltf", "pictures": sizes}
    run_node("surfaces.mjs", tmp_path, job | {"gathers": True, "headroom": headroom})

    mesh = load_mesh(tmp_path / "sheet.gltf", corner_colours=True)
    found = json.loads((tmp_path / "entries.json").read_text())
    rendered = [in_layer(as_rendered(one, gathers=True), "surface") for one in mesh.materials]
    keys = [(KINDS.get(one.kind, one.kind), one.roughness, one.texture is not None) for one in rendered]
    order = [keys.index((one["kind"], one["roughness"], one["hasTexture"])) for one in found["entries"]]
    assert sorted(order) == list(range(len(mesh.materials))) and len(order) > 4
    assert not found["notes"]
    numbers = np.argsort(order).astype(np.uint8)[mesh.face_materials]
    mesh = replace(mesh, materials=tuple(mesh.materials[number] for number in order), face_materials=numbers)
    image = pack(mesh, manifest, headroom=headroom, encoder="live")
    for section in image.attributes:
        assert (tmp_path / section.memory).read_bytes() == section.words.tobytes(), section.memory
    assert (tmp_path / "records.bin").read_bytes() == image.records.tobytes()
