"""No abuse of the AXI4 shell at its pins breaks a rule of the bus, hangs it, or harms the frame that follows."""

from __future__ import annotations

import json

import pytest
from colonnade.design.generator import shell_design_for

from colonnade_lab.evaluation.bus_sequences import run_sequences

CACHE = {"lines": 8, "ways": 2, "misses": 4, "sharedLines": 16, "sharedWays": 2, "sharedMisses": 8}
CACHE |= {"busBytes": 32, "parity": True}
PLAIN, CACHED = ("array.columns=2",), ("array.columns=2", f"columnBvhMemory.cache={json.dumps(CACHE)}")

RAYS = ("queries={}", "units.rayInterval=1")
IN_ROOM = ("array.columns=2", 'physicalAttributeMemory={"width":96,"height":72}', "frame.maxBounces=1")


@pytest.mark.parametrize(
    ("overrides", "sequences"),
    [
        pytest.param(PLAIN, 140, id="scene in memories", marks=pytest.mark.matrix),
        pytest.param(CACHED, 70, id="scene in DRAM", marks=pytest.mark.matrix),
        pytest.param(PLAIN, 10_000, id="scene in memories, many", marks=pytest.mark.matrix),
        pytest.param(IN_ROOM, 2_000, id="with maps of a room, many", marks=pytest.mark.matrix),
        pytest.param(CACHED, 3_000, id="scene in DRAM, many", marks=pytest.mark.matrix),
    ],
)
def test_no_abuse_at_the_bus_breaks_a_rule_or_the_next_frame(overrides: tuple[str, ...], sequences: int) -> None:
    """140 sequences are each kind of abuse with each order of slaves."""
    result = run_sequences(shell_design_for("tiny", overrides, bus_bytes=16), sequences)
    assert result.broken_rules == ()
    assert result.sequences == result.ended == result.exact == sequences
    assert result.is_right and result.bursts > 10 * sequences


@pytest.mark.parametrize(
    ("overrides", "sequences"),
    [
        pytest.param((), 25, id="records in memory"),
        pytest.param((), 1_000, id="records in memory, many", marks=pytest.mark.matrix),
        pytest.param(CACHED, 500, id="scene in DRAM, many", marks=pytest.mark.matrix),
    ],
)
def test_no_abuse_at_the_bus_breaks_a_rule_or_the_batch_of_rays_that_follows(
    overrides: tuple[str, ...], sequences: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In an optimised simulator: thousands of batches take longer than its compilation."""
    monkeypatch.delenv("COLONNADE_QUICK_SIMULATORS", raising=False)
    result = run_sequences(shell_design_for("tiny", (*RAYS, *overrides), bus_bytes=64), sequences)
    assert result.broken_rules == ()
    assert result.sequences == result.ended == result.exact == sequences
    assert result.batches > 400 * sequences
