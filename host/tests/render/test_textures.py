"""Textures on the device against the reference, which samples the pictures themselves."""

from __future__ import annotations

import functools
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from colonnade.common.image_io import encode_srgb
from colonnade.design.generator import manifest_for
from colonnade.mesh.files import catalog
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.materials import Kind, MeshMaterial
from colonnade.mesh.materials.mesh import Mesh
from colonnade.mesh.materials.texture import Texture
from colonnade.quality.image_metrics import psnr
from colonnade.reference.render import render_reference
from colonnade.render.device_frames import render_model
from colonnade.scene.model import Background, Camera, Light, Material, MeshSource, Scene
from colonnade.scene.object_pose import Placed
from colonnade.scene.view import make_view

SIZE = (320, 240)
SCENE = Scene(
    MeshSource(name="sphere:4"),
    camera=Camera(position=(1.5, 1.2, 3.4), target=(0.0, 0.0, 0.0), fov=38.0),
    light=Light(),
    background=Background((0.25, 0.45, 0.7)),
)


def settings(size: int) -> tuple[str, ...]:
    return ("geometry.cornerColours=true", f"geometry.textureBytes={size}")


def painted(edge: int) -> Texture:
    """A painting with soft and hard borders, and lines of a few pixels: uint8 [edge, edge, 3]."""
    v, u = np.mgrid[:edge, :edge] / edge
    sky = np.stack([0.2 + 0.3 * v, 0.4 + 0.3 * v, 0.9 - 0.2 * v], axis=-1)
    hills = v > 0.55 + 0.1 * np.sin(9 * u) + 0.03 * np.sin(31 * u)
    grass = np.stack([0.25 + 0.2 * u, 0.5 + 0.1 * np.sin(40 * v), 0.15 + 0 * u], axis=-1)
    colours = np.where(hills[..., None], grass, sky)
    sun = np.hypot(u - 0.3, v - 0.25)
    colours = np.where((sun < 0.12)[..., None], (1.0, 0.85, 0.3), colours)
    fence = hills & ((np.sin(160 * u) > 0.9) | (np.abs(v - 0.8) < 0.01))
    return Texture("painting", np.rint(255 * np.where(fence[..., None], (0.9, 0.88, 0.8), colours)).astype(np.uint8))


def sphere(edge: int) -> Mesh:
    """A sphere with the painting around it twice, from longitude and latitude; faces at the seam go on beyond it."""
    mesh = load_mesh("sphere:4")
    x, y, z = mesh.vertices.T
    around = np.arctan2(x, z)[mesh.faces] / np.pi
    around = np.where(around < around.max(axis=1, keepdims=True) - 1.0, around + 2.0, around)
    positions = np.stack([around, (np.arccos(np.clip(y, -1, 1)) / np.pi)[mesh.faces]], axis=-1)
    materials = (MeshMaterial(albedo=(1.0, 1.0, 1.0), texture=0),)
    return replace(mesh, materials=materials, textures=(painted(edge),), corner_uvs=positions)


def striped(edge: int) -> np.ndarray:
    """A coat for the duck's charts: dots on its head, stripes on its ring; uint8 [edge, edge, 3]."""
    v, u = (np.mgrid[:edge, :edge] + 0.5) / edge
    colours = np.empty((edge, edge, 3))
    colours[:] = (0.98, 0.80, 0.15)
    colours[np.hypot(18 * u % 1 - 0.5, 18 * v % 1 - 0.5) < 0.28] = (0.93, 0.45, 0.1)
    ring = (v > 0.70) | ((u > 0.64) & (v < 0.32))
    stripes = np.where(v > 0.5, np.sin(22 * np.arctan2(v - 0.78, u - 0.5)), np.sin(110 * v)) > 0
    colours[ring] = np.where(stripes[ring][:, None], (0.85, 0.12, 0.12), (0.97, 0.95, 0.9))
    return np.rint(255 * colours).astype(np.uint8)


def duck(folder: Path) -> Path:
    """Write the duck, whose file has positions but no picture, with its coat: an OBJ file with MTL and PNG."""
    lines = catalog.find("duck").path.read_text().splitlines()
    plain = [line for line in lines if line.split(" ")[0] not in ("mtllib", "usemtl")]
    (folder / "duck.obj").write_text("\n".join(["mtllib duck.mtl", "usemtl coat", *plain]))
    (folder / "duck.mtl").write_text("newmtl coat\nKd 1 1 1\nmap_Kd coat.png\n")
    Image.fromarray(striped(1024)).save(folder / "coat.png")
    return folder / "duck.obj"


@functools.cache
def reference(painting: int, kind: Kind) -> np.ndarray:
    """The reference's frame of a sphere."""
    mesh = sphere(painting)
    view = make_view(Placed(replace(SCENE, material=Material(kind=kind)), mesh.extent), *SIZE, mesh.materials)
    return encode_srgb(render_reference(mesh, view).image)


def device_frame(mesh: Mesh, config: str, overrides: tuple[str, ...], material: Material) -> np.ndarray:
    """The model's frame."""
    device = render_model(replace(SCENE, material=material), mesh, manifest_for(config, overrides).manifest, SIZE)
    return encode_srgb(device.image)


@pytest.mark.parametrize("config", ["16b16s32d", "24b24s64d", "32b32s64d"])
def test_the_device_shows_the_texture_of_the_reference(config: str) -> None:
    """Far nearer than with one colour; on mirrors and glass as a tint."""
    kinds: tuple[Kind, ...] = ("diffuse", "mirror", "glass")
    for kind in kinds:
        found, plain = (
            psnr(reference(256, kind), device_frame(sphere(256), config, options, Material(kind=kind)))
            for options in (settings(16384), ("geometry.textureBytes=0",))
        )
        print(f"{config}, {kind}: {found:.1f} dB, {plain:.1f} dB with one colour")
        assert found > 30.0 and found > plain + 8.0


def test_more_bytes_keep_more_of_a_texture() -> None:
    mesh, sizes = sphere(1024), (5632, 16384, 21632)
    frames = [device_frame(mesh, "32b32s64d", settings(size), Material(kind="diffuse")) for size in sizes]
    found = [psnr(reference(1024, "diffuse"), frame) for frame in frames]
    print("dB in 5,632, 16,384 and 21,632 bytes: " + ", ".join(f"{one:.1f}" for one in found))
    assert found == sorted(found) and found[-1] > found[0] + 1.0
    assert found[1] > 37.5, "tiles share no words"


@pytest.mark.skipif(not os.environ.get("COLONNADE_MESHES"), reason="the duck is in the folders of COLONNADE_MESHES")
def test_a_duck_shows_its_coat(tmp_path: Path) -> None:
    mesh = load_mesh(duck(tmp_path))
    assert mesh.textures[0].size == (1024, 1024)
    view = make_view(Placed(SCENE, mesh.extent), *SIZE, mesh.materials)
    expected = encode_srgb(render_reference(mesh, view).image)
    found = psnr(expected, device_frame(mesh, "32b32s64d", settings(16384), Material()))
    print(f"duck, a picture of 3,145,728 bytes in 16,384: {found:.1f} dB")
    assert found > 22.0
