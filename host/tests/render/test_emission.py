"""Emission: from the file to the registers, and the device's frame against the reference's."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from textured_files import of_mtl

from colonnade.common import notes
from colonnade.common.image_io import encode_srgb
from colonnade.design.generator import manifest_for
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.materials import MeshMaterial, from_gltf
from colonnade.mesh.materials.mesh import Mesh
from colonnade.quality.image_metrics import psnr
from colonnade.reference.render import render_reference
from colonnade.render.device_frames import render_model
from colonnade.scene.model import Background, Camera, Light, MeshSource, Scene
from colonnade.scene.object_mesh import SurfaceFeatures, with_materials
from colonnade.scene.object_pose import Placed
from colonnade.scene.view import make_view

SIZE = (160, 120)
ON = ("frame.emission=true",)
SCENE = Scene(
    MeshSource(name="sphere:4"),
    camera=Camera(position=(1.5, 1.2, 3.4), target=(0.0, 0.0, 0.0), fov=38.0),
    light=Light(colour=(0.5, 0.5, 0.5)),
    background=Background((0.1, 0.1, 0.1)),
)


def test_gltf_and_mtl_materials_emit(tmp_path: Path) -> None:
    strength = {"extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4.0}}}
    surface = {"pbrMetallicRoughness": {"metallicFactor": 0.0}, "emissiveFactor": [0.1, 0.2, 0.5]}
    assert from_gltf(surface).emission == (0.1, 0.2, 0.5)
    assert from_gltf(surface | strength).emission == pytest.approx((0.2, 0.4, 1.0))
    assert from_gltf({**surface, "pbrMetallicRoughness": {"roughnessFactor": 0.0}}) == MeshMaterial(
        "mirror", (1.0, 1.0, 1.0)
    )
    assert of_mtl(tmp_path, "Ke 0.25 0 3").emission == pytest.approx((0.25 / 3, 0.0, 1.0))
    assert of_mtl(tmp_path, "Ke 1 1 1", "d 0.2").emission == (0.0, 0.0, 0.0)


def lamp() -> Mesh:
    """A sphere: an emissive upper half, and below it a dark one that does not emit."""
    mesh = load_mesh("sphere:4")
    materials = (MeshMaterial(albedo=(0.2, 0.2, 0.2)), MeshMaterial(albedo=(0.2, 0.3, 0.1), emission=(0.6, 0.4, 0.9)))
    upper = mesh.vertices[mesh.faces].mean(axis=1)[:, 1] > 0
    return replace(mesh, materials=materials, face_materials=upper.astype(np.uint8))


@pytest.mark.parametrize("config", ["16b16s32d", "32b32s64d"])
def test_the_device_shows_the_emission_of_the_reference(config: str) -> None:
    mesh = lamp()
    view = make_view(Placed(SCENE, mesh.extent), *SIZE, mesh.materials)
    truth = encode_srgb(render_reference(mesh, view).image)
    found, dark = (
        psnr(truth, encode_srgb(render_model(SCENE, mesh, manifest_for(config, options).manifest, SIZE).image))
        for options in (ON, ("frame.emission=false",))
    )
    print(f"{config}: {found:.1f} dB, {dark:.1f} dB without emission")
    assert found > 45.0 > 25.0 > dark


def test_hardware_without_emission_says_so() -> None:
    told: list[str] = []
    with notes.opened(told.append):
        mesh = with_materials(SCENE, lamp(), SurfaceFeatures(8))
    assert not any(any(material.emission) for material in mesh.materials)
    assert "1 emissive material is not emitting: the hardware has no emission: set frame.emission=true" in told[0]
