"""Encoded planes: exact bits, correct geometry, and accurate surfaces of rooms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from colonnade.common import cache
from colonnade.common.errors import UserError
from colonnade.environment.load import load_environment
from colonnade.environment.model import Environment, EnvironmentCamera
from colonnade.maps import image as maps_image
from colonnade.maps.cache import encoded_environment
from colonnade.maps.image import AttributeImage, encode_environment
from colonnade.maps.layout import AttributeLayout
from colonnade.maps.plane_encoder import encode_planes
from colonnade.maps.plane_map import PLANE_MODES, PlaneMap
from colonnade.maps.planes import PlaneProjection, pack_planes, unpack_planes
from colonnade.maps.quality import ray_errors
from colonnade.maps.vectors import unpack

ROOMS = Path(__file__).resolve().parents[3] / "scenes" / "rooms"
LEVEL = np.array([[1.0, 0, 0, 0], [0, -1.0, 0, 1.2], [0, 0, -1.0, 0]])


def boxes(width: int = 160, height: int = 120, steps: bool = True) -> Environment:
    """A box room, 4 m deep, 3 m wide and 2.4 m high, with a slanted board; a level camera 1.2 m above the floor."""
    camera = EnvironmentCamera(120.0, 120.0, width / 2 + 3, height / 2 - 2, LEVEL)
    rays = camera.directions(width, height)
    normals = np.array([[0.0, 0, -1], [0, -1, 0], [0, 1, 0], [1, 0, 0], [-1, 0, 0]])
    distances = np.array([4.0, 1.2, 1.2, 1.5, 1.5])
    along = rays @ -normals.T
    with np.errstate(divide="ignore"):
        depth = np.where(along > 1e-9, distances / along, np.inf)
    which = depth.argmin(axis=2)
    depth = depth.min(axis=2)
    albedo = np.array([[0.5, 0.5, 0.5], [0.4, 0.2, 0.1], [0.9, 0.9, 0.9], [0.2, 0.5, 0.2], [0.2, 0.2, 0.5]])[which]
    facing = normals[which]
    if steps:
        board = (np.abs(rays[..., 0]) < 0.2) & (np.abs(rays[..., 1]) < 0.15)
        slanted = 0.8 / (0.6 * rays[..., 0] + 0.8)
        depth, facing = np.where(board, slanted, depth), np.where(board[..., np.newaxis], [-0.6, 0.0, -0.8], facing)
        albedo = np.where(board[..., np.newaxis], [0.9, 0.1, 0.1], albedo)
    return Environment("boxes", albedo, facing, depth, True, camera, None)


@given(st.tuples(*[st.floats(-4000, 4000, allow_subnormal=False)] * 3), st.integers(0, 30))
def test_planes_take_the_least_exponent(values: tuple[float, float, float], shrink: int) -> None:
    plane = np.ldexp(np.array([values]), -shrink)
    words = pack_planes(plane)
    exponent = int(words[0]) >> 60
    assert np.abs(unpack_planes(words) - plane).max() <= 2.0 ** (exponent - 23)
    finer = np.rint(np.ldexp(plane, 22 - exponent + 1))
    assert exponent == 0 or finer.max() >= 1 << 19 or finer.min() < -(1 << 19)


def test_the_bits_of_a_plane() -> None:
    assert int(pack_planes(np.array([[1.0, -0.5, 0.25]]))[0]) == 4 << 60 | 1 << 56 | 0xE0000 << 20 | 1 << 18
    assert int(pack_planes(np.zeros((1, 3)))[0]) == 0


def test_planes_of_space_and_picture() -> None:
    environment = boxes(steps=False)
    projection = PlaneProjection.of(environment, 0.8)
    points = environment.points()
    rows, columns = np.array([100, 60, 5]), np.array([80, 81, 70])
    planes = projection.planes(environment.normals[rows, columns], points[rows, columns])
    w = projection.basis()[rows, columns]
    assert np.allclose(np.einsum("nc,nc->n", planes, w), 0.8 / environment.depth[rows, columns])
    assert np.allclose(projection.normals(planes), environment.normals[rows, columns])
    assert np.allclose(np.einsum("nc,nc->n", projection.dual_vectors(planes), points[rows, columns]), 1.0)


@pytest.mark.parametrize(("width", "height", "tile"), [(160, 120, 16), (170, 101, 16), (100, 90, 8), (150, 100, 32)])
def test_flat_walls_are_where_they_were(width: int, height: int, tile: int) -> None:
    environment = boxes(width, height)
    layout = AttributeLayout(width, height, tile_size=tile)
    content = encode_planes(environment, layout)
    errors = ray_errors(environment, content.depth(layout, PlaneProjection.of(environment, content.depth_unit)))
    # Cells of two pixels or more contain corners of the walls and the edge of the board
    assert np.median(errors) < 0.0005
    assert np.mean(errors > 0.01) < 0.06
    w = content.inverse_depth(layout, PlaneProjection.of(environment, content.depth_unit))
    assert w.max() < 1.01


def slow_id(content: PlaneMap, u: int, v: int, layout: AttributeLayout) -> int:
    """The plane id of a pixel, decoded from the words by the documentation."""
    descriptor = int(content.descriptors[v // layout.tile_size * layout.tile_columns + u // layout.tile_size])
    number, pointer = descriptor % 8, descriptor // 8
    if number == 0:
        return pointer
    count, cells = ((2, 4), (2, 8), (4, 4), (4, 8), (2, 16), (4, 16))[number - 1]
    heap = [int(word) for word in content.heap]
    ids = [heap[pointer] & 255, heap[pointer] >> 8]
    if count == 4:
        ids += [heap[pointer + 1] & 255, heap[pointer + 1] >> 8]
    edge = layout.tile_size // cells
    cell = v % layout.tile_size // edge * cells + u % layout.tile_size // edge
    place = cell * (count // 2)
    return ids[heap[pointer + count // 2 + place // 16] >> place % 16 & (count - 1)]


def bumps(width: int, height: int) -> Environment:
    """Many small steps and slopes, which give tiles of all kinds."""
    environment = boxes(width, height)
    v, u = np.mgrid[:height, :width]
    depth = environment.depth * (1 - 0.3 * ((u // 7 + v // 5) % 3 == 0) * (u > width // 2))
    return Environment("bumps", environment.albedo, environment.normals, depth, True, environment.camera, None)


@pytest.mark.parametrize(
    ("plane_bytes", "tile_size"), [(3000, 16), pytest.param(8192, 16, marks=pytest.mark.matrix), (4000, 8)]
)
def test_random_access_follows_the_words(plane_bytes: int, tile_size: int) -> None:
    layout = AttributeLayout(150, 110, plane_bytes=plane_bytes, tile_size=tile_size)
    content = encode_planes(bumps(150, 110), layout)
    v, u = np.mgrid[:110, :150]
    ids = content.ids_at(u, v, layout)
    assert np.array_equal(ids.ravel(), [slow_id(content, x, y, layout) for y in range(110) for x in range(150)])
    sizes = np.array([mode.words for mode in PLANE_MODES])
    assert list(sizes) == [0, 2, 5, 4, 10, 17, 34]
    number, pointer = content.descriptors & 7, content.descriptors >> 3
    assert (pointer + sizes[number])[number > 0].max() <= layout.plane_heap_words
    assert int(content.planes[layout.infinite_plane]) == 0
    # No cell is smaller than a pixel
    assert (content.descriptors & 7).max() in ((5, 6) if tile_size == 16 else (3, 4))


def bounding_fields(content: PlaneMap) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Planes, albedos and normals of the used bounding planes."""
    entries = [sum(int(part) << (64 * k) for k, part in enumerate(words)) for words in content.bounding if words.any()]
    planes = unpack_planes(np.array([entry & (1 << 64) - 1 for entry in entries], np.uint64))
    albedos = unpack(np.array([entry >> 64 & (1 << 36) - 1 for entry in entries], np.uint64), 12, signed=False)
    normals = unpack(np.array([entry >> 100 & (1 << 36) - 1 for entry in entries], np.uint64), 12, signed=True)
    assert all(entry < 1 << 136 for entry in entries)
    return planes, albedos / 4095, normals / 2047


def test_bounding_planes_are_the_box_and_a_wall_behind() -> None:
    environment = boxes(320, 240)
    layout = AttributeLayout(320, 240)
    content = encode_planes(environment, layout)
    planes, albedos, normals = bounding_fields(content)
    projection = PlaneProjection.of(environment, content.depth_unit)
    expected = {
        (0, 0, 1): (0.5, environment.albedo.mean(axis=(0, 1))),
        (0, 0, -1): (4.0, [0.5, 0.5, 0.5]),
        (0, -1, 0): (1.2, [0.4, 0.2, 0.1]),
        (0, 1, 0): (1.2, [0.9, 0.9, 0.9]),
        (1, 0, 0): (1.5, [0.2, 0.5, 0.2]),
        (-1, 0, 0): (1.5, [0.2, 0.2, 0.5]),
    }
    assert len(planes) == len(expected)
    q = projection.dual_vectors(planes)
    for plane, albedo, normal in zip(q, albedos, normals, strict=True):
        distance, colour = expected[tuple(int(x) for x in np.rint(normal))]  # type: ignore[index]
        assert np.abs(normal - np.rint(normal)).max() < 0.01
        assert abs(1 / np.linalg.norm(plane) - distance) < 0.02
        assert np.abs(albedo - colour).max() < 0.02
    # Behind the camera: w of the projection is negative
    assert np.allclose(planes[0], [0, 0, -content.depth_unit / 0.5], atol=1e-4)


def test_few_bounding_planes_are_the_largest() -> None:
    environment = boxes(320, 240)
    content = encode_planes(environment, AttributeLayout(320, 240, bounding_planes=3))
    _, _, normals = bounding_fields(content)
    assert len(normals) == 3
    assert np.rint(normals[0]).tolist() == [0, 0, 1]


@pytest.mark.parametrize(
    ("name", "mean", "p95"), [("living", 0.1, 0.3), pytest.param("office", 0.6, 1.4, marks=pytest.mark.matrix)]
)
def test_surfaces_of_the_rooms(name: str, mean: float, p95: float) -> None:
    environment, layout = load_environment(ROOMS / name), AttributeLayout()
    content = encoded_environment(environment, layout).planes
    centimetres = 100 * ray_errors(
        environment, content.depth(layout, PlaneProjection.of(environment, content.depth_unit))
    )
    assert centimetres.mean() < mean
    assert np.percentile(centimetres, 95) < p95
    planes, _, normals = bounding_fields(content)
    up = normals @ environment.camera_to_world[1, :3]
    distance = 1 / np.linalg.norm(PlaneProjection.of(environment, content.depth_unit).dual_vectors(planes), axis=1)
    # The distance of the floor below the camera follows from the pose
    assert abs(distance[up > 0.99][0] - environment.camera_to_world[1, 3]) < 0.02
    assert len(planes) == 6


def all_words(image: AttributeImage) -> list[bytes]:
    return [memory.tobytes() for part in image.memories().values() for memory in part.values()]


def test_encoding_is_reproducible() -> None:
    environment = boxes()
    images = [encode_environment(environment, AttributeLayout(160, 120)) for _ in range(2)]
    assert all_words(images[0]) == all_words(images[1])
    assert images[0].byte_counts() == {"albedo": 16384, "normals": 16384, "planes": 12288}
    assert np.abs(images[0].decoded_albedo() - environment.albedo).mean() < 0.002


ENCODERS = ("encode_two_level", "encode_slic", "encode_surfaces", "encode_bounding")


@pytest.mark.parametrize("encoding", ["twoLevel", "slic"])
def test_a_room_is_encoded_once(
    encoding: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each map by itself: one with another albedo has the normals and surfaces of the first."""
    environment, layout = boxes(96, 64), AttributeLayout(96, 64, encoding)
    first = encoded_environment(environment, layout, tmp_path)
    kept = list(tmp_path.glob("*/room.npz"))
    again: list[str] = []
    for name in ENCODERS:
        whole = getattr(maps_image, name)

        def count(*arguments: object, name: str = name, whole: Callable[..., object] = whole) -> object:
            again.append(name)
            return whole(*arguments)

        monkeypatch.setattr(maps_image, name, count)
    assert all_words(encoded_environment(environment, layout, tmp_path)) == all_words(first)
    assert again == []
    vectors = "encode_slic" if encoding == "slic" else "encode_two_level"
    for other, names in (
        (replace(environment, albedo=environment.albedo * 0.5), [vectors, "encode_bounding"]),
        (replace(environment, depth=environment.depth * 1.01), ["encode_surfaces", "encode_bounding"]),
    ):
        again.clear()
        assert all_words(encoded_environment(other, layout, tmp_path)) != all_words(first)
        assert again == names
    for file in kept:
        file.write_bytes(b"broken")
    cache._verified.clear()
    for _ in range(2):
        assert all_words(encoded_environment(environment, layout, tmp_path)) == all_words(first)
    assert capsys.readouterr().err == 4 * "colonnade: the cached room was damaged and is built again\n"


@pytest.mark.parametrize(("width", "height"), [(1, 1), (5, 3), (16, 16), (33, 2)])
def test_tiny_rooms(width: int, height: int) -> None:
    environment = boxes(width, height, steps=False)
    image = encode_environment(environment, AttributeLayout(width, height))
    depth = image.decoded_depth(PlaneProjection.of(environment, image.depth_unit))
    assert np.abs(depth / environment.depth - 1).max() < 0.02
    assert np.abs(image.decoded_albedo() - environment.albedo).max() < 0.01


def test_a_room_of_another_size() -> None:
    with pytest.raises(UserError, match="are 160x120 pixels, the hardware holds 640x480"):
        encode_environment(boxes(), AttributeLayout())
