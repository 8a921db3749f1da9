"""Words that tiles share in a heap: they decode to what the encoder chose, fit, and never raise the error."""

from __future__ import annotations

import numpy as np
import pytest
from colonnade_lab.evaluation.studies.generated_rooms import generated_room
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from colonnade.maps import cell_errors, plane_encoder, sharing, two_level_encoder
from colonnade.maps.heap import pack_words
from colonnade.maps.layout import AttributeLayout
from colonnade.maps.plane_encoder import encode_planes
from colonnade.maps.sharing import Offered, Users, choose_shared
from colonnade.maps.subdivision import Subdivided
from colonnade.maps.tiles import expand_cells, join_tiles
from colonnade.maps.two_level import MODES
from colonnade.maps.two_level_encoder import encode_two_level
from colonnade.maps.vectors import AlbedoSpace

ALBEDO = AlbedoSpace(12)


@given(st.lists(st.lists(st.lists(st.integers(0, 2), min_size=33, max_size=33), max_size=8), min_size=1, max_size=5))
def test_pointers_find_their_words(content: list[list[list[int]]]) -> None:
    lengths = (1, 4, 16, 33, 2)
    groups = [
        np.array([words[:length] for words in group], np.uint16).reshape(-1, length)
        for group, length in zip(content, lengths, strict=False)
    ]
    size = sum(np.unique(group, axis=0).size for group in groups)
    heap, pointers = pack_words(groups, size)
    assert len(heap) == size
    for group, places in zip(groups, pointers, strict=True):
        for words, place in zip(group, places, strict=True):
            assert 0 <= place <= size - len(words)
            assert np.array_equal(heap[place : place + len(words)], words)


def test_overlapping_words_are_stored_once() -> None:
    long, inner, chained = np.array([[1, 2, 3, 4]]), np.array([[2, 3], [3, 4]]), np.array([[4, 7, 8]])
    heap, pointers = pack_words([group.astype(np.uint16) for group in (inner, long, chained)], 8)
    assert list(heap) == [1, 2, 3, 4, 7, 8, 0, 0]
    assert [list(places) for places in pointers] == [[1, 2], [0], [3]]
    # A word begins at an even byte
    assert (
        list(pack_words([np.array([[0x0201]], np.uint16), np.array([[0x0103, 0x0402]], np.uint16)], 3)[0])[2] == 0x201
    )


@settings(max_examples=50)
@given(st.integers(0, 10_000), st.integers(1, 12), st.integers(1, 12), st.integers(0, 40))
def test_sharing_keeps_the_budget_and_never_raises_the_error(seed: int, count: int, tiles: int, budget: int) -> None:
    random = np.random.default_rng(seed)
    # Below 0 they are rounding
    free = random.uniform(-0.1, 1, tiles).astype(np.float32)
    errors = random.uniform(-0.1, 1, (count, tiles)).astype(np.float32)
    sizes = random.choice([1, 4, 16], count)
    start = np.zeros(count, dtype=np.bool_)
    for which in random.permutation(count)[: count // 2]:
        start[which] = sizes[start].sum() + sizes[which] <= budget
    chosen = choose_shared(Offered(free, errors, sizes), budget, start)
    assert sizes[chosen].sum() <= budget
    reached, before = (np.minimum(free, errors[which].min(axis=0, initial=np.inf)).sum() for which in (chosen, start))
    assert reached <= before + 1e-6 * abs(before)
    left = budget - sizes[chosen].sum()
    gains = np.maximum(np.minimum(free, errors[chosen].min(axis=0, initial=np.inf)) - errors, 0).sum(axis=1)
    assert not (gains[~chosen & (sizes <= left)] > 0).any()


def test_the_best_words_are_found() -> None:
    # The first words serve three tiles well, each of the others one tile perfectly
    errors = np.array([[1, 1, 1], [0, 9, 9], [9, 0, 9], [9, 9, 0]], np.float32)
    free, sizes = np.full(3, 8, np.float32), np.array([4, 4, 4, 4])
    chosen = choose_shared(Offered(free, errors, sizes), 4, np.array([False, True, False, False]))
    assert list(chosen) == [True, False, False, False]
    assert list(choose_shared(Offered(free, errors, sizes), 12, chosen)) == [True, True, True, False]
    assert list(choose_shared(Offered(free, errors, sizes), 16, chosen)) == [True, True, True, True]


def pattern(layout: AttributeLayout, seed: int) -> NDArray[np.float64]:
    """Boards with grain: many tiles with similar masks."""
    random = np.random.default_rng(seed)
    v, u = np.mgrid[: layout.height, : layout.width]
    period, slope = random.integers(9, 23), random.integers(1, 4)
    boards = 0.2 + 0.5 * ((u + v // slope) % period < period // 2)[..., np.newaxis] * random.random(3)
    return np.clip(boards + random.normal(0, 0.05, boards.shape), 0, 1)


def loss(original: NDArray[np.float64], layout: AttributeLayout) -> float:
    """The error that the encoder minimises, in one round, since another palette has another error."""
    with pytest.MonkeyPatch.context() as patch:
        # The encoder minimises this loss if detail of single pixels has the weight of all else
        patch.setattr(cell_errors, "PIXEL_DETAIL", 1.0)
        content = encode_two_level(original, ALBEDO, layout, rounds=1)
    pixels = two_level_encoder.TilePixels(ALBEDO.to_points(original), layout)
    decoded = two_level_encoder.TilePixels(ALBEDO.to_points(content.decoded(layout, ALBEDO)), layout)
    return float((((pixels.points - decoded.points) ** 2).sum(axis=3) * pixels.weights).sum())


@settings(max_examples=8)
@given(st.integers(0, 10_000), st.sampled_from([1500, 2000, 3000]), st.sampled_from([8, 16, 32]))
def test_shared_maps_lose_less(seed: int, heap_bytes: int, tile_size: int) -> None:
    layout = AttributeLayout(112, 80, tile_size=tile_size, palette_size=16)
    layout = AttributeLayout(
        112, 80, tile_size=tile_size, palette_size=16, map_bytes=layout.tiles * 4 + 72 + heap_bytes // 4
    )
    original = pattern(layout, seed)
    shared = loss(original, layout)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sharing, "_MOST_ERRORS", 0)
        assert shared <= loss(original, layout) * (1 + 1e-5)


@pytest.mark.parametrize("max_errors", [0, 1 << 13, 1 << 26], ids=["none", "in the heap", "all"])
def test_decoded_is_what_the_encoder_chose(max_errors: int, monkeypatch: pytest.MonkeyPatch) -> None:
    layout = AttributeLayout(160, 130, map_bytes=4200, plane_bytes=2700)
    parts: list[list[Subdivided]] = []

    def note(encoder: object) -> None:
        write = encoder._written  # type: ignore[attr-defined]

        def written(chosen: list[Subdivided], *rest: object) -> object:
            parts.append(chosen)
            return write(chosen, *rest)

        monkeypatch.setattr(encoder, "_written", written)

    monkeypatch.setattr(sharing, "_MOST_ERRORS", max_errors)
    note(two_level_encoder)
    note(plane_encoder)
    v, u = np.mgrid[:130, :160]
    albedo = encode_two_level(pattern(layout, 3), ALBEDO, layout)
    planes = encode_planes(generated_room(2, 160, 130).environment, layout)
    for chosen, decoded in zip(parts, (albedo.entries_at(u, v, layout), planes.ids(layout)), strict=True):
        expected = np.full((layout.tiles, 16, 16), -1)
        for part in chosen:
            expected[part.tiles] = expand_cells(part.indices, 16)
        assert np.array_equal(join_tiles(expected, layout), decoded)
    number, pointer = albedo.descriptors & 7, albedo.descriptors >> 3 & 8191
    lengths = np.array([mode.words for mode in MODES])[number]
    assert (pointer + lengths)[number > 0].max() <= layout.heap_words
    # Equal words are stored once in any case
    different = sum(len(np.unique(part.words(), axis=0)) for part in parts[0] if part.mode.words)
    assert len(np.unique(pointer[number > 0])) <= different < (number > 0).sum()


@given(st.integers(0, 1000), st.integers(1, 6))
def test_an_order_of_members_changes_no_cell(seed: int, slot: int) -> None:
    random, mode = np.random.default_rng(seed), MODES[slot]
    members = np.stack([random.permutation(16)[: mode.entries] for _ in range(5)])
    taken = random.integers(0, mode.entries, (5, mode.cells**2))
    part = Subdivided(slot, mode, np.arange(5), members, taken)
    ordered = part.ordered(random.permutation(16))
    assert np.array_equal(ordered.indices, part.indices)
    swapped = Subdivided(slot, mode, np.arange(5), members[:, ::-1], mode.entries - 1 - taken)
    assert np.array_equal(ordered.words(), swapped.ordered(np.arange(16)).words()) or mode.entries == 4
    ranks = random.permutation(16)
    assert np.array_equal(part.ordered(ranks).words(), swapped.ordered(ranks).words())


def test_users_have_the_words_of_others() -> None:
    part = Subdivided(1, MODES[1], np.array([4, 9]), np.array([[1, 2], [3, 5]]), np.eye(2, 16, dtype=np.int64))
    shared = Users(part, np.array([0, 9, 4]), np.array([1, 1, 0])).subdivided()
    assert shared.tiles.tolist() == [0, 9, 4]
    assert shared.members.tolist() == [[3, 5], [3, 5], [1, 2]]
    assert shared.taken.argmax(axis=1).tolist() == [1, 1, 0]
