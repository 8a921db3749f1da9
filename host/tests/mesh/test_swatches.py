"""Faces of one colour of their texture: swatch maps are exact, and take no texture memory."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from textured_files import png

from colonnade.common.image_io import encode_srgb
from colonnade.common.srgb import linear_from_srgb
from colonnade.design.generator import manifest_for
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.mesh import Mesh
from colonnade.quality.image_metrics import psnr
from colonnade.reference.render import render_reference
from colonnade.render.device_frames import render_model
from colonnade.scene.model import Background, Camera, Light, MeshSource, Scene
from colonnade.scene.object_pose import Placed
from colonnade.scene.view import make_view

SWATCHES = np.random.default_rng(5).integers(0, 256, (1, 256, 3), dtype=np.uint8)


def painted(folder: Path, swatches: np.ndarray, spread: float = 0.0, corner_colours: bool = True) -> Mesh:
    """A sphere whose faces take the swatches by turns; ``spread`` is the size of a face in the picture."""
    sphere = load_mesh("sphere:2")
    width = swatches.shape[1]
    (folder / "a.png").write_bytes(png(swatches))
    (folder / "a.mtl").write_text("newmtl a\nKd 1 1 1\nmap_Kd a.png\n")
    lines = ["mtllib a.mtl", "usemtl a", *("v {} {} {}".format(*vertex) for vertex in sphere.vertices)]
    for number, face in enumerate(sphere.faces + 1):
        at = (number % width + 0.5) / width
        lines += [f"vt {at} 0.5", f"vt {at + spread} 0.5", f"vt {at} 0.5"]
        lines.append("f " + " ".join(f"{vertex}/{3 * number + k + 1}" for k, vertex in enumerate(face)))
    (folder / "a.obj").write_text("\n".join(lines))
    return load_mesh(folder / "a.obj", corner_colours=corner_colours)


def test_faces_in_a_texel_have_its_colour_at_their_corners(tmp_path: Path) -> None:
    mesh = painted(tmp_path, SWATCHES)
    (material,) = mesh.materials
    assert material.texture is None and material.has_corner_colours and mesh.notes == ()
    assert mesh.corner_colours is not None
    expected = linear_from_srgb(SWATCHES[0, mesh.source_faces % 256] / 255.0)
    np.testing.assert_allclose(mesh.corner_colours, np.repeat(expected[:, None], 3, axis=1), atol=1e-9)


def test_faces_of_several_colours_keep_their_texture(tmp_path: Path) -> None:
    mesh = painted(tmp_path, SWATCHES, spread=1.6 / 256)
    (material,) = mesh.materials
    assert material.texture == 0 and not material.has_corner_colours


def test_an_area_of_one_colour_counts_as_a_texel(tmp_path: Path) -> None:
    mesh = painted(tmp_path, np.repeat(SWATCHES[:, :32], 8, axis=1), spread=3.0 / 256)
    kinds = [mesh.materials[index].texture for index in mesh.face_materials]
    # Of eight pixels of a swatch, three are too near to the next one
    assert kinds.count(None) == pytest.approx(len(kinds) * 5 / 8, rel=0.1)


def test_hardware_without_corner_colours_has_the_swatches_as_materials(tmp_path: Path) -> None:
    mesh = painted(tmp_path, SWATCHES[:, :4], corner_colours=False)
    assert len(mesh.materials) == 4 and all(one.texture is None for one in mesh.materials)


def test_a_swatch_map_is_as_near_to_the_reference_as_plain_colours(tmp_path: Path) -> None:
    """A tile of the atlas has 4 colours at most: 256 swatches in a row are 24 dB from it."""
    mesh = painted(tmp_path, SWATCHES)
    scene = Scene(
        MeshSource(name="sphere:2"), camera=Camera(position=(1.5, 1.2, 3.4), target=(0.0, 0.0, 0.0), fov=38.0),
        light=Light(), background=Background((0.25, 0.45, 0.7)),
    )  # fmt: skip
    manifest = manifest_for("small").manifest
    size = (160, 120)
    reference = render_reference(mesh, make_view(Placed(scene, mesh.extent), *size, mesh.materials))
    found = psnr(encode_srgb(reference.image), encode_srgb(render_model(scene, mesh, manifest, size).image))
    print(f"256 swatches: {found:.1f} dB")
    assert found > 45.0


def test_a_small_picture_is_enlarged(tmp_path: Path) -> None:
    """Of 16 swatches in a tile the encoder keeps four; enlarged, each has tiles of its own."""
    from colonnade.scene_image.atlas import make_atlas

    mesh = painted(tmp_path, np.repeat(SWATCHES[:, :16], 16, axis=0), spread=15.0 / 16)
    mesh = replace(mesh, textures=(replace(mesh.textures[0], is_nearest=True),))
    atlas = make_atlas(mesh, mesh.materials, 1.0, 512)
    assert atlas is not None and mesh.corner_uvs is not None
    tiles = atlas.colours.reshape(32, 16, 32, 16, 3).swapaxes(1, 2).reshape(-1, 256, 3)
    assert max(len(np.unique(tile, axis=0)) for tile in tiles) <= 2
