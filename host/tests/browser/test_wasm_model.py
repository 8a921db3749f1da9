"""The page's WebAssembly equals the host: records, pixels, hits, counters and maps; of the RTL of tiny, too."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from built_page import MODULE, NEEDS_MODULE, ROOT, RTL, cube_of, run_node
from PIL import Image

from colonnade.capture.picture import fitted
from colonnade.capture.source import Frame, Lens
from colonnade.common.accumulation import UNSHADOWED, Accumulation
from colonnade.common.image_io import decode_srgb, encode_srgb
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import render_model
from colonnade.environment.depth_normals import normals_of_depth
from colonnade.environment.light_cube import LightCube
from colonnade.environment.lights import world_surface
from colonnade.environment.load import load_environment
from colonnade.environment.repair import filled
from colonnade.environment.seen_light import FINE, SeenLight
from colonnade.maps.encoded import layout_of
from colonnade.maps.live import STILL_ROUNDS, LiveEncoder, LiveFrame
from colonnade.mesh.geometry.primitives import Geometry, cube, sphere
from colonnade.mesh.load import clean_mesh, load_mesh
from colonnade.mesh.materials.mesh import Mesh
from colonnade.registers.frame import frame_registers
from colonnade.scene.parser import load_scene
from colonnade.scene_image.environment import map_sections
from colonnade.scene_image.packer import pack

EIGHT = ("teapot", "stanford-bunny", "cheburashka", "fandisk", "rocker-arm", "duck", "armadillo", "dragon")
ROOMS = ("living", "office", "attic")
pytestmark = NEEDS_MODULE


def check(
    folder: Path, mesh: Mesh, config: str, scene_name: str, size: tuple[int, int], raw: Geometry | None = None
) -> None:
    """Compare a mesh and a frame of it with the host's; the module cleans ``raw``, of which the host made the mesh."""
    manifest_text = json.loads((ROOT / "configs" / "golden" / f"{config}.json").read_text())
    manifest = Manifest.from_dict(manifest_text)
    scene = load_scene(ROOT / "scenes" / scene_name)
    plain = tuple(replace(material, kind=scene.material.kind or "diffuse") for material in mesh.materials[:1])
    mesh = replace(mesh, materials=plain, face_materials=np.zeros(len(mesh.faces), dtype=np.uint8))
    image = pack(mesh, manifest)
    registers = frame_registers(scene, image.header, manifest, *size)
    frame = render_model(manifest, image, registers)

    writes = [pair for name, value in registers.items() for pair in manifest.registers[name].encode(value)]
    job = {
        "module": str(MODULE),
        "manifest": manifest_text,
        "isGlass": plain[0].kind == "glass",
        "frame": {"writes": writes, "width": size[0], "height": size[1]},
        "rtl": str(RTL) if config == "tiny" else None,
    }
    vertices, faces = (mesh.vertices, mesh.faces) if raw is None else raw
    vertices.astype("<f8").tofile(folder / "vertices.bin")
    faces.astype("<i4").tofile(folder / "faces.bin")
    (mesh.corner_normals if raw is None else np.zeros((len(faces), 3, 3))).astype("<f8").tofile(folder / "normals.bin")
    run_node("frames.mjs", folder, job)

    assert (folder / "records.bin").read_bytes() == image.records.tobytes()
    packed = json.loads((folder / "packed.json").read_text())
    assert packed["shadingOffset"] == registers["shading.offset"]
    assert packed["recordCount"] == image.header.record_count
    for kind in ("model", "rtl") if config == "tiny" else ("model",):
        colours = np.fromfile(folder / f"{kind}-colours.bin", dtype="<u2").reshape(frame.colour.shape)
        np.testing.assert_array_equal(colours, frame.colour)
        triangles = np.fromfile(folder / f"{kind}-triangles.bin", dtype="<i4").reshape(frame.triangle.shape)
        np.testing.assert_array_equal(triangles, frame.triangle)
        assert (triangles >= 0).any()
        counters = json.loads((folder / f"{kind}-counters.json").read_text())
        known = counters.keys() & frame.counters.keys()
        assert {"nodeReads", "triangleTests"} <= known
        assert {name: counters[name] for name in known} == {name: frame.counters[name] for name in known}


@pytest.mark.parametrize(
    ("config", "scene"),
    [("small", "object.toml"), ("edge", "mirror.toml"), ("lean", "glass.toml"), ("tiny", "object.toml")],
)
def test_webassembly_equals_the_host(tmp_path: Path, config: str, scene: str) -> None:
    check(tmp_path, load_mesh("teapot:4"), config, scene, (64, 48))


def test_a_file_is_cleaned_as_by_the_host(tmp_path: Path) -> None:
    """Parts that point inward, a face twice, one without area, vertices twice and unused."""
    ball, box = sphere(1), cube()
    vertices = np.concatenate([ball[0], box[0] * 0.5 + 3.0, ball[0][:5], [[9.0, 9.0, 9.0]]])
    faces = np.concatenate([ball[1], ball[1][:3], box[1][:, ::-1] + len(ball[0]), [[0, 1, 1]]]).astype(np.int32)
    faces[faces == 2] = len(ball[0]) + len(box[0]) + 2
    mesh = clean_mesh(vertices, faces, "raw")
    assert mesh.notes and len(mesh.faces) == len(ball[1]) + len(box[1])
    check(tmp_path, mesh, "tiny", "object.toml", (64, 48), (vertices, faces))
    assert json.loads((tmp_path / "packed.json").read_text())["reversed"] == 1


@pytest.mark.parametrize("name", ROOMS)
def test_a_room_is_encoded_as_by_the_host(tmp_path: Path, name: str) -> None:
    """Bytes of all memories, depths and errors of tiles; normals and a part of a depth map with noise and holes."""
    manifest = Manifest.load(ROOT / "configs" / "golden" / "edge.json")
    room = load_environment(ROOT / "scenes" / "rooms" / name)
    frame, encoder = LiveFrame.of(room), LiveEncoder(layout_of(manifest))
    for _ in range(STILL_ROUNDS):
        maps = encoder.encode(frame)
    small = np.s_[1::4, 1::4]
    random = np.random.default_rng(7)
    depth = room.depth[small] * (1 + 0.003 * random.normal(size=room.depth[small].shape))
    steps = np.where(random.random(depth.shape) < 0.02, 0, np.rint(depth / 0.001)).astype(np.uint16)
    lens = {each: getattr(room, each) / 4 for each in ("fx", "fy", "cx", "cy")}
    codes = {"lens": [room.fx, room.fy, room.cx, room.cy], "tolerance": 0.006}
    job = {
        "module": str(MODULE),
        "manifest": json.loads((ROOT / "configs" / "golden" / "edge.json").read_text()),
        "codes": codes | {"toWorld": room.camera.to_world[:3].ravel().tolist()},
        "step": 0.001,
        "lens": lens,
        "photo": {"width": 300, "height": 225},
        "part": [90, 80],
    }
    for part in ("albedo", "normals", "depth"):
        getattr(frame, part).tofile(tmp_path / f"{part}.bin")
    Image.fromarray(steps).save(tmp_path / "depth.png")
    run_node("room.mjs", tmp_path, job)

    for section in map_sections(maps.image, manifest):
        assert (tmp_path / section.memory).read_bytes() == section.words.tobytes(), section.memory
    for part in ("error", "nearest", "furthest"):
        assert (tmp_path / f"tiles.{part}").read_bytes() == getattr(maps, f"tile_{part}").tobytes()
    result = json.loads((tmp_path / "result.json").read_text())
    assert "this hardware has SLIC maps: set physicalAttributeMemory.encoding=twoLevel" in result["refusal"]
    assert result["depthUnit"] == maps.image.depth_unit and result["count"] == np.count_nonzero(steps == 0)
    holes = steps == 0
    own = normals_of_depth(filled(steps * 0.001, holes), holes, replace(room.camera, **lens))
    photo = np.zeros((225, 300, 3), dtype=np.uint8)
    part = fitted(Frame(0, 0.0, photo, steps * 0.001, Lens(**lens), np.eye(4)[:3]), 90, 80)
    assert (tmp_path / "part.bin").read_bytes() == part.depth.tobytes()
    assert (tmp_path / "derived.bin").read_bytes() == own.normals.tobytes() and result["noise"] == own.noise


@pytest.mark.parametrize("name", ROOMS)
def test_the_light_cube_and_the_sums_of_passes_are_those_of_the_host(tmp_path: Path, name: str) -> None:
    random = np.random.default_rng(3)
    fine = LightCube(random.gamma(0.5, 1.0, (6, FINE, FINE, 3))).words()
    (tmp_path / "fine.bin").write_bytes(fine.tobytes())
    cube = cube_of(fine.tobytes())
    rotation = np.linalg.qr(random.normal(size=(3, 3)))[0]
    photo = random.integers(0, 256, (4, 5, 3), dtype=np.uint8)
    (tmp_path / "photo.bin").write_bytes(photo.tobytes())
    white, passes = 2047.5, []
    for _ in range(3):
        colour, ratio = random.integers(0, 4096, (4, 5, 3)), random.integers(2000, 4600, (4, 5, 3))
        shows = random.random((4, 5)) < 0.5
        shows[0], ratio[0, :2] = False, UNSHADOWED
        passes.append((colour, ratio, shows))
    as_rows = [
        {
            "colours": colour.ravel().tolist(),
            "ratios": ratio.ravel().tolist(),
            "triangles": (shows - 1.0).ravel().tolist(),
        }
        for colour, ratio, shows in passes
    ]
    room = load_environment(ROOT / "scenes" / "rooms" / name)
    assert room.photo is not None
    surface, point = world_surface(room), room.camera_to_world @ [0.1, 0.2, 1.5, 1.0]
    for part, values in zip(("points", "normals", "colours"), (*surface, decode_srgb(room.photo)), strict=True):
        np.asarray(values, "<f8").tofile(tmp_path / f"{part}.bin")
    job = {"module": str(MODULE), "point": point.tolist(), "rotation": rotation.tolist()}
    job |= {"pixels": 20, "white": white, "passes": as_rows}
    run_node("light.mjs", tmp_path, job)
    assert (tmp_path / "words.bin").read_bytes() == cube.turned(rotation).words().tobytes()
    seen = SeenLight.of(room, point)
    radiance = np.fromfile(tmp_path / "radiance.bin").reshape(seen.radiance.shape)
    np.testing.assert_array_equal(radiance[seen.is_seen], seen.radiance[seen.is_seen])
    assert json.loads((tmp_path / "result.json").read_text())["share"] == pytest.approx(seen.share, abs=1e-12)

    sums = [
        Accumulation.of_pixels(colour.astype(np.uint32), shows, ratio.astype(np.uint32), white, UNSHADOWED)
        for colour, ratio, shows in passes
    ]
    total = sums[0] + sums[1] + sums[2]
    for name, expected in (("plain", total.pixels()), ("over", encode_srgb(total.over(decode_srgb(photo))))):
        found = np.fromfile(tmp_path / f"{name}.bin", dtype=np.uint8).reshape(4, 5, 4)
        assert np.abs(found[..., :3].astype(int) - expected).max() <= 1
        assert (found[0, :2, :3] == photo[0, :2]).all() or name == "plain"


@pytest.mark.matrix
@pytest.mark.parametrize("mesh", EIGHT)
@pytest.mark.parametrize(
    ("config", "scene", "size"),
    [("edge", "object.toml", (320, 240)), ("edge", "mirror.toml", (320, 240)), ("tiny", "object.toml", (64, 48))],
)
def test_eight_meshes_are_equal(tmp_path: Path, mesh: str, config: str, scene: str, size: tuple[int, int]) -> None:
    check(tmp_path, load_mesh(mesh), config, scene, size)
