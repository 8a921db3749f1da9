"""Rays through scenes of meshes: hits, limits, filters, batches, bad input."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from exact_rays import EXACT, mesh_of, outside_rays, plane_hits, rays_of, truth
from numpy.typing import NDArray

from colonnade import UserError
from colonnade.rays import Hits, Scene, Sensor
from colonnade.rays.device import RayBackend
from colonnade.rays.scene import ALL_DEVICE_MASKS, CULL_BACK, CULL_FRONT, FAN, OCCLUDED, OPAQUE_ONLY, RANGES, SENSOR

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
#: From above and from below through the first face of `SQUARE`.
DOWN, UP = [0.7, 0.2, 2, 0, 0, 0, -1, np.inf], [0.7, 0.2, -2, 0, 0, 0, 1, np.inf]
#: A batch's mode of all masks, and answers of 16 bytes.
MASKS = ALL_DEVICE_MASKS
ANSWER = np.dtype([("t", "f4"), ("id", "u4"), ("u", "f4"), ("v", "f4")])


def test_refined_hits_are_those_of_the_mesh_as_it_is() -> None:
    vertices, faces = mesh_of("torus")
    rays = outside_rays(vertices, 1500, seed=1)
    face, t = truth(vertices, faces, rays)
    hits = Scene(vertices, faces).closest(rays)
    assert (hits.face == face).mean() > 0.999
    same = (hits.face == face) & (face >= 0)
    assert same.sum() > 500
    assert np.abs(hits.t[same] - t[same]).max() < 1e-9
    corners = vertices[faces[hits.face[same]]]
    weights = np.column_stack([1 - hits.uv[same].sum(axis=1), hits.uv[same]])
    places = rays[same, :3] + hits.t[same, None] * rays[same, 4:7]
    assert np.abs((weights[:, :, None] * corners).sum(axis=1) - places).max() < 1e-9


@pytest.mark.parametrize("refine", (True, False))
def test_tnear_and_tfar_bound_the_hits_on_both_sides(refine: bool) -> None:
    vertices, faces = mesh_of("torus")
    scene = Scene(vertices, faces, refine=refine)
    rays = outside_rays(vertices, 400, seed=2)
    first = scene.closest(rays)
    rays, t = rays[first.face >= 0], first.t[first.face >= 0]
    face, step = first.face[first.face >= 0], 4 * scene.unit

    def with_limits(near: Any, far: Any) -> Hits:
        return scene.closest(rays_of(rays[:, :3], rays[:, 4:7], near, far))

    assert (with_limits(t - step, np.inf).face == face).all()
    assert (with_limits(0, t + step).face == face).all()
    assert (with_limits(0, t - step).face == -1).all()
    behind = with_limits(t + step, np.inf)
    assert (behind.t[behind.face >= 0] > (t + step)[behind.face >= 0]).all()
    assert (behind.face >= 0).mean() > 0.8
    assert not scene.occluded(rays_of(rays[:, :3], rays[:, 4:7], 0, t - step)).any()
    assert scene.occluded(rays_of(rays[:, :3], rays[:, 4:7], t - step, t + step)).all()


def test_sides_masks_opacity_and_switched_off_meshes_are_no_hits() -> None:
    scene = Scene(*SQUARE)
    below = scene.add(SQUARE[0] - [0, 0, 1], SQUARE[1][:, ::-1])
    rays = [DOWN, UP]
    assert scene.closest(rays).mesh.tolist() == [0, below]
    assert scene.closest(rays).is_back.tolist() == [False, False]
    assert scene.closest(rays, CULL_FRONT).mesh.tolist() == [below, 0]
    assert scene.closest(rays, CULL_FRONT).is_back.tolist() == [True, True]
    assert scene.closest(rays, CULL_FRONT | CULL_BACK).mesh.tolist() == [-1, -1]
    scene.set_opaque(0, [False, True])
    assert scene.closest(rays).is_opaque.tolist() == [False, True]
    assert scene.closest(rays, OPAQUE_ONLY).mesh.tolist() == [below, below]
    scene.set_mask(below, 2)
    assert scene.closest(rays, mask=4).mesh.tolist() == [0, 0]
    assert scene.occluded(rays, OPAQUE_ONLY, mask=4).tolist() == [False, False]
    assert scene.all(rays, mask=2).mesh.tolist() == [0, below, below, 0]
    scene.enable(below, False)
    assert scene.closest(rays).mesh.tolist() == [0, 0]
    scene.remove(0)
    assert scene.closest(rays).mesh.tolist() == [-1, -1]
    assert not scene.occluded(rays).any()


def test_equal_faces_of_either_side_are_all_hit() -> None:
    scene = Scene(SQUARE[0], np.concatenate([SQUARE[1], SQUARE[1][:, ::-1]]))
    assert sorted(scene.all([DOWN]).face) == [0, 2]
    assert scene.closest([DOWN, UP], CULL_BACK).face.tolist() == [0, 2]


@pytest.mark.parametrize("gap", (0, 1e-7, 1e-5, 1e-3))
@pytest.mark.parametrize("refine", (True, False))
def test_faces_of_one_place_are_all_hit(gap: float, refine: bool) -> None:
    """Decals: the grid rounds most of them to one plane, and only their vertices tell which one is first."""
    scene, random = Scene(refine=refine), np.random.default_rng(8)
    for level in range(10):
        scene.add(3 * SQUARE[0] - [*random.uniform(0.5, 1.5, 2), -gap * level], SQUARE[1])
    rays = rays_of(random.uniform(0, 1, (200, 2)) @ np.eye(2, 3) + [0, 0, 5], np.zeros((200, 3)) - [0, 0, 1], 0, np.inf)
    hits = scene.all(rays)
    assert (np.bincount(hits.ray, minlength=200) == 10).all()
    if refine and gap:
        assert (hits.mesh.reshape(200, 10) == np.arange(10)[::-1]).all()


def test_moved_vertices_move_the_hits() -> None:
    scene = Scene(*SQUARE)
    scene.update(0, SQUARE[0] + [0, 0, 0.5])
    assert scene.closest([DOWN]).t.tolist() == [1.5]


def test_all_hits_come_in_order() -> None:
    vertices, faces = mesh_of("torus")
    rays = outside_rays(vertices, 300, seed=3)
    t, least = plane_hits(vertices, faces, rays)
    wanted = [np.sort(row[(edge >= 0) & (row >= 0)].astype(float)) for row, edge in zip(t, least, strict=True)]
    hits = Scene(vertices, faces).all(rays)
    found = [hits.t[hits.ray == i] for i in range(len(rays))]
    equal = [len(a) == len(b) and np.allclose(a, b, atol=1e-9) for a, b in zip(found, wanted, strict=True)]
    assert np.mean(equal) > 0.995
    assert max(map(len, found)) == 4
    assert Scene(vertices, faces).all(rays, max_hits=1).t.tolist() == [row[0] for row in found if len(row)]


def test_far_origins_hit_as_near_ones_do() -> None:
    vertices, faces = mesh_of("torus")
    place = np.array([3000.0, 0, -800])
    scene = Scene(vertices + place, faces)
    near = outside_rays(vertices, 500, seed=4)
    near[:, :3] += place
    far = near.copy()
    far[:, :3] -= 50_000 * near[:, 4:7]
    one, other = scene.closest(near), scene.closest(far)
    assert (one.face == other.face).mean() > 0.995
    hit = (one.face == other.face) & (one.face >= 0)
    assert np.abs(other.t[hit] - one.t[hit] - 50_000).max() < 1e-6


def test_hits_behind_the_origin_count_from_a_negative_tnear() -> None:
    scene = Scene(*SQUARE)
    ray = [0.7, 0.2, -2, -np.inf, 0, 0, -1, np.inf]
    for near, face, t in ((-np.inf, 0, -2), (-2.5, 0, -2), (-1.5, -1, np.inf)):
        ray[3] = near
        hits = scene.closest([ray])
        assert (hits.face[0], hits.t[0]) == (face, t)
    assert scene.all([[*SQUARE[0][1], 0, 0, 0, -1, np.inf]]).t.tolist() == [0]


@pytest.mark.parametrize("settings", ((), EXACT))
def test_a_ray_hits_the_face_on_which_it_begins(settings: tuple[str, ...]) -> None:
    starts = np.random.default_rng(9).random((100, 2))
    for edge in (1e-4, 0.1, 1, 1e4):
        scene = Scene(edge * (SQUARE[0] + [0, 0, 0.3]), SQUARE[1], overrides=settings)
        scene.add(edge * (SQUARE[0] - [0, 0, 0.45]), SQUARE[1])
        above = edge * np.column_stack([starts, np.full(100, 0.3)])
        hits = scene.closest(rays_of(above, np.zeros((100, 3)) - [0, 0, 1], 0, np.inf))
        assert (hits.mesh == 0).all()
        assert (hits.t == 0).all()


def test_rays_of_no_number_miss() -> None:
    scene = Scene(*SQUARE)
    bad = np.array([DOWN] * 8)
    bad[0, 0], bad[1, 5], bad[2, 4:7], bad[3, 3:8:4] = np.nan, np.inf, 0, (3, 1)
    bad[4, 7], bad[5, 3], bad[6, 7], bad[7, 2] = -1, np.nan, np.nan, -np.inf
    hits = scene.closest(bad)
    assert (hits.face == -1).all()
    assert (hits.uv == 0).all()
    assert np.array_equal(hits.t, bad[:, 7], equal_nan=True)
    assert not scene.occluded(bad).any()
    assert scene.all(bad).face.size == 0
    assert scene.counters()["raysRefused"] >= len(bad)


@pytest.mark.parametrize("scale", (1e-30, 1e30))
def test_directions_of_any_length(scale: float) -> None:
    scene = Scene(*SQUARE)
    ray = np.array([DOWN])
    ray[0, 4:7] *= scale
    assert scene.closest(ray).t[0] == pytest.approx(2 / scale)


def test_batches_answer_alike_in_every_form() -> None:
    """Whole records, fans, ranges and bits; several threads, as a batch has thousands of rays."""
    vertices, faces = mesh_of("torus")
    scene = Scene(vertices, faces, refine=False)
    scene.closest([DOWN])
    rays = outside_rays(vertices, 3001, seed=5)
    rays[:, :3] = rays[0, :3]
    records = rays.astype(np.float32)

    def submit(part: Any, mode: int, *of_fan: Any) -> Any:
        return scene.submit(part, len(part), mode, *of_fan)

    hits = submit(records, MASKS).view(ANSWER)
    assert (hits == np.concatenate([submit(part, MASKS).view(ANSWER) for part in np.array_split(records, 50)])).all()
    fan = submit(np.ascontiguousarray(records[:, 4:]), MASKS | FAN, records[0, :3], 0.0).view(ANSWER)
    assert (fan == hits).all()
    assert (submit(records, MASKS | RANGES).view([("t", "f4"), ("id", "u4")]) == hits[["t", "id"]]).all()
    bits = np.unpackbits(submit(records, MASKS | OCCLUDED), bitorder="little")
    assert (bits[: len(rays)] == (hits["id"] != 0xFFFFFFFF)).all()
    assert not bits[len(rays) :].any()
    face = scene.closest(records).face
    assert [scene._rays.face(int(i) & 0xFFFFFF)[1] for i in hits["id"][face >= 0]] == face[face >= 0].tolist()


def test_batches_that_are_none_are_refused() -> None:
    scene = Scene(*SQUARE)
    scene.closest([DOWN])
    for records, mode in (((1, 8), MASKS | 3), ((1, 8), MASKS | 1 << 6), ((0, 8), MASKS)):
        with pytest.raises(UserError, match="unknown mode"):
            scene.submit(np.zeros(records, np.float32), records[0], mode)
    with pytest.raises(UserError, match="Python objects"):
        scene.submit(np.zeros((1, 8), object), 1, MASKS)


def test_a_sensor_makes_the_rays_of_a_fan() -> None:
    """Sums of any bits, also if they wrap; rows that end in the middle of a thread's rays."""
    scene, random = Scene(*mesh_of("torus"), refine=False), np.random.default_rng(3)
    for width, count in ((64, 130), (1024, 4500)):
        corner, right, down = units = random.integers(0, 1 << 32, size=(3, 3))
        at = np.arange(count)[:, None]
        sums = (corner + at % width * right + at // width * down) & 0xFFFFFFFF
        ways = sums.astype(np.uint32).view(np.int32).astype(np.float32) * np.float32(2.0**-30)
        record = np.array([*units.ravel(), width, *[0] * 6], np.uint32)
        fan = np.column_stack([ways, np.full(count, 9, np.float32)])
        origin = [0.1, 0.2, 0.3]
        wanted = scene.submit(fan, count, MASKS | FAN, origin, 0.125)
        assert (scene.submit(record, count, MASKS | SENSOR, origin, 0.125, 9) == wanted).all()
        assert (wanted.view(ANSWER)["id"] != 0xFFFFFFFF).any()


def test_ranges_of_a_sensor_are_those_of_its_rays() -> None:
    scene = Scene(*mesh_of("torus"), refine=False)
    sensor = Sensor((0, 0, 5), (-3, 2, -10), (0.06, 0, 0), (0, -0.05, 0), 100, 80)
    y, x = np.mgrid[:80, :100, :1][:2]
    ways = np.array(sensor.corner) + x * np.array(sensor.right) + y * np.array(sensor.down)
    wanted = scene.closest(rays_of(np.zeros((8000, 3)) + sensor.origin, ways.reshape(-1, 3), 0, np.inf))
    ranges = scene.ranges(sensor).ravel()
    hits = np.isfinite(ranges) & (wanted.face >= 0)
    assert (np.isfinite(ranges) == (wanted.face >= 0)).mean() > 0.999
    assert 0.1 < hits.mean() < 0.9
    assert np.median(np.abs(ranges[hits] - wanted.t[hits])) < 1e-5


@pytest.mark.parametrize(
    ("changes", "message"),
    (({"right": (0, np.nan, 0)}, "not finite"), ({"width": 0}, "0 x 4 rays"), ({"origin": (100, 0, 0)}, "16 edges")),
)
def test_sensors_that_are_none_are_refused(changes: dict[str, Any], message: str) -> None:
    given = {"origin": (0, 0, 1), "corner": (0, 0, -1), "right": (1, 0, 0), "down": (0, 1, 0), "width": 3, "height": 4}
    with pytest.raises(UserError, match=message):
        Scene(*SQUARE).ranges(Sensor(**(given | changes)))


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    (
        ([[0, 0, 0], [1, 0, np.nan], [0, 1, 0]], [[0, 1, 2]], "vertex 1 is not finite"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 3]], "face 0 names vertex 3 of 3"),
        ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], "no face of the mesh has an area"),
        ([[0, 0, 0], [1, 0, 0], [1, 1e-9, 0]], [[0, 1, 2]], "no face keeps an area at 16 bits"),
        ([[1e9, 0, 0], [1e9 + 1e-6, 0, 0], [1e9, 1e-6, 0]], [[0, 1, 2]], "too far from the origin for its size"),
        ([[0, 0], [1, 1]], [[0, 1, 2]], "give [n, 3]"),
    ),
)
def test_wrong_meshes_are_refused(vertices: Any, faces: Any, message: str) -> None:
    with pytest.raises(UserError) as error:
        Scene(vertices, faces, "edge").closest([DOWN])
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("count", (0, 3, 5))
def test_arrays_of_another_length_than_the_mesh_are_refused(count: int) -> None:
    """They would be read beyond their end."""
    scene = Scene(*SQUARE)
    with pytest.raises(UserError, match=f"the mesh has 4 vertices, {count} are given"):
        scene.update(0, np.resize(SQUARE[0], (count, 3)))
    with pytest.raises(UserError, match=f"the mesh has 2 faces, {count} are given"):
        scene.set_opaque(0, np.ones(count, bool))
    assert scene.closest([DOWN]).t.tolist() == [2] and scene.closest([DOWN]).is_opaque.all()


class Answers(RayBackend):
    """Answers each batch with the same bytes."""

    def __init__(self, answer: bytes) -> None:
        self.answer, self.scene = answer, None

    def load(self, values: Mapping[str, int], records: bytes, count: int) -> None:
        pass

    def submit(self, batch: bytes, rays: bytes, size: int) -> tuple[int, bytes]:
        if self.scene:
            self.scene.closest([DOWN])
        return 1, self.answer

    def counters(self) -> dict[str, int]:
        return {}


@pytest.mark.parametrize("size", (0, 15, 17, 1 << 20))
def test_a_device_that_answers_other_bytes_than_it_is_asked_for_is_refused(size: int) -> None:
    with pytest.raises(UserError, match=f"the device answers {size} bytes in place of 16"):
        Scene(*SQUARE, backend=Answers(bytes(size))).closest([DOWN])


@pytest.mark.parametrize("answer", [None, (0,), (0, None), ("x", bytes(16)), (1 << 32, bytes(16)), (0, bytes(16), 0)])
def test_a_device_that_answers_with_other_types_is_refused(answer: object) -> None:
    class Device(Answers):
        def submit(self, *batch: object) -> Any:
            return answer

    with pytest.raises(UserError, match="must answer a batch with a tag of 32 bits and bytes"):
        Scene(*SQUARE, backend=Device(b"")).closest([DOWN])


def test_a_device_that_asks_its_own_scene_is_told() -> None:
    device = Answers(bytes(16))
    scene = device.scene = Scene(*SQUARE, backend=device)
    with pytest.raises(RuntimeError, match="it would wait for itself"):
        scene.closest([DOWN])
    device.scene = None


@pytest.mark.parametrize(
    ("call", "message"),
    (
        (lambda scene: scene.closest([DOWN], mode=RANGES), "other bits than those of CULL_FRONT"),
        (lambda scene: scene.closest([DOWN], mode="none"), "mode is 'none'"),
        (lambda scene: scene.closest([DOWN], mask=-1), "mask is -1: give 0 to 4294967295"),
        (lambda scene: scene.occluded([DOWN], mask=1 << 32), "mask is 4294967296"),
        (lambda scene: scene.ranges(Sensor((0, 0, 1), (0, 0, -1), (1, 0, 0), (0, 1, 0), 3, 4), mask=256), "0 to 255"),
        (lambda scene: scene.all([DOWN], max_hits=-1), "max_hits is -1"),
        (lambda scene: scene.set_mask(0, 1 << 40), "mask is"),
        (lambda scene: scene.remove(-1), "mesh is -1"),
        (lambda scene: scene.set_opaque(0, [[True, False]]), "no list of Booleans"),
        (lambda scene: scene.set_opaque(0, ["yes", "no"]), "no list of Booleans"),
        (lambda scene: scene.update(0, SQUARE[0] + 1j), "no array of numbers"),
        (lambda scene: scene.submit(np.zeros((1, 8), np.float32), 1, MASKS, "nowhere"), "origin are no array"),
    ),
)
def test_wrong_arguments_are_refused_in_a_line(call: Callable[[Scene], Any], message: str) -> None:
    scene = Scene(*SQUARE)
    with pytest.raises(UserError, match=message):
        call(scene)
    assert scene.closest([DOWN]).t.tolist() == [2]


@pytest.mark.parametrize("count", (3, 9, 12))
def test_masks_have_32_bits(count: int) -> None:
    """Also of more sets of meshes than a device has bits, 8."""
    scene, random = Scene(), np.random.default_rng(count)
    masks = random.integers(1 << 32, size=count, dtype=np.uint32) & random.integers(
        1 << 32, size=count, dtype=np.uint32
    )
    for level, mask in enumerate(masks):
        scene.set_mask(scene.add(SQUARE[0] - [0, 0, level], SQUARE[1]), int(mask))
    for refine in (True, False):
        scene._rays.refine(refine)
        for mask in (*(1 << bit for bit in range(32)), 0, 0xFFFFFFFF, int(masks[0]), 0xFF00):
            meant = [level for level in range(count) if int(masks[level]) & mask]
            hits = scene.closest([DOWN], mask=mask)
            assert hits.mesh.tolist() == (meant[:1] or [-1])
            assert scene.occluded([DOWN], mask=mask).tolist() == [bool(meant)]
            assert scene.all([DOWN], mask=mask).mesh.tolist() == meant


def with_far_triangle(distance: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """A torus and a triangle so far away, as a stray vertex of a scan makes one."""
    vertices, faces = mesh_of("torus")
    far = distance * np.array([[1, 0, 0], [1.001, 0, 0], [1, 0.001, 0]])
    return np.vstack([vertices, far]), np.vstack([faces, len(vertices) + np.arange(3)])


def test_a_scene_gets_the_bits_that_it_needs_or_is_refused() -> None:
    """Faces that a grid drops are counted, and told."""
    rays = outside_rays(mesh_of("torus")[0], 300, seed=1)
    wanted = Scene(*mesh_of("torus")).closest(rays).face
    vertices, faces = with_far_triangle(1e4)
    with pytest.raises(UserError, match=r"faces vanish at 16 bits a coordinate: use a design with more, or leave out"):
        Scene(vertices, faces, "edge").closest(rays)
    scene = Scene(vertices, faces)
    assert scene.unit < 1e4 / 2**23
    assert (scene.closest(rays).face == wanted).mean() > 0.99
    with pytest.raises(UserError, match=r"24 bits a coordinate: leave out what widens the box"):
        Scene(*with_far_triangle(1e8)).closest(rays)


def test_slivers_that_vanish_are_told_and_refuse_no_scene() -> None:
    """As of exported solids; a design of more bits is taken, if there is a choice."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0, -1 - 1e-7, 0]])
    mesh = corners, np.array([[0, 1, 2], [0, 2, 3], [0, 4, 1]])
    assert Scene(*mesh).dropped == 0
    scene = Scene(*mesh, "edge")
    with pytest.warns(UserWarning, match="1 face vanishes on the design's grid"):
        assert scene.closest([DOWN]).face[0] >= 0


def test_faces_that_vanish_are_told() -> None:
    vertices, faces = mesh_of("sphere:4")
    thin = np.array([[0, 0, 0], [1, 0, 0], [1, 1e-9, 0]])
    scene = Scene(np.vstack([vertices, thin]), np.vstack([faces, len(vertices) + np.arange(3), [0, 0, 1]]))
    with pytest.warns(UserWarning, match="1 face vanishes on the design's grid"):
        scene.closest([DOWN])
    assert scene.dropped == 1
    assert Scene(*SQUARE).dropped == 0


def test_lines_at_the_poles_of_a_sphere_are_no_faces() -> None:
    """A row of 64 faces has corners that only the rounding of a sine tells apart."""
    down, around = np.meshgrid(np.linspace(0, np.pi, 17), np.linspace(0, 2 * np.pi, 64, endpoint=False), indexing="ij")
    vertices = np.stack([np.sin(down) * np.cos(around), np.sin(down) * np.sin(around), np.cos(down)], axis=2)
    at = np.arange(17 * 64).reshape(17, 64)
    corners = at[:-1], np.roll(at[:-1], -1, axis=1), at[1:], np.roll(at[1:], -1, axis=1)
    first, second, third, fourth = (each.ravel() for each in corners)
    faces = np.concatenate([np.column_stack([first, third, fourth]), np.column_stack([first, fourth, second])])
    scene = Scene(vertices.reshape(-1, 3), faces, "edge")
    assert scene.dropped == 0
    assert scene.closest([[0.1, 0.2, 5, 0, 0, 0, -1, np.inf]]).face[0] >= 0


@pytest.mark.parametrize(("distance", "length"), ((1e9, 1), (4e11, 1), (3, 1e200), (3, 1e-200), (1e15, 1e-30)))
@pytest.mark.parametrize("settings", ((), EXACT))
def test_all_hits_end_where_a_step_is_below_a_digit(distance: float, length: float, settings: tuple[str, ...]) -> None:
    vertices, faces = mesh_of("sphere:3")
    scene = Scene(vertices, faces, "edge", settings)
    ray = [0.1, 0.2, distance, 0, 0, 0, -length, np.inf]
    hits = scene.all([ray])
    assert len(hits.t) == 2 if distance < 1e12 else len(hits.t) <= 2
    assert scene.closest([ray]).face[0] == hits.face[0]


def test_origins_beyond_all_numbers_miss() -> None:
    rays = np.array([DOWN] * 4)
    rays[0, 2], rays[1, 0], rays[2, :3], rays[3, 4:7] = 1e208, -1e300, 1e308, 1e-320
    hits = Scene(*SQUARE).closest(rays)
    assert np.isfinite(hits.uv).all() and not np.isnan(hits.t).any()


def test_rays_are_occluded_where_they_have_a_closest_hit() -> None:
    """Slivers: what the device hits is often beside them."""
    random = np.random.default_rng(5)
    start = random.uniform(-1, 1, (200, 1, 3))
    ends = start + random.normal(size=(200, 1, 3)) + random.normal(size=(200, 2, 3)) * 1e-3
    vertices = np.concatenate([start, ends], axis=1).reshape(-1, 3)
    scene = Scene(vertices, np.arange(600).reshape(-1, 3), "edge")
    rays = rays_of(
        random.normal(size=(4000, 3)) * 3, vertices.reshape(-1, 3, 3)[random.integers(200, size=4000)].mean(axis=1)
    )
    rays[:, 4:7] -= rays[:, :3]
    found = scene.closest(rays).face >= 0
    assert 0.2 < found.mean() < 1
    assert (scene.occluded(rays) == found).all()


def test_scenes_beyond_the_design_are_refused() -> None:
    vertices, faces = mesh_of("torus")
    with pytest.raises(UserError, match="records, the design has 64"):
        Scene(vertices, faces, "tiny", ("columnBvhMemory.depth=64",)).closest([DOWN])


def test_an_order_keeps_near_rays_together() -> None:
    vertices, faces = mesh_of("torus")
    scene, rays = Scene(vertices, faces), outside_rays(vertices, 4000, seed=6, distance=0.4)
    order = scene.order(rays)
    assert sorted(order) == list(range(len(rays)))
    gaps = [np.linalg.norm(np.diff(rays[o, :3], axis=0), axis=1).mean() for o in (order, np.arange(len(rays)))]
    assert gaps[0] < gaps[1] / 5


def leaks(count: int, config: str, overrides: tuple[str, ...] = ()) -> int:
    """Rays from inside a sphere to its vertices and to places on its edges that miss it."""
    vertices, faces = mesh_of("sphere:4")
    random = np.random.default_rng(7)
    corners = vertices[faces[random.integers(len(faces), size=count)]]
    share = random.choice([0, 0.25, 0.5, 1 / 3], size=(count, 1))
    start = (random.random((count, 3)) - 0.5) * 0.4 * np.ptp(vertices, axis=0) + vertices.mean(axis=0)
    rays = rays_of(start, corners[:, 0] + share * (corners[:, 1] - corners[:, 0]) - start)
    scene = Scene(vertices, faces, config, overrides)
    assert not (~scene.occluded(rays)).any()
    return int((scene.closest(rays).face < 0).sum())


@pytest.mark.parametrize("config", ("edge", "16b16s32d"))
def test_a_closed_mesh_has_no_leaks(config: str) -> None:
    assert leaks(20_000, config) == 0


@pytest.mark.matrix
@pytest.mark.parametrize("overrides", ((), EXACT))
def test_a_closed_mesh_has_no_leaks_in_a_million_rays(overrides: tuple[str, ...]) -> None:
    assert leaks(1_000_000, "edge", overrides) == 0


@pytest.mark.parametrize(("settings", "share"), (((), 2e-4), (EXACT, 1e-5)))
def test_few_rays_that_begin_on_a_closed_mesh_and_go_in_leave_it(settings: tuple[str, ...], share: float) -> None:
    """Only such as stay within some units of the face on which they begin, as far as it goes."""
    random = np.random.default_rng(1)
    for name in ("sphere:4", "torus"):
        vertices, faces = mesh_of(name)
        corners = vertices[faces]
        inward = -np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        inward /= np.linalg.norm(inward, axis=1, keepdims=True)
        extent = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        face = random.integers(len(faces), size=100_000)
        way = random.normal(size=(len(face), 3))
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        cosine = (way * inward[face]).sum(axis=1)
        way[cosine < 0] *= -1
        scene = Scene(vertices, faces, "edge", settings)
        leaves = scene.closest(rays_of(corners.mean(axis=1)[face], way, 1e-4, np.inf)).face < 0
        assert leaves.mean() <= share
        assert (np.abs(cosine) * extent[face] < 4 * scene.unit)[leaves].all()
