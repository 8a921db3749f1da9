"""Refits: the unit of the shell writes the records of the driver's C, and nothing else, whatever the plans before."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from colonnade.common.progress import QUIET
from colonnade.design.generator import shell_manifest_for
from driver_runs import CACHE

from colonnade_lab.evaluation.fuzz import refits
from colonnade_lab.evaluation.fuzz.campaign import fuzz, fuzzed_design
from colonnade_lab.evaluation.fuzz.plans import LINES, NODE, PAIR, TRIANGLE, BentMesh, Effect, effect_of
from colonnade_lab.evaluation.fuzz.refits import RefitBench

#: A design of `test_viewer_program.py`.
IN_DRAM = f"columnBvhMemory.cache={json.dumps(CACHE | {'lines': 64, 'sharedLines': 256})}"
DESIGN = "tiny", ("array.columns=2", IN_DRAM)


@pytest.fixture(scope="module")
def bench() -> RefitBench:
    return RefitBench(shell_manifest_for(*DESIGN), QUIET)


@pytest.mark.parametrize("kind", RefitBench.kinds)
def test_a_seed_determines_refit_and_memory(kind: str, bench: RefitBench) -> None:
    again, changes = RefitBench(shell_manifest_for(*DESIGN), QUIET), set()
    for seed in range(20):
        one, other = bench.plan(seed, kind), again.plan(seed, kind)
        assert (one.change, one.bus, one.reset) == (other.change, other.bus, other.reset)
        for a, b in ((one.refit, other.refit), (one.legal, other.legal)):
            assert (a.settings, a.effect, a.result) == (b.settings, b.effect, b.result)
            np.testing.assert_array_equal(a.plan, b.plan)
            np.testing.assert_array_equal(a.vertices, b.vertices)
        changes.add(one.change + str(one.refit.settings))
    assert len(changes) == 20


def test_meshes_have_all_kinds_of_leaves_and_entries(bench: RefitBench) -> None:
    random, formats, kinds = np.random.default_rng(1), set[int](), set[int]()
    assert bench.meshes[-1].records.shape[0] > 100
    for _ in range(40):
        refit = bench.plan(int(random.integers(1 << 30)), "vertices").refit
        kinds |= set((refit.plan[:, 0] & 3).tolist())
        nodes = next(mesh.nodes for mesh in bench.meshes if len(mesh.records) == len(refit.records))
        formats |= set(np.delete(refit.records[:, 31] >> 6, nodes).tolist())
        # The plan of a mesh names all of its records
        assert refit.effect == Effect(False, frozenset(range(len(refit.records))))
    assert formats == {0, 1, 2, 3} and kinds == {LINES, TRIANGLE, PAIR, NODE}


def test_what_a_plan_does(bench: RefitBench) -> None:
    def effect(*entries: tuple[int, ...], lines: int = 4, count: int = 4) -> tuple[bool, set[int]]:
        plan = np.array([[kind | number << 2, *words] for kind, number, *words in entries], np.uint32)
        found = effect_of(plan, lines, count, bench.manifest)
        return found.names_nothing, set(found.written)

    lines, leaf = (LINES, 2, 0, 3, 9), (TRIANGLE, 1, 0, 0, 0)
    assert effect(lines, leaf) == (False, {1})
    assert effect((LINES, 3, 0, 3, 9), leaf) == (True, {1})  # a line beyond the last one
    assert effect(lines, leaf, (PAIR, 3, 0, 0, 0), (NODE, 0, 1, 2, 0)) == (False, {0, 1, 3})
    assert effect(lines, leaf, (NODE, 0, 1, 2, 0)) == (True, {1})  # a child that is not there
    assert effect(lines, leaf, (NODE, 0, 1, 0, 0)) == (True, {1})  # no child
    assert effect(*[leaf] * 5, (NODE, 0, 1, 5, 0)) == (True, {1})  # too many
    assert effect(leaf, (TRIANGLE, 4, 0, 0, 0), (NODE, 5, 1, 1 | 1 << 3, 0)) == (True, {1})  # records beyond the last
    assert effect(*[leaf] * 128) == (False, {1}) and effect(*[leaf] * 129) == (True, {1})


@pytest.mark.matrix
@pytest.mark.verilator
def test_unit_and_driver_agree_on_refits() -> None:
    """Long version: ``colonnade fuzz --refit --cases 1000 --config tiny --set 'columnBvhMemory.cache=…'``."""
    report = fuzz(fuzzed_design(*DESIGN, refit=True), 120, seed=1)
    assert report["disagreements"] == [] and report["legal_failures"] == 0
    assert report["kinds"]["vertices"] == {"same": 40, "changed": 0, "flagged": 0, "watchdog": 0, "disagree": 0}
    assert report["kinds"]["plans"]["flagged"] > 20 and report["kinds"]["plans"]["changed"] > 0
    assert report["kinds"]["bus"]["flagged"] > 5 and report["kinds"]["bus"]["changed"] > 5
    assert report["sums"]["refits"] == 240 and report["sums"]["records"] > 10_000


@pytest.mark.matrix
@pytest.mark.verilator
def test_wrong_records_bounds_and_errors_are_found_by_their_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bit of a record; a bound; an effect of plans that the unit does not have."""
    design, refitted = fuzzed_design(*DESIGN, refit=True), BentMesh.refitted

    def other_record(*arguments: Any) -> tuple[Any, list[int], int]:
        records, bounds, flat = refitted(*arguments)
        records[-1, 0] ^= len(records) > 100
        return records, bounds, flat

    def other_bound(*arguments: Any) -> tuple[Any, list[int], int]:
        records, bounds, flat = refitted(*arguments)
        return records, [bounds[0] + (len(records) > 100), *bounds[1:]], flat

    for wrong, difference in ((other_record, "1 bytes of memory differ"), (other_bound, "refit.bounds[0]")):
        with monkeypatch.context() as patch:
            patch.setattr(BentMesh, "refitted", wrong)
            found = fuzz(design, 9, seed=1, kinds=("vertices",))["disagreements"]
            assert 0 < len(found) < 9 and all(difference in " ".join(one["differences"]) for one in found)
            assert fuzz(design, 1, seed=found[-1]["seed"], kinds=("vertices",))["disagreements"] == found[-1:]
    monkeypatch.setattr(refits, "effect_of", lambda *_: Effect(False, frozenset()))
    found = fuzz(design, 9, seed=1, kinds=("plans",))["disagreements"]
    assert any("refit.errors 4 instead of 0" in one["differences"] for one in found)
    assert any("bytes of memory differ" in " ".join(one["differences"]) for one in found)
