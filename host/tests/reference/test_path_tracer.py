"""Mirrors, glass, lights and rooms in the reference, against hand calculations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from colonnade_lab.evaluation.studies.synthetic_attic import attic

from colonnade.environment.light_cube import LightCube
from colonnade.environment.model import Environment, EnvironmentCamera
from colonnade.mesh.load import clean_mesh, load_mesh
from colonnade.mesh.materials.materials import MeshMaterial
from colonnade.mesh.materials.mesh import Mesh
from colonnade.reference.bounce import bounce
from colonnade.reference.environment.depth_mesh import DepthMesh, full_backdrop
from colonnade.reference.environment.surface import Backdrop, BackdropPoints
from colonnade.reference.render import ReferenceResult, render_reference
from colonnade.scene.view import Gather, PlacedLight, View

SIZE = 48, 32
LIGHT = PlacedLight(np.array([0.3, -0.4, 0.5]), np.array([0.6, 0.5, 0.4]))


def wall(depth: float = 4.0) -> Environment:
    """A wall across the view with a different colour per pixel; view space is world space."""
    width, height = SIZE
    y, x = np.mgrid[:height, :width]
    albedo = np.stack([x / width, y / height, 0.5 + 0 * x], axis=2)
    camera = EnvironmentCamera(40.0, 40.0, width / 2, height / 2, np.eye(3, 4))
    normals = np.broadcast_to([0.0, 0.0, -1.0], (height, width, 3))
    return Environment("wall", albedo, normals, np.full((height, width), depth), True, camera, None)


def placed(environment: Environment | None, material: MeshMaterial, **changes: object) -> View:
    """A view by the room's camera; mesh space is view space, so y points down."""
    width, height = SIZE
    view = View(
        width=width,
        height=height,
        origin=np.zeros(3),
        direction=np.array([(0.5 - width / 2) / 40, (0.5 - height / 2) / 40, 1.0]),
        step_x=np.array([1 / 40, 0.0, 0.0]),
        step_y=np.array([0.0, 1 / 40, 0.0]),
        lights=(LIGHT,),
        materials=(material,),
        ambient=np.full(3, 0.2),
        background=np.array([0.3, 0.2, 0.1]),
        flat=True,
        shadows=True,
        view_to_mesh=None if environment is None else np.eye(3, 4),
    )
    return replace(view, **changes)  # type: ignore[arg-type]


def quads(*corners: list[list[float]], materials: tuple[MeshMaterial, ...] = (MeshMaterial(),)) -> Mesh:
    """Quads with four corners each; the first one has the first material, and so on."""
    vertices = np.array(corners).reshape(-1, 3)
    faces = np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * k for k in range(len(corners))])
    index = np.minimum(np.repeat(np.arange(len(corners)), 2), len(materials) - 1).astype(np.uint8)
    return clean_mesh(vertices, faces.astype(np.int32), "quads", materials=materials, face_materials=index)


def upright(x: float, y: float, z: float, half: float) -> list[list[float]]:
    """Corners of a square that faces the camera."""
    return [[x - half, y - half, z], [x - half, y + half, z], [x + half, y + half, z], [x + half, y - half, z]]


def lying(y: float, half: float, near: float, far: float) -> list[list[float]]:
    """Corners of a rectangle below the camera that faces up (−y)."""
    return [[-half, y, near], [half, y, near], [half, y, far], [-half, y, far]]


FAR_AWAY = quads(upright(0.0, -500.0, 1.0, 0.1))


def rendered(mesh: Mesh, view: View, environment: Environment | None = None) -> ReferenceResult:
    return render_reference(mesh, view, backdrop=full_backdrop(environment) if environment else None)


def test_a_room_alone_is_its_maps_in_the_light() -> None:
    environment = wall()
    frame = rendered(FAR_AWAY, placed(environment, MeshMaterial()), environment)
    to_light = LIGHT.position - environment.points()
    cosine = -to_light[..., 2] / np.linalg.norm(to_light, axis=2)
    np.testing.assert_allclose(frame.image, environment.albedo * (0.2 + cosine[..., None] * LIGHT.colour), rtol=1e-5)
    assert (frame.shadow_ratio == 1).all() and not frame.outside.any() and not frame.object_mask.any()


def test_falloff_is_one_at_the_reference_distance_and_at_most_four() -> None:
    environment = wall()
    for reach, expected in ((3.5, 1.0), (7.0, 4.0), (1.75, 0.25), (70.0, 4.0)):
        light = PlacedLight(np.array([0.0, 0.0, 0.5]), LIGHT.colour, reach)
        dark = placed(environment, MeshMaterial(), ambient=np.zeros(3), lights=(light,))
        plain = replace(dark, lights=(replace(light, reach=None),))
        with_falloff, without = (rendered(FAR_AWAY, view, environment).image[16, 24] for view in (dark, plain))
        np.testing.assert_allclose(with_falloff, np.minimum(expected * without, 1), rtol=1e-3)


def test_lights_add_up() -> None:
    environment = wall()
    other = PlacedLight(np.array([-1.0, 0.5, 1.0]), np.array([0.1, 0.2, 0.05]), 2.0)
    both, one, two, none = (
        rendered(FAR_AWAY, placed(environment, MeshMaterial(), lights=lights), environment).image
        for lights in ((LIGHT, other), (LIGHT,), (other,), (replace(other, colour=np.zeros(3)),))
    )
    np.testing.assert_allclose(both, one + two - none, atol=1e-12)


@pytest.mark.parametrize(("kinds", "share"), [(("diffuse",), 0.0), (("glass",), 0.4), (("glass", "mirror"), 0.0)])
def test_the_most_opaque_occluder_determines_the_shadow(kinds: tuple[str, ...], share: float) -> None:
    environment, material = wall(), MeshMaterial()
    materials = tuple(MeshMaterial(kind) for kind in kinds)
    # Squares between light and wall that do not occlude pixel (24, 16).
    mesh = quads(*(upright(0.21, -0.28, 1.5 + k / 10, 0.1) for k in range(len(kinds))), materials=materials)
    view = placed(environment, material, materials=materials, shadow_transmittance=0.4)
    frame = rendered(mesh, view, environment)
    direct = 3.5 / np.linalg.norm(LIGHT.position - np.array([0.05, 0.05, 4.0]))
    everything = 0.2 + direct * LIGHT.colour
    assert not frame.object_mask[16, 24]
    np.testing.assert_allclose(
        frame.shadow_ratio[16, 24], (0.2 + share * direct * LIGHT.colour) / everything, rtol=1e-3
    )
    np.testing.assert_allclose(
        frame.image[16, 24] / environment.albedo[16, 24], frame.shadow_ratio[16, 24] * everything, rtol=1e-3
    )


def test_a_wall_gathers_light_from_what_stands_on_it() -> None:
    """Close to a wide plate almost half of the directions meet it: they bring its colour in place of ambient light."""
    environment, plate = wall(), MeshMaterial(albedo=(0.9, 0.3, 0.0))
    dark = (PlacedLight(LIGHT.position, np.zeros(3)),)
    gather = Gather(1, ((37, 201),) * 4, LightCube(np.full((6, 8, 8, 3), 0.2)))
    view = placed(environment, plate, lights=dark, gather=gather)
    frame = rendered(quads(lying(0.5, 9.0, 0.5, 3.99), materials=(plate,)), view, environment)
    # Rows of squares of 4 x 4 pixels, 0.2 m to 0.5 m above the plate
    ratio = frame.shadow_ratio[16:20]
    meets = ratio[..., 2] < 0.5
    assert not frame.object_mask[16:20].any() and 0.42 < meets.mean() < 0.48
    np.testing.assert_allclose(ratio, np.where(meets[..., None], plate.albedo, 1.0), rtol=1e-9)
    np.testing.assert_allclose(frame.image[16:20], environment.albedo[16:20] * 0.2 * ratio, rtol=1e-9)
    assert frame.rays["gather"] == SIZE[0] * SIZE[1]


def test_a_mirror_on_the_floor_shows_the_wall_upside_down() -> None:
    environment = wall()
    mesh, view = quads(lying(0.5, 9.0, 1.0, 3.9)), placed(environment, MeshMaterial("mirror", (0.5, 1.0, 1.0)))
    frame, alone = rendered(mesh, view, environment), rendered(FAR_AWAY, view, environment)
    # The ray of row y hits the floor at z = 0.5 / slope; the reflection hits the wall at the mirrored height.
    slope = (np.arange(SIZE[1]) + 0.5 - 16) / 40
    for row in np.flatnonzero(frame.object_mask[:, 24]):
        height = 0.5 - slope[row] * (4.0 - 0.5 / slope[row])
        v = height / 4.0 * 40 + 16
        if abs(v % 1 - 0.5) < 0.4:
            expected = alone.image[int(v), 24] * (0.5, 1.0, 1.0)
            np.testing.assert_allclose(frame.image[row, 24], expected, rtol=0.05)
    assert frame.object_mask[:, 24].sum() > 5
    assert frame.rays["reflection"] == frame.object_mask.sum() and frame.rays["refraction"] == 0


def test_reflections_that_leave_the_view_are_marked() -> None:
    environment = wall()
    frame = rendered(
        quads(upright(0.0, 0.0, 2.0, 0.3)), placed(environment, MeshMaterial("mirror", (1.0,) * 3)), environment
    )
    np.testing.assert_array_equal(frame.outside, frame.object_mask)
    np.testing.assert_allclose(frame.image[frame.object_mask], [[0.3, 0.2, 0.1]] * int(frame.object_mask.sum()))


def test_the_bounding_surface_replaces_missing_maps() -> None:
    class Behind:
        def intersect(self, origins: np.ndarray, directions: np.ndarray) -> BackdropPoints:
            normals = np.broadcast_to([0.0, 0.0, 1.0], origins.shape)
            albedo = np.broadcast_to([0.1, 0.7, 0.2], origins.shape)
            position = origins + directions * ((-1.0 - origins[:, 2]) / directions[:, 2])[:, None]
            return BackdropPoints(position, normals, albedo, np.zeros(len(origins), bool))

    environment = wall()
    backdrop = replace(full_backdrop(environment), bounding=Behind())
    view = placed(environment, MeshMaterial("mirror", (1.0,) * 3), lights=(replace(LIGHT, colour=np.zeros(3)),))
    frame = render_reference(quads(upright(0.0, 0.0, 2.0, 0.3)), view, backdrop=backdrop)
    assert not frame.outside.any()
    np.testing.assert_allclose(frame.image[16, 24], [0.02, 0.14, 0.04])


def test_glass_conserves_energy() -> None:
    """With a uniform background, reflection and refraction add up to the tint of each entry."""
    mesh, view = load_mesh("sphere:4"), placed(None, MeshMaterial("glass", (0.9, 0.8, 1.0)), bounces=6)
    mesh = replace(mesh, vertices=mesh.vertices * 0.5 + (0, 0, 3.0))
    frame = rendered(mesh, replace(view, flat=False))
    np.testing.assert_allclose(
        frame.image[frame.object_mask], np.broadcast_to(view.background * (0.9, 0.8, 1.0), (frame.object_mask.sum(), 3))
    )
    assert frame.rays["refraction"] > frame.object_mask.sum()


def test_glass_with_index_one_is_invisible() -> None:
    environment = wall()
    view = placed(environment, MeshMaterial("glass", (1.0,) * 3, 1.0), shadows=False)
    frame, alone = (
        rendered(mesh, view, environment)
        for mesh in (quads(upright(0, 0, 2.0, 0.3), upright(0, 0, 2.2, 0.3)), FAR_AWAY)
    )
    assert frame.object_mask.any()
    np.testing.assert_allclose(frame.image, alone.image, rtol=1e-6)


def test_bounces_end_at_the_background() -> None:
    """Two parallel mirrors: after the maximum number of reflections the object is ignored."""
    floor, ceiling = lying(0.5, 9.0, 0.5, 39.0), lying(-0.5, 9.0, 0.5, 39.0)
    for bounces in (0, 1, 3):
        view = placed(None, MeshMaterial("mirror", (0.5,) * 3), bounces=bounces)
        frame = rendered(quads(floor, ceiling), view)
        powers = np.log2(view.background[0] / frame.image[frame.object_mask][:, 0])
        assert powers.round(6).max() == bounces + 1
        assert frame.rays["reflection"] <= bounces * frame.object_mask.sum()


def test_a_room_may_be_rendered_at_another_size() -> None:
    made = attic(64, 48)
    backdrop = full_backdrop(made.environment)
    u, v = (np.mgrid[:48, :64][::-1] + 0.5).reshape(2, -1)
    seen = backdrop.visible_points(u, v)
    np.testing.assert_allclose(seen.position.reshape(48, 64, 3), made.environment.points())
    np.testing.assert_allclose(seen.albedo.reshape(48, 64, 3), made.environment.albedo)


def test_the_depth_mesh_has_no_faces_across_discontinuities() -> None:
    environment = wall()
    depth = environment.depth.copy()
    depth[8:24, 10:30] = 2.0
    stepped = replace(environment, depth=depth)
    inner = environment.camera.directions(*SIZE)[1:-1, 1:-1].reshape(-1, 3)
    met = DepthMesh(stepped).intersect(np.zeros_like(inner), inner)
    whole = DepthMesh(stepped, split=False).intersect(np.zeros_like(inner), inner)
    assert not whole.outside.any() and not met.outside.all()
    np.testing.assert_allclose(met.position[~met.outside, 2], depth[1:-1, 1:-1].ravel()[~met.outside], rtol=1e-5)
    # A ray from the side passes between plate and wall, where triangles across the discontinuity would be.
    side, across = np.array([[-1.5, 0.0, 3.0]]), np.array([[1.0, 0.0, 0.02]])
    assert DepthMesh(stepped).intersect(side, across).outside.all()
    assert np.abs(DepthMesh(stepped, split=False).intersect(side, across).position[0, 2] - 3.0) < 0.1
    # No map covers the back of the plate.
    assert DepthMesh(stepped).intersect(np.array([[0.0, 0.0, 3.0]]), np.array([[0.0, 0.0, -1.0]])).outside.all()


def random_bounces(front: bool, ior: float = 1.5, count: int = 2000) -> tuple[np.ndarray, ...]:
    random = np.random.default_rng(2)
    normals, directions = (v / np.linalg.norm(v, axis=1)[:, None] for v in random.normal(size=(2, count, 3)))
    directions *= -np.sign(np.einsum("ni,ni->n", normals, directions))[:, None]
    flags = np.full(count, front)
    made = bounce(directions, normals, normals, flags, np.ones(count, bool), np.full(count, ior))
    return normals, directions, made.directions, made.refracted, made.fresnel_directions, made.fresnel_weights


def test_refraction_obeys_snell_and_total_reflection() -> None:
    for front in (True, False):
        normals, into, out, refracted, _, shares = random_bounces(front)
        sine_in, sine_out = (np.linalg.norm(np.cross(d, normals), axis=1) for d in (into, out))
        eta = 1 / 1.5 if front else 1.5
        np.testing.assert_array_equal(refracted, eta * sine_in <= 1)
        np.testing.assert_allclose(sine_out[refracted], eta * sine_in[refracted], atol=1e-9)
        assert (np.einsum("ni,ni->n", out, normals)[refracted] < 0).all()
        np.testing.assert_allclose(sine_out[~refracted], sine_in[~refracted], atol=1e-9)
        assert (np.einsum("ni,ni->n", out, normals)[~refracted] > 0).all()
        cosine = -np.einsum("ni,ni->n", into, normals)
        np.testing.assert_allclose(shares, (0.04 + 0.96 * (1 - cosine) ** 5) * front, atol=1e-12)


def test_a_shading_normal_never_sends_a_ray_to_the_wrong_side() -> None:
    random = np.random.default_rng(3)
    facing, tilt, into = (v / np.linalg.norm(v, axis=1)[:, None] for v in random.normal(size=(3, 5000, 3)))
    into *= -np.sign(np.einsum("ni,ni->n", facing, into))[:, None]
    shading = facing + 0.9 * tilt
    shading /= np.linalg.norm(shading, axis=1)[:, None]
    for glass in (False, True):
        made = bounce(into, shading, facing, random.random(5000) < 0.5, np.full(5000, glass), np.full(5000, 1.5))
        side = np.einsum("ni,ni->n", made.directions, facing)
        assert (np.where(made.refracted, side < 0, side > 0)).all()
        assert made.refracted.any() == glass


def test_maps_and_geometry_are_interchangeable() -> None:
    environment = wall()
    near = DepthMesh(replace(environment, depth=np.full_like(environment.depth, 3.0)))
    backdrop = Backdrop(environment, near, environment.albedo * 0.5, environment.normals)
    view = placed(environment, MeshMaterial("mirror", (1.0,) * 3), lights=(replace(LIGHT, colour=np.zeros(3)),))
    frame = render_reference(quads(lying(0.5, 9.0, 1.0, 2.9)), view, backdrop=backdrop)
    np.testing.assert_allclose(frame.image[0, 5], environment.albedo[0, 5] * 0.1)
    assert frame.image[frame.object_mask & ~frame.outside][:, 2].max() == pytest.approx(0.05)
