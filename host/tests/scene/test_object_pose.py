"""Objects on surfaces of a room, seen by its camera."""

from __future__ import annotations

import numpy as np
import pytest
from colonnade_lab.evaluation.studies.synthetic_attic import attic

from colonnade.common.errors import UserError
from colonnade.environment.model import Environment
from colonnade.mesh.load import load_mesh
from colonnade.reference.render import primary_directions
from colonnade.scene.model import Light, Material, MeshSource, Placement, Scene, Transform
from colonnade.scene.object_pose import Placed
from colonnade.scene.view import make_view

STANDING = Scene(MeshSource("teapot"), placement=Placement((100.0, 110.5), 0.4, 25.0), light=Light((1.0, 2.0, 0.5)))


@pytest.fixture(scope="module")
def environment() -> Environment:
    return attic(160, 120).environment


def test_an_object_stands_on_the_surface_of_its_pixel(environment: Environment) -> None:
    extent = load_mesh("teapot").extent
    pose = Placed(STANDING, extent, environment).pose
    outline = pose.to_world(extent.outline)
    assert outline[:, 1].min() == pytest.approx(0.0, abs=2e-3)  # the floor
    assert extent.edge * pose.scale == pytest.approx(0.4)
    foot = pose.to_world(extent.centre)
    seen = (np.array([foot[0], 0.0, foot[2]]) - environment.camera_to_world[:, 3]) @ environment.camera_to_world[:, :3]
    # The depth is constant within a pixel.
    np.testing.assert_allclose(seen[0] / seen[2] * environment.fx + environment.cx, 100.0, atol=0.05)
    np.testing.assert_allclose(seen[1] / seen[2] * environment.fy + environment.cy, 110.5, atol=0.05)


def test_the_frame_is_the_rooms_view(environment: Environment) -> None:
    extent = load_mesh("teapot").extent
    for width, height in ((160, 120), (80, 60), (320, 240)):
        view = make_view(Placed(STANDING, extent, environment), width, height)
        assert view.view_to_mesh is not None
        turn = view.view_to_mesh[:, :3] * Placed(STANDING, extent, environment).pose.scale
        expected = environment.camera.directions(environment.width, environment.height)
        across, along = 160 / width, 120 / height
        directions = primary_directions(view, slice(0, height)).reshape(height, width, 3) @ turn
        np.testing.assert_allclose(directions[..., 2], 1.0)
        u, v = ((np.arange(n) + 0.5) * scale for n, scale in ((width, across), (height, along)))
        np.testing.assert_allclose(directions[0, :, 0], (u - environment.cx) / environment.fx, atol=1e-12)
        np.testing.assert_allclose(directions[:, 0, 1], (v - environment.cy) / environment.fy, atol=1e-12)
        np.testing.assert_allclose(
            expected[0, 0, :2], [(0.5 - environment.cx) / environment.fx, (0.5 - environment.cy) / environment.fy]
        )
        np.testing.assert_allclose(view.origin, view.view_to_mesh[:, 3])


def test_lights_and_falloff_are_transformed(environment: Environment) -> None:
    extent = load_mesh("teapot").extent
    pose = Placed(STANDING, extent, environment).pose
    scene = Scene(MeshSource("teapot"), placement=STANDING.placement, light=Light((1.0, 2.0, 0.5), falloff=2.0))
    light = make_view(Placed(scene, extent, environment), 160, 120).lights[0]
    np.testing.assert_allclose(pose.to_world(light.position), [1.0, 2.0, 0.5])
    assert light.reach is not None and light.reach * pose.scale == pytest.approx(2.0)


def test_by_default_the_object_stands_near_the_middle(environment: Environment) -> None:
    extent = load_mesh("cube").extent
    pose = Placed(Scene(MeshSource("cube")), extent, environment).pose
    seen = (pose.to_world(extent.centre) - environment.camera_to_world[:, 3]) @ environment.camera_to_world[:, :3]
    assert seen[0] / seen[2] * environment.fx + environment.cx == pytest.approx(80, abs=10)
    placed = Placed(Scene(MeshSource("cube"), transform=Transform(translate=(0.0, 1.0, 0.0))), extent, environment).pose
    np.testing.assert_allclose(placed.to_world(np.zeros(3)), [0.0, 1.0, 0.0])


def test_the_scenes_material_replaces_the_meshs() -> None:
    from colonnade.mesh.materials.materials import MeshMaterial

    extent, own = load_mesh("cube").extent, (MeshMaterial("mirror", (1.0, 0.5, 0.5)), MeshMaterial())
    view = make_view(Placed(Scene(MeshSource("cube")), extent), 8, 8, own)
    assert view.materials == own
    scene = Scene(MeshSource("cube"), material=Material(kind="glass", ior=1.3))
    view = make_view(Placed(scene, extent), 8, 8, own)
    assert view.materials == (MeshMaterial("glass", (1.0, 0.5, 0.5), 1.3), MeshMaterial("glass", ior=1.3))


def test_settings_that_do_not_fit_the_room_are_reported(environment: Environment) -> None:
    extent = load_mesh("cube").extent
    outside = Scene(MeshSource("cube"), placement=Placement((160.0, 5.0)))
    with pytest.raises(UserError, match=r"stand_at is \(160, 5\).*160x120"):
        _ = Placed(outside, extent, environment).pose
    with pytest.raises(UserError, match="100x100 pixels does not have the proportions of room attic, 160x120"):
        make_view(Placed(STANDING, extent, environment), 100, 100)
