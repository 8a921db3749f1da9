"""A small object on a large floor: light does not leak below it, and the reference would show it if it did."""

from __future__ import annotations

import numpy as np
import pytest

from colonnade.common.image_io import encode_srgb
from colonnade.common.vectors import unit_vectors
from colonnade.design.generator import manifest_for
from colonnade.mesh.load import clean_mesh, load_mesh
from colonnade.mesh.materials.mesh import Mesh
from colonnade.quality.image_metrics import psnr
from colonnade.reference.render import render_reference
from colonnade.render.device_frames import render_model
from colonnade.scene.model import Camera, Light, MeshSource, Scene
from colonnade.scene.object_pose import Placed
from colonnade.scene.view import make_view

SIZE = (320, 240)


def on_a_large_floor(name: str, height: float, floor: float) -> Mesh:
    """A mesh of some height over the middle of a square floor, metres, y up."""
    mesh = load_mesh(name)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    foot = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    vertices = (mesh.vertices - foot) * (height / (high[1] - low[1]))
    square = np.array([[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]]) * (floor / 2)
    faces = np.concatenate([mesh.faces, np.array([[0, 1, 2], [0, 2, 3]]) + len(vertices)]).astype(np.int32)
    normals = np.concatenate([mesh.corner_normals, np.tile([0.0, 1.0, 0.0], (2, 3, 1))])
    return clean_mesh(np.concatenate([vertices, square]), faces, name=name, normals=unit_vectors(normals))


def quality(mesh: Mesh, precision: str, offset: float | None = None) -> float:
    """PSNR of the device's frame against the reference's, dB."""
    light = Light(position=(0.5, 0.45, 0.3), shadow_offset=offset)
    camera = Camera(position=(0.25, 0.35, 0.6), target=(0.0, 0.08, 0.0), fov=40.0)
    scene = Scene(MeshSource(name="cube"), camera=camera, light=light)
    device = render_model(scene, mesh, manifest_for(precision, ("columnBvhMemory.depth=131072",)).manifest, SIZE)
    reference = render_reference(mesh, make_view(Placed(scene, mesh.extent), *SIZE, mesh.materials))
    return psnr(encode_srgb(reference.image), encode_srgb(device.image))


@pytest.mark.parametrize(("precision", "least"), [("32b32s64d", 35.0), ("24b24s64d", 35.0)])
def test_no_light_leaks_below_a_small_object_on_a_large_floor(precision: str, least: float) -> None:
    mesh = on_a_large_floor("teapot", 0.3, 30.0)
    found, leaking = quality(mesh, precision), quality(mesh, precision, 1 / 2048)
    print(f"{precision}: {found:.1f} dB, {leaking:.1f} dB with an offset of 1/2048 of the scene")
    assert found >= least and leaking < found - 5.0
