"""Batches of rays: the device in its shell answers as the model does, whatever the batches before."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from colonnade.common.progress import QUIET
from colonnade.design.generator import shell_manifest_for
from colonnade.rays.scene import FAN, SENSOR

from colonnade_lab.evaluation.fuzz import batches
from colonnade_lab.evaluation.fuzz.batches import BatchBench, PlannedBatches
from colonnade_lab.evaluation.fuzz.campaign import fuzz, fuzzed_design
from colonnade_lab.evaluation.fuzz.rays import BATCH, RayBatch, RayScene, any_batch

#: The design of `test_bus_sequences.py`, whose simulator is an optimised one.
DESIGN = "tiny", ("queries={}", "units.rayInterval=1")


@pytest.fixture(autouse=True)
def optimised(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("COLONNADE_QUICK_SIMULATORS", raising=False)


@pytest.fixture(scope="module")
def bench() -> BatchBench:
    return BatchBench(shell_manifest_for(*DESIGN, 64), QUIET)


def plans(bench: BatchBench, kind: str, count: int = 60) -> Iterator[PlannedBatches]:
    return (bench.plan(seed, kind) for seed in range(count))


def test_a_batch_has_the_format_of_the_driver() -> None:
    assert BATCH.itemsize == 64 and BATCH.fields is not None
    assert [BATCH.fields[name][1] for name in ("count", "origin", "tag", "done")] == [16, 24, 44, 48]


def test_batches_have_all_modes_forms_and_counts() -> None:
    random, words = np.random.default_rng(1), []
    for _ in range(1500):
        words.append(any_batch(random).words)
    modes = {int(one["mode"]) & 0xFFFFFF for one in words}
    assert modes == {
        form | response | culls << 8 for form in (0, FAN, SENSOR) for response in range(3) for culls in range(16)
    }
    counts = [int(one["count"]) for one in words]
    assert min(counts) == 1 and max(counts) == 640
    assert {int(one["mode"]) >> 24 for one in words} >= {0, 1, 255}
    numbers = np.concatenate([[*one["origin"], one["near"], one["far"]] for one in words])
    assert np.isnan(numbers).any() and np.isinf(numbers).any()
    assert ((numbers != 0) & (np.abs(numbers) < np.finfo(np.float32).tiny)).any()


@pytest.mark.parametrize("kind", BatchBench.kinds)
def test_a_seed_determines_batches_and_memory(kind: str, bench: BatchBench) -> None:
    again = BatchBench(shell_manifest_for(*DESIGN, 64), QUIET)
    changes = set()
    for one, other in zip(plans(bench, kind, 12), plans(again, kind, 12), strict=True):
        assert (one.change, one.bus, one.reset, one.counters) == (other.change, other.bus, other.reset, other.counters)
        for a, b in zip((*one.batches, one.legal), (*other.batches, other.legal), strict=True):
            assert (a.batch.words.tobytes(), a.batch.rays, a.hits) == (b.batch.words.tobytes(), b.batch.rays, b.hits)
        changes.add(one.change)
    assert len(changes) == 12


def test_wrong_batches_fail_by_the_rules_of_the_page(bench: BatchBench) -> None:
    """Each field is wrong in some; right ones have the model's hits."""
    found = [each for plan in plans(bench, "batches") for each in plan.batches]
    assert 0.2 < np.mean([each.fails for each in found]) < 0.7
    assert all((each.hits is None) == each.fails for each in found)
    counts = {int(each.batch.words["count"]) for each in found if each.fails}
    assert {0, (1 << 24) + 1, 1 << 31, (1 << 32) - 1} <= counts
    for name, unit in (("rays", 64), ("hits", 64), ("done", 4)):
        assert any(int(each.batch.words[name]) % unit for each in found if each.fails)
        assert any(int(each.batch.words[name]) >> 40 for each in found if each.fails)
    assert {each.has_tag for each in found if each.fails} == {True, False}
    assert not any(each.fails for plan in plans(bench, "rays", 10) for each in plan.batches)


@pytest.mark.verilator
def test_device_and_model_agree_on_batches() -> None:
    """Long version: ``colonnade fuzz --config tiny --set queries={} … --cases 1000``."""
    report = fuzz(fuzzed_design(*DESIGN), 36, seed=1)
    assert report["disagreements"] == [] and report["legal_failures"] == 0
    assert report["kinds"]["rays"] == {"same": 12, "changed": 0, "flagged": 0, "watchdog": 0, "disagree": 0}
    assert report["kinds"]["batches"]["flagged"] > 5
    assert report["kinds"]["bus"]["flagged"] > 1 and report["kinds"]["bus"]["changed"] > 1
    assert report["sums"]["batches"] > 120 and report["sums"]["rays"] > 10_000


@pytest.mark.verilator
def test_a_wrong_bit_in_a_hit_of_the_model_is_found_by_its_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    honest = RayScene.answer

    def wrong(scene: RayScene, batch: RayBatch) -> bytes | None:
        hits = honest(scene, batch)
        return hits if hits is None or batch.words["count"] != 511 else bytes([hits[0] ^ 1, *hits[1:]])

    monkeypatch.setattr(RayScene, "answer", wrong)
    design = fuzzed_design(*DESIGN)
    found = fuzz(design, 8, seed=1, kinds=("rays",))["disagreements"]
    assert 0 < len(found) < 8 and all("1 bytes of memory differ" in " ".join(one["differences"]) for one in found)
    assert fuzz(design, 1, seed=found[-1]["seed"], kinds=("rays",))["disagreements"] == found[-1:]


@pytest.mark.verilator
def test_wrong_registers_tags_and_hangs_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """The device has another scale; a batch beyond the window is thought right; the device does not end in time."""
    design, honest = fuzzed_design(*DESIGN), RayScene.__init__

    def scaled(scene: RayScene, manifest: object) -> None:
        honest(scene, manifest)  # type: ignore[arg-type]
        scene.values["placement.exponent"] += 1

    with monkeypatch.context() as patch:
        patch.setattr(RayScene, "__init__", scaled)
        (found,) = fuzz(design, 1, seed=1, kinds=("rays",))["disagreements"]
        assert any("bytes of memory differ" in difference for difference in found["differences"])
    with monkeypatch.context() as patch:
        patch.setattr(batches, "_fits", lambda first, size: first + size <= 1 << 20)
        found = fuzz(design, 20, seed=1, kinds=("batches",))["disagreements"]
        assert any("tag" in difference for one in found for difference in one["differences"])
    monkeypatch.setattr("colonnade_lab.evaluation.fuzz.shell.PATIENCE", 0)
    found = fuzz(design, 2, seed=1, kinds=("rays",))["disagreements"]
    assert len(found) == 2 and all("after" in one["differences"][0] for one in found)
