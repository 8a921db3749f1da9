"""The reference renderer against hand calculations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from colonnade.mesh.load import clean_mesh, load_mesh
from colonnade.mesh.materials.materials import MeshMaterial
from colonnade.mesh.materials.mesh import Mesh
from colonnade.reference.render import primary_directions, render_reference
from colonnade.scene.view import PlacedLight, View

GREY = np.array([0.5, 0.5, 0.5])


def looking_down(width: int = 24, height: int = 16, distance: float = 4.0) -> View:
    """A camera on the z axis that sees 2 by 2 mesh units around the origin, with a light beside it."""
    step_x = np.array([2.0 / width / distance, 0.0, 0.0])
    step_y = np.array([0.0, -2.0 / height / distance, 0.0])
    centre = np.array([0.0, 0.0, -1.0])
    return View(
        width=width,
        height=height,
        origin=np.array([0.0, 0.0, distance]),
        direction=centre - step_x * (width - 1) / 2 - step_y * (height - 1) / 2,
        step_x=step_x,
        step_y=step_y,
        lights=(PlacedLight(np.array([0.0, 0.0, distance]), np.ones(3)),),
        materials=(MeshMaterial(albedo=(0.5, 0.5, 0.5)),),
        ambient=np.full(3, 0.25),
        background=np.array([0.0, 0.1, 0.2]),
        flat=True,
        shadows=True,
    )


def square(z: float, edge: float, turned: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a square that faces +z, or -z if turned."""
    half = edge / 2
    corners = np.array([[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    return corners, faces[:, ::-1] if turned else faces


def mesh_of(*parts: tuple[np.ndarray, np.ndarray]) -> Mesh:
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts[:-1])])
    vertices = np.concatenate([vertices for vertices, _ in parts])
    faces = np.concatenate([faces + start for (_, faces), start in zip(parts, starts, strict=True)])
    return clean_mesh(vertices, faces.astype(np.int32), name="test")


def slabs(view: View, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Entry t of the rays of all pixels into a box, NaN for a miss, float64 [height, width]."""
    directions = primary_directions(view, slice(0, view.height))
    with np.errstate(divide="ignore"):
        planes = np.stack([(plane - view.origin) / directions for plane in (low, high)])
    near, far = planes.min(axis=0).max(axis=1), planes.max(axis=0).min(axis=1)
    return np.where(near <= far, near, np.nan).reshape(view.height, view.width)


@pytest.mark.parametrize("position", [(3.0, 2.0, 4.0), (0.3, -5.0, 0.2), (200.0, 150.0, 300.0)])
def test_a_cube_is_hit_at_its_slabs(position: tuple[float, float, float]) -> None:
    mesh = load_mesh("cube")
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    origin, centre = np.array(position) + (low + high) / 2, (low + high) / 2
    toward = centre - origin
    right = np.cross(toward, [0.1, 1.0, 0.2])
    right *= 3.0 / 40 * np.abs(high - low).max() / np.linalg.norm(right)
    up = np.cross(right, toward)
    up *= np.linalg.norm(right) / np.linalg.norm(up)
    view = replace(
        looking_down(40, 40), origin=origin, direction=toward - 19.5 * right + 19.5 * up, step_x=right, step_y=-up
    )
    expected = slabs(view, low, high)
    frame = render_reference(mesh, view)
    np.testing.assert_array_equal(frame.object_mask, ~np.isnan(expected))
    assert frame.object_mask.any() and not frame.object_mask.all()
    np.testing.assert_allclose(frame.t, expected, rtol=1e-12)
    assert frame.rays["primary"] == 1600
    assert frame.rays["in_box"] >= np.count_nonzero(frame.object_mask)


def test_a_lit_square_follows_lamberts_law() -> None:
    view = looking_down()
    frame = render_reference(mesh_of(square(0.0, 1.0)), view)
    assert set(np.unique(frame.hit_triangles)) == {-1, 0, 1}
    np.testing.assert_allclose(frame.image[0, 0], view.background)
    directions = primary_directions(view, slice(0, view.height)).reshape(view.height, view.width, 3)
    height = view.light[2]
    across = directions[8, 12, :2] * 4.0
    cosine = height / np.hypot(height, np.linalg.norm(across))
    np.testing.assert_allclose(frame.image[8, 12], GREY * (0.25 + cosine), rtol=1e-6)
    assert frame.rays["shadow"] == np.count_nonzero(frame.object_mask)


def test_both_sides_of_a_surface_look_alike() -> None:
    view = looking_down()
    for flat in (True, False):
        front, back = (
            render_reference(mesh_of(square(0.0, 1.0, turned)), replace(view, flat=flat)) for turned in (False, True)
        )
        np.testing.assert_allclose(front.image, back.image, rtol=1e-12)


def test_light_behind_the_surface_sends_no_shadow_ray() -> None:
    view = replace(looking_down(), lights=(PlacedLight(np.array([0.0, 0.0, -3.0]), np.ones(3)),))
    frame = render_reference(mesh_of(square(0.0, 1.0)), view)
    assert frame.rays["shadow"] == 0
    np.testing.assert_allclose(frame.image[8, 12], GREY * 0.25)


def test_a_plate_shades_the_floor_and_only_with_shadows_on() -> None:
    mesh = mesh_of(square(0.0, 1.6), square(0.5, 0.2))
    view = replace(looking_down(64, 64), lights=(PlacedLight(np.array([1.2, 0.0, 1.4]), np.ones(3)),))
    shaded, bright = render_reference(mesh, view), render_reference(mesh, replace(view, shadows=False))
    # The ray from (x, y, 0) to the light passes z = 0.5 at x + (1.2 - x) * 0.5 / 1.4.
    directions = primary_directions(view, slice(0, 64)).reshape(64, 64, 3)
    floor = view.origin[:2] + 4.0 * directions[..., :2]
    crossing = floor + (view.light[:2] - floor) * (0.5 / 1.4)
    edge_distance = np.abs(np.abs(crossing).max(axis=2) - 0.1)
    sure = (shaded.t > 3.9) & (edge_distance > 0.01)
    expected = np.abs(crossing).max(axis=2) < 0.1
    np.testing.assert_array_equal((shaded.image[..., 0] < bright.image[..., 0])[sure], expected[sure])
    assert expected[sure].any()
    assert bright.rays["shadow"] == 0


def test_a_light_between_surface_and_plate_is_not_blocked_by_the_plate() -> None:
    mesh = mesh_of(square(0.0, 1.6), square(0.9, 0.2))
    view = replace(looking_down(), lights=(PlacedLight(np.array([0.3, 0.0, 0.5]), np.ones(3)),))
    shaded, bright = render_reference(mesh, view), render_reference(mesh, replace(view, shadows=False))
    np.testing.assert_array_equal(shaded.image, bright.image)


def test_colours_saturate() -> None:
    view = replace(looking_down(), lights=(PlacedLight(np.array([0.0, 0.0, 4.0]), np.full(3, 9.0)),))
    assert render_reference(mesh_of(square(0.0, 1.0)), view).image.max() == 1.0


def test_smooth_normals_differ_from_flat_ones_and_vary_within_a_triangle() -> None:
    mesh = load_mesh("sphere:1")
    view = looking_down(48, 48)
    lights = (PlacedLight(np.array([3.0, 2.0, 4.0]), np.ones(3)),)
    flat, smooth = (render_reference(mesh, replace(view, flat=flag, lights=lights)) for flag in (True, False))
    inside = flat.hit_triangles == flat.hit_triangles[24, 24]
    assert np.ptp(smooth.image[inside, 0]) > 4 * np.ptp(flat.image[inside, 0])


def test_no_ray_slips_out_of_a_closed_mesh() -> None:
    mesh = load_mesh("sphere:3")
    view = replace(looking_down(200, 200, distance=0.01), lights=(PlacedLight(np.array([0.1, 0.2, 0.3]), np.ones(3)),))
    frame = render_reference(mesh, view)
    assert frame.object_mask.all()


def test_faces_are_numbered_as_in_the_source() -> None:
    vertices, faces = square(0.0, 1.0)
    degenerate = np.array([[0, 0, 1], [2, 2, 2]], dtype=np.int32)
    mesh = clean_mesh(vertices, np.concatenate([degenerate, faces]), name="test")
    frame = render_reference(mesh, looking_down())
    assert set(np.unique(frame.hit_triangles)) == {-1, 2, 3}


def test_frames_larger_than_a_batch_are_whole() -> None:
    wide = looking_down(70_000, 3)
    frame = render_reference(mesh_of(square(0.0, 1.0)), wide)
    np.testing.assert_array_equal(frame.object_mask, ~np.isnan(frame.t))
    assert frame.object_mask[1].mean() == pytest.approx(0.5, abs=1e-3)
