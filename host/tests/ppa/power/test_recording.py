"""Recordings of one render unit among several."""

from __future__ import annotations

import shutil

import pytest

from colonnade.ppa.power.recording import Recording, Stimulus, record

#: One-bit ports of a render unit.
PORTS = {
    name: {"direction": direction, "bits": [0]}
    for direction, names in {
        "input": ("clock", "reset", "io_start", "io_positions_valid", "io_pixels_ready", "io_broadcasts_0_valid"),
        "output": ("io_positions_ready", "io_pixels_valid", "io_requests_valid"),
    }.items()
    for name in names
}


def recorded(cycles: int) -> Recording:
    return record("tiny", ("array.rows=3",), "RenderUnit", PORTS, Stimulus.of_benchmark("cube", (24, 18), cycles))


@pytest.mark.skipif(shutil.which("verilator") is None, reason="Verilator is not installed")
def test_a_recording_is_of_one_unit_from_its_first_to_its_last_cycle() -> None:
    whole = recorded(2000)
    assert len(whole.cycles) == 2000
    assert [cycle for cycle, start in enumerate(whole.of("io_start")) if start] == [0]
    for cycles in (1234, 1999):
        part = recorded(cycles)
        assert part.cycles == whole.cycles[:cycles]
        assert part.idle_cycles == whole.idle_cycles
    taken, left = sum(whole.fires("io_positions")), sum(whole.fires("io_pixels"))
    assert 0 < left <= taken < 24 * 18 / 2, "the pixels of one of three units"
