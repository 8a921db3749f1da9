"""Encoded albedo and normals: exact sizes and bits, and the documented loss."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from colonnade.common.errors import UserError
from colonnade.common.image_io import encode_srgb
from colonnade.environment.load import load_environment
from colonnade.maps.cache import encoded_environment
from colonnade.maps.layout import AttributeLayout
from colonnade.maps.quality import angles, relit
from colonnade.maps.selection import best_subsets, choose_within_budget
from colonnade.maps.slic import encode_slic
from colonnade.maps.two_level import MODES, TwoLevelMap
from colonnade.maps.two_level_encoder import encode_two_level
from colonnade.maps.vectors import AlbedoSpace, NormalSpace, pack, unpack
from colonnade.quality.image_metrics import psnr, ssim

ROOMS = Path(__file__).resolve().parents[3] / "scenes" / "rooms"
ALBEDO, NORMAL = AlbedoSpace(12), NormalSpace(12)


def noise(layout: AttributeLayout, seed: int = 0) -> NDArray[np.float64]:
    """A map with all kinds of tiles: noise, smooth slopes, edges, uniform colour."""
    random = np.random.default_rng(seed)
    v, u = np.mgrid[: layout.height, : layout.width]
    slope = np.stack([u / layout.width, v / layout.height, (u + v) % 37 / 37], axis=-1)
    grain = random.random(slope.shape)
    kind = (u // layout.tile_size + v // layout.tile_size) % 4
    edge = np.where((3 * u + v) % 61 < 20, 0.9, 0.2)[..., np.newaxis] * np.array([1.0, 0.6, 0.3])
    return np.choose(kind[..., np.newaxis], [grain, slope, edge, np.full_like(slope, 0.4)])


@pytest.mark.parametrize(
    ("encoding", "map_bytes", "heap"), [("twoLevel", 16384, 5216), ("slic", 15000, 5216)], ids=["twoLevel", "slic"]
)
def test_sizes_at_640x480(encoding: str, map_bytes: int, heap: int) -> None:
    layout = AttributeLayout(encoding=encoding)
    assert (layout.tiles, layout.heap_words, layout.map_memory_bytes) == (1200, heap, map_bytes)
    assert layout.plane_memory_bytes == 12288


@pytest.mark.parametrize("encoding", ["twoLevel", "slic"])
def test_memories_have_the_layouts_sizes(encoding: str) -> None:
    layout = AttributeLayout(100, 70, encoding)
    encode = encode_slic if encoding == "slic" else encode_two_level
    memories = encode(noise(layout), ALBEDO, layout).memories()
    bits = {"descriptors": 32, "palette": 36, "heap": 16, "seeds": 36, "labels": 16}
    assert -(-sum(words.size * bits[name] for name, words in memories.items()) // 8) == layout.map_memory_bytes
    assert all(int(words.max()) < 1 << bits[name] for name, words in memories.items())


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"width": 1280, "height": 960},
            "map_bytes is 16,384, but 1280x960 pixels in tiles of 16 need at least 20,352",
        ),
        ({"encoding": "slic", "map_bytes": 1000}, "map_bytes is 1,000, .* need at least 15,000"),
        ({"plane_bytes": 2000}, "plane_bytes is 2,000, .* need at least 3,568"),
        ({"encoding": "jpeg"}, "must be twoLevel or slic"),
        ({"tile_size": 12}, "tile_size is 12"),
        ({"palette_size": 300}, "palette_size is 300, it must be from 4 to 256"),
        ({"planes": 129}, "planes is 129"),
        ({"height": 0}, "height is 0"),
    ],
)
def test_impossible_layouts_are_rejected(settings: dict[str, int | str], message: str) -> None:
    with pytest.raises(UserError, match=message):
        AttributeLayout(**settings)  # type: ignore[arg-type]


@given(st.lists(st.tuples(*[st.integers(-2048, 2047)] * 3), min_size=1), st.booleans())
def test_words_hold_three_fields(fields: list[tuple[int, int, int]], signed: bool) -> None:
    values = np.array(fields) if signed else np.array(fields) + 2048
    words = pack(values, 12)
    assert int(words.max()) < 1 << 36
    assert [int(word) & 4095 for word in words] == [int(value) & 4095 for value in values[:, 0]]
    assert np.array_equal(unpack(words, 12, signed), values)


def test_vectors_keep_their_meaning() -> None:
    colours = np.array([[0.0, 0.5, 1.0], [0.001, 0.2, 0.9]])
    assert np.abs(ALBEDO.vectors(ALBEDO.words(colours)) - colours).max() <= 0.5 / 4095
    assert int(ALBEDO.words(np.ones((1, 3)))[0]) == (1 << 36) - 1
    random = np.random.default_rng(1).normal(size=(500, 3))
    unit = random / np.linalg.norm(random, axis=1, keepdims=True)
    assert angles(unit, NORMAL.vectors(NORMAL.words(unit))).max() < 0.03
    assert int(NORMAL.words(np.array([[0.0, 0.0, -1.0]]))[0]) == (4096 - 2047) << 24


def slow_entry(content: TwoLevelMap, u: int, v: int, layout: AttributeLayout) -> int:
    """The palette index of a pixel, decoded from the words by the documentation."""
    descriptor = int(content.descriptors[v // layout.tile_size * layout.tile_columns + u // layout.tile_size])
    number, pointer = descriptor % 8, descriptor // 8 % 8192
    entries = [descriptor >> 16 & 255, descriptor >> 24]
    cells = (2, 4, 8, 16)[number % 4]
    edge = layout.tile_size // cells
    cell = v % layout.tile_size // edge * cells + u % layout.tile_size // edge
    if number == 0:
        return entries[pointer >> cell & 1]
    heap = [int(word) for word in content.heap]
    if number < 4:
        return entries[heap[pointer + cell // 16] >> cell % 16 & 1]
    entries += [heap[pointer] & 255, heap[pointer] >> 8]
    return entries[heap[pointer + 1 + cell // 8] >> cell % 8 * 2 & 3]


@pytest.mark.parametrize(
    "layout",
    [
        AttributeLayout(96, 64, map_bytes=4000),
        AttributeLayout(100, 70, map_bytes=5000, palette_size=16),
        AttributeLayout(50, 30, tile_size=8),
        pytest.param(AttributeLayout(70, 100, tile_size=32, field_bits=8), marks=pytest.mark.matrix),
        AttributeLayout(5, 3),
    ],
    ids=lambda layout: f"{layout.width}x{layout.height}/{layout.tile_size}",
)
def test_random_access_follows_the_words(layout: AttributeLayout) -> None:
    content = encode_two_level(noise(layout), AlbedoSpace(layout.field_bits), layout)
    v, u = np.mgrid[: layout.height, : layout.width]
    slow = [slow_entry(content, int(x), int(y), layout) for x, y in zip(u.ravel(), v.ravel(), strict=True)]
    assert np.array_equal(content.entries_at(u, v, layout).ravel(), slow)


def test_modes_of_all_sizes_occur_and_stay_in_their_heap() -> None:
    layout = AttributeLayout(256, 256, map_bytes=1024 + 1152 + 3000)
    content = encode_two_level(noise(layout), ALBEDO, layout)
    used = np.bincount(content.descriptors & 7, minlength=8)
    assert (used[[0, 3, 6]] > 0).all() and np.count_nonzero(used) >= 5
    sizes = np.array([mode.words for mode in MODES])
    assert list(sizes) == [0, 1, 4, 16, 2, 3, 9, 33]
    pointers = content.descriptors >> 3 & 8191
    ends = pointers + sizes[content.descriptors & 7]
    assert ends[(content.descriptors & 7) > 0].max() <= layout.heap_words == 1500
    assert (sizes * used).sum() > 0.98 * layout.heap_words


def test_two_colours_are_kept_exactly() -> None:
    layout = AttributeLayout(64, 64)
    v, u = np.mgrid[:64, :64]
    colours = NORMAL.vectors(NORMAL.words(np.array([[0.0, -1.0, 0.0], [0.6, 0.0, -0.8]])))
    colours /= np.linalg.norm(colours, axis=1, keepdims=True)
    checks = colours[(u + v) % 2]
    assert angles(checks, encode_two_level(checks, NORMAL, layout).decoded(layout, NORMAL)).max() < 0.03


def test_more_bytes_lose_less() -> None:
    errors = []
    for map_bytes in (2000, 3000, 5000, 9000):
        layout = AttributeLayout(128, 128, map_bytes=map_bytes)
        original = noise(layout)
        decoded = encode_two_level(original, ALBEDO, layout).decoded(layout, ALBEDO)
        errors.append(psnr(encode_srgb(original), encode_srgb(decoded)))
    assert errors == sorted(errors)
    assert errors[-1] > errors[0] + 3


def test_best_subsets_against_all_pairs() -> None:
    costs = np.random.default_rng(3).random((20, 16, 9)).astype(np.float32)
    members, total = best_subsets(costs, (2,), rounds=4)[2]
    best = [min(np.minimum(c[:, a], c[:, b]).sum() for a in range(9) for b in range(a)) for c in costs]
    assert np.allclose(total, [c[:, m].min(axis=1).sum() for c, m in zip(costs, members, strict=True)], rtol=1e-5)
    assert total.sum() < 1.03 * sum(best)
    assert (total >= np.array(best) - 1e-4).all()


def test_the_budget_is_met_and_spent_where_it_helps() -> None:
    errors = np.array([[9.0, 1.0, 0.0], [5.0, 4.9, 0.1], [1.0, 1.0, 1.0]])
    sizes = np.array([0, 1, 4])
    assert list(choose_within_budget(errors, sizes, 100)) == [2, 2, 0]
    assert list(choose_within_budget(errors, sizes, 1)) == [1, 0, 0]
    assert list(choose_within_budget(errors, sizes, 0)) == [0, 0, 0]
    assert list(choose_within_budget(errors, sizes, 5)) == [1, 2, 0]
    random = np.random.default_rng(8)
    for budget in range(60):
        choice = choose_within_budget(-np.sort(-random.random((12, 4)), axis=1), np.array([0, 1, 4, 16]), budget)
        assert np.array([0, 1, 4, 16])[choice].sum() <= budget


@pytest.mark.parametrize(
    "layout", [AttributeLayout(100, 70, "slic"), AttributeLayout(33, 50, "slic", tile_size=8)], ids=["16", "8"]
)
def test_labels_name_the_seeds_around(layout: AttributeLayout) -> None:
    content = encode_slic(noise(layout), ALBEDO, layout)
    v, u = np.mgrid[: layout.height, : layout.width]
    for x, y, seed in zip(u.ravel(), v.ravel(), content.seeds_at(u, v, layout).ravel(), strict=True):
        block = int(y) // layout.block_size * layout.block_columns + int(x) // layout.block_size
        label = int(content.labels[block // 4]) >> block % 4 * 4 & 15
        row, column = int(y) // layout.tile_size + label // 3 - 1, int(x) // layout.tile_size + label % 3 - 1
        assert 0 <= row < layout.tile_rows and 0 <= column < layout.tile_columns
        assert seed == row * layout.tile_columns + column


@pytest.mark.parametrize(
    ("name", "decibels", "similarity", "degrees", "relit_decibels"),
    [
        ("living", 29.8, 0.915, 1.4, 29.8),
        pytest.param("office", 27.2, 0.86, 3.8, 27.2, marks=pytest.mark.matrix),
    ],
)
def test_two_level_maps_of_the_rooms(
    name: str, decibels: float, similarity: float, degrees: float, relit_decibels: float
) -> None:
    environment = load_environment(ROOMS / name)
    image = encoded_environment(environment, AttributeLayout())
    albedo, normals = image.decoded_albedo(), image.decoded_normals()
    pair = encode_srgb(environment.albedo), encode_srgb(albedo)
    assert psnr(*pair) > decibels
    assert (ssim(*pair) or 0) > similarity
    assert angles(environment.normals, normals).mean() < degrees
    lit = encode_srgb(relit(environment.albedo, environment.normals)), encode_srgb(relit(albedo, normals))
    assert psnr(*lit) > relit_decibels


@pytest.mark.parametrize(("name", "decibels", "degrees"), [("living", 26.2, 3.1), ("office", 24.5, 6.5)])
def test_slic_maps_of_the_rooms(name: str, decibels: float, degrees: float) -> None:
    environment, layout = load_environment(ROOMS / name), AttributeLayout(encoding="slic")
    albedo = encode_slic(environment.albedo, ALBEDO, layout).decoded(layout, ALBEDO)
    normals = encode_slic(environment.normals, NORMAL, layout).decoded(layout, NORMAL)
    assert psnr(encode_srgb(environment.albedo), encode_srgb(albedo)) > decibels
    assert angles(environment.normals, normals).mean() < degrees
