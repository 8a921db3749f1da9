"""Sums of passes: exact, in any order, and equal to the frame for a single one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from colonnade.common.accumulation import UNSHADOWED, WHITE, Accumulation, FramePasses
from colonnade.common.framebuffer import Frame
from colonnade.common.types import Floats


def random_frame(seed: int, room: bool = True) -> Frame:
    random = np.random.default_rng(seed)
    shape = (3, 4)
    return Frame(
        colour=random.integers(0, 4096, (*shape, 3)).astype(np.uint16),
        is_object=random.random(shape) < 0.5,
        triangle=np.zeros(shape, dtype=np.int64),
        instance=np.zeros(shape, dtype=np.int64),
        distance=np.zeros(shape),
        counters={"cycles": int(random.integers(1000)), "deepestStack": int(random.integers(48))},
        errors=["watchdog"] if seed % 5 == 4 else [],
        ratio=random.integers(0, 4097, (*shape, 3)).astype(np.uint16) if room else None,
    )


def passes_of(frames: list[Frame]) -> FramePasses:
    passes = FramePasses()
    for frame in frames:
        passes.add(frame)
    return passes


@settings(max_examples=40)
@given(seeds=st.lists(st.integers(0, 1000), min_size=1, max_size=12), room=st.booleans(), data=st.data())
def test_sums_are_exact_and_free_of_order(seeds: list[int], room: bool, data: st.DataObject) -> None:
    frames = [random_frame(seed, room) for seed in seeds]
    sums = passes_of(frames).sums
    assert sums.same_as(passes_of(data.draw(st.permutations(frames))).sums).all()
    pixel = (1, 2)
    shown = [[int(v) for v in frame.colour[pixel]] for frame in frames if frame.is_object[pixel]]
    others = [frame for frame in frames if not frame.is_object[pixel]]
    assert sums.samples == len(frames) and sums.coverage[pixel] == len(shown)
    for channel in range(3):
        assert int(sums.objects[pixel][channel]) == sum(colour[channel] for colour in shown)
        assert int(sums.background[pixel][channel]) == sum(int(frame.colour[pixel][channel]) for frame in others)
        if room:
            assert sums.ratio is not None
            ratios = [int(frame.ratio[pixel][channel]) for frame in others if frame.ratio is not None]
            assert int(sums.ratio[pixel][channel]) == sum(ratios)


@given(seed=st.integers(0, 1000))
def test_one_pass_is_its_frame(seed: int) -> None:
    frame = random_frame(seed)
    passes = passes_of([frame])
    assert frame.ratio is not None
    np.testing.assert_array_equal(passes.sums.image(), frame.colour.astype(np.float64) / 4095)
    photo = np.random.default_rng(seed).random((3, 4, 3))
    expected = np.where(frame.is_object[..., None], frame.colour / 4095, photo * (frame.ratio / 4096.0))
    over = passes.sums.over(photo)
    np.testing.assert_allclose(over, expected, rtol=0, atol=1 / 65535)  # photo and product are rounded
    np.testing.assert_array_equal(over[frame.is_object], expected[frame.is_object])
    assert passes.frame == frame


def test_a_sample_shows_the_object_or_the_shaded_photo() -> None:
    """One of four samples shows a white object, the others the photo, two of them in half the light."""
    photo: Floats = np.full((1, 1, 3), 0.4)
    sums = None
    for is_object, ratio in ((True, 0), (False, 4096), (False, 2048), (False, 2048)):
        colour, shadow = np.full((1, 1, 3), 4095, dtype=np.uint32), np.full((1, 1, 3), ratio, dtype=np.uint32)
        one = Accumulation.of_pixels(colour, np.array([[is_object]]), shadow, 4095, 4096)
        sums = one if sums is None else sums + one
    assert sums is not None
    np.testing.assert_allclose(sums.over(photo), (1.0 + 0.4 + 0.2 + 0.2) / 4)


def test_the_largest_sums_fit() -> None:
    white = replace(random_frame(1), colour=np.full((3, 4, 3), 4095, np.uint16), is_object=np.ones((3, 4), bool))
    sums = passes_of([white] * 1024).sums
    assert sums.objects.max() == 1024 * 4095 and (sums.image() == 1.0).all()


def test_counters_add_up_levels_do_not_and_errors_are_kept() -> None:
    frames = [random_frame(seed) for seed in (3, 4, 9)]
    frame = passes_of(frames).frame
    assert frame.counters["cycles"] == sum(one.counters["cycles"] for one in frames)
    assert frame.counters["deepestStack"] == max(one.counters["deepestStack"] for one in frames)
    assert frame.errors == ["watchdog"]
    np.testing.assert_array_equal(frame.colour, frames[0].colour)


def test_the_strength_of_shadows_is_a_part_of_them() -> None:
    """None is the photo, the whole is the ratio's; of the samples of a pixel only the photo's count."""
    ratio = np.full((1, 1, 3), 1024, dtype=np.uint32)
    colour = np.full((1, 1, 3), 4095, dtype=np.uint32)
    samples = [Accumulation.of_pixels(colour, np.array([[on]]), ratio, WHITE, UNSHADOWED) for on in (True, False)]
    visible, hidden = samples
    photo = np.full((1, 1, 3), 0.5)
    for sums in (hidden, hidden + hidden, hidden + visible):
        whole, none, half = (sums.over(photo, np.array([[part]], dtype=np.uint8)) for part in (255, 0, 128))
        np.testing.assert_array_equal(whole, sums.over(photo))
        unshadowed = replace(sums, ratio=np.full_like(ratio, 4096) * (sums.samples - sums.coverage[0, 0]))
        np.testing.assert_array_equal(none, unshadowed.over(photo))
        np.testing.assert_allclose(half, (whole * 128 + none * 127) / 255, atol=2e-4)
