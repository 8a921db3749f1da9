"""Loss of AR frames by source, and the bounding planes of an encoded room."""

from __future__ import annotations

import json

import numpy as np
import pytest
from colonnade.common.image_io import encode_srgb
from colonnade.design.generator import manifest_for
from colonnade.environment.model import Environment
from colonnade.maps.encoded import EncodedEnvironment
from colonnade.maps.image import AttributeImage, encode_environment
from colonnade.maps.layout import AttributeLayout
from colonnade.mesh.load import load_mesh
from colonnade.quality.image_metrics import MAX_PSNR
from colonnade.reference.environment.decoded import BoundingPlanes, decoded_depth, float_plane_march
from colonnade.scene.model import Material, Placement
from colonnade.scene.object_pose import Placed
from colonnade.scene.view import make_view

from colonnade_lab.evaluation.region_metrics import compare_regions, frame_regions
from colonnade_lab.evaluation.studies.ar_losses import Losses, device_frame, losses, placed_scene, table
from colonnade_lab.evaluation.studies.synthetic_attic import attic


@pytest.fixture(scope="module")
def environment() -> Environment:
    return attic(160, 120).environment


@pytest.fixture(scope="module")
def image(environment: Environment) -> AttributeImage:
    return encode_environment(environment, AttributeLayout(width=160, height=120, map_bytes=4096, plane_bytes=4096))


@pytest.fixture(scope="module")
def measured(environment: Environment, image: AttributeImage) -> Losses:
    mesh, march = load_mesh("teapot:4"), float_plane_march(environment, image)
    scene = placed_scene("teapot:4", Material("mirror", (0.9, 0.9, 0.9)), environment, Placement((79.5, 71.0), 0.4))
    view = make_view(Placed(scene, mesh.extent, environment), 160, 120, mesh.materials)
    first = losses(mesh, view, environment, image, march, with_dists=False)
    device = first.pictures["both"].image
    return losses(mesh, view, environment, image, march, device, with_dists=False)


def test_bounding_planes_face_inward_on_all_sides(environment: Environment, image: AttributeImage) -> None:
    bounding = BoundingPlanes(environment, image)
    directions = np.random.default_rng(7).normal(size=(2000, 3))
    origins = np.broadcast_to([0.0, 0.0, 1.0], directions.shape)
    met = bounding.intersect(origins, directions)
    away = np.einsum("ni,ni->n", met.position - origins, directions)
    # A ray may leave where there is no bounding plane, above and to the side.
    assert met.outside.mean() < 0.4
    assert (np.einsum("ni,ni->n", met.normals, directions)[~met.outside] < 0).all()
    assert (away[~met.outside] > 0).all()
    behind = bounding.intersect(np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, 0.0, -1.0]]))
    np.testing.assert_allclose(behind.position[0], [0, 0, -0.5], atol=0.01)
    np.testing.assert_allclose(behind.normals[0], [0, 0, 1], atol=1e-3)


def test_planes_match_the_room(environment: Environment, image: AttributeImage) -> None:
    away = np.abs(decoded_depth(environment, image) - environment.depth) / environment.depth
    assert np.median(away) < 0.01 and np.percentile(away, 90) < 0.05


def test_each_loss_shows_in_its_region(measured: Losses) -> None:
    loss = measured.by_loss
    assert set(loss) == {"clustering", "rebuild", "both", "fixed point", "device"}
    truth = measured.pictures["full"]
    for picture in measured.pictures.values():
        np.testing.assert_array_equal(picture.object_mask, truth.object_mask)
        np.testing.assert_array_equal(picture.hit_triangles, truth.hit_triangles)
    assert loss["fixed point"]["frame"].psnr == MAX_PSNR
    assert loss["device"] == loss["both"]
    psnr = {name: loss[name]["frame"].psnr or 0 for name in loss}
    assert psnr["rebuild"] > psnr["clustering"] >= psnr["both"] - 0.5
    assert loss["rebuild"]["shadow"].pixels == np.count_nonzero(
        ~truth.object_mask & (truth.shadow_ratio < 0.97).any(axis=2)
    )
    assert loss["rebuild"]["shadow"].pixels > 20


def test_losses_are_printed_as_a_table(measured: Losses) -> None:
    lines = table({"attic: teapot": measured.by_loss}).splitlines()
    assert len(lines) == 2 + 5 and all(line.count("|") == 6 for line in lines)


def test_the_device_shows_the_reconstructed_room_within_rounding(
    environment: Environment, image: AttributeImage, measured: Losses
) -> None:
    """The rows `fixed point` and `device`, from the model's frame of the same scene."""
    mesh = load_mesh("teapot:4")
    scene = placed_scene("teapot:4", Material("mirror", (0.9, 0.9, 0.9)), environment, Placement((79.5, 71.0), 0.4))
    view = make_view(Placed(scene, mesh.extent, environment), 160, 120, mesh.materials)
    hardware = f"physicalAttributeMemory={json.dumps(image.layout.to_config())}"
    frame = device_frame(
        mesh, view, EncodedEnvironment(environment, image), manifest_for("small", (hardware,)).manifest
    )
    truth, both = measured.pictures["full"], measured.pictures["both"]
    regions = frame_regions(truth.object_mask, truth.shadow_ratio)
    rounding = compare_regions(encode_srgb(both.image), encode_srgb(frame), regions, with_dists=False)
    loss = compare_regions(encode_srgb(truth.image), encode_srgb(frame), regions, with_dists=False)
    assert (rounding["frame"].psnr or 0) > (measured.by_loss["both"]["frame"].psnr or 0) + 3
    assert (loss["frame"].psnr or 0) > (measured.by_loss["both"]["frame"].psnr or 0) - 1
    assert np.median(np.abs(frame - both.image)) < 2 / 4095
