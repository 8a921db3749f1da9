"""Recordings of a traversal unit among several, and of the modules that follow its paths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from colonnade.common.errors import UserError
from colonnade.design.generator import GeneratedDesign, manifest_for
from equal_frames import PIPELINED

from colonnade_lab.evaluation.ray_bench import KINDS
from colonnade_lab.ppa.netlist.hierarchy import TRIANGLES
from colonnade_lab.ppa.power.batch import BatchWorkload
from colonnade_lab.ppa.power.frame import PATH_MODULES, FrameWorkload
from colonnade_lab.ppa.power.record import _Ports, _recorder, _words, record
from colonnade_lab.ppa.power.recording import Recording

UNIT = "TraversalUnit"


def ports(inputs: Sequence[str], outputs: Sequence[str]) -> Mapping[str, Any]:
    """One-bit ports in Yosys's JSON, with the clock."""
    directions = {"input": ("clock", "reset", *inputs), "output": outputs}
    return {name: {"direction": each, "bits": [0]} for each, names in directions.items() for name in names}


PORTS = {
    UNIT: ports(
        ("io_start", "io_rays_valid", "io_broadcasts_0_valid"), ("io_isFree", "io_events_intersector_raysInBox")
    ),
    "PathUnit": ports(
        ("io_positions_valid", "io_pixels_ready"),
        ("io_positions_ready", "io_pixels_valid", "io_events_raysShadow", "io_events_hits"),
    ),
    "PathHits": ports(("io_start", "io_rays_ready"), ("io_rays_valid",)),
    "RayBus": ports(("io_rays_valid",), ("io_rays_ready", "io_units_0_valid", "io_units_1_valid")),
    "ResultBus": ports((), ("io_results_valid",)),
    TRIANGLES: ports(("io_rows_0_candidate_valid", "io_rows_1_candidate_valid"), ("io_rows_0_result_valid",)),
}


def workload(cycles: int) -> FrameWorkload:
    return FrameWorkload.of_benchmark("cube", (24, 18), cycles)


def recorded(cycles: int) -> dict[str, Recording]:
    return record("tiny", PIPELINED, PORTS, workload(cycles))


@pytest.mark.verilator
def test_recordings_are_of_one_unit_and_its_paths_from_the_first_to_the_last_cycle() -> None:
    whole = recorded(900)
    assert set(whole) == set(FrameWorkload.modules)
    assert all(len(recording.cycles) == 900 for recording in whole.values())
    unit = whole[UNIT]
    assert [cycle for cycle, start in enumerate(unit.of("io_start")) if start] == [0]
    for cycles in (434, 899):
        for module, part in recorded(cycles).items():
            assert part.cycles == whole[module].cycles[:cycles]
            assert part.idle_cycles == whole[module].idle_cycles
    # The unit of row 0, in the same cycles as the column
    assert unit.of("io_rays_valid") == whole["RayBus"].of("io_units_0_valid")
    assert whole["PathHits"].fires("io_rays") == whole["RayBus"].fires("io_rays")
    frame = workload(900).window(whole)
    assert 0 < frame.counts["hits"] < frame.counts["pixels"] <= 24 * 18
    share = frame.traced / frame.counts["rays_in_box"]
    assert 0.2 < share < 0.5
    assert frame.records_share == share
    # Two of the rows share a triangle unit
    of_group = sum(sum(whole["RayBus"].of(f"io_units_{row}_valid")[frame.begin : frame.end]) for row in range(2))
    shared = dict.fromkeys(PATH_MODULES, share) | {TRIANGLES: frame.traced / of_group}
    assert frame.shares == {UNIT: 1.0} | shared
    assert share < shared[TRIANGLES] < 1


def test_ports_that_the_simulated_module_lacks_are_0_or_left_out(tmp_path: Path) -> None:
    """Those of rays that only memories hold: firtool drops them where the memories are modules."""
    (tmp_path / f"{UNIT}.sv").write_text(f"module {UNIT}(input clock, reset, io_start, output io_isFree);\nendmodule\n")
    design = GeneratedDesign(tmp_path, manifest_for("tiny").manifest)
    gates = ports(("io_start", "io_ray"), ("io_isFree", "io_gone"))
    found = _Ports.of(gates, _words(design, UNIT))
    assert [port.name for port in found.inputs] == ["reset", "io_start", "io_ray"]
    assert [port.name for port in found.outputs] == ["io_isFree"]
    assert ".inputs({reset, io_start, 1'h0}), .outputs({io_isFree})" in _recorder(UNIT, found, design, "Column")


RAY_PORTS = {
    UNIT: PORTS[UNIT],
    "RayQueries": ports(
        ("io_runs_valid", "io_rays_ready", "io_results_valid", "io_results_bits_hasHit"),
        ("io_runs_ready", "io_rays_valid"),
    )
    | {
        "io_runs_bits_count": {"direction": "input", "bits": [0] * 7},
        "io_resolved": {"direction": "output", "bits": [0, 1]},
    },
    "RayBus": PORTS["RayBus"],
    "ResultBus": PORTS["ResultBus"],
    TRIANGLES: PORTS[TRIANGLES],
}


@pytest.mark.matrix
@pytest.mark.verilator
def test_a_batch_is_recorded_from_its_first_run_to_the_end_of_the_last_one() -> None:
    overrides = ("array.rows=2", "units.triangleRows=2", "queries.contexts=64")
    mesh = FrameWorkload.of_benchmark("torus", None, 0).mesh
    batch = BatchWorkload(mesh, KINDS[4], 192, 20_000)
    whole = record("traversal", overrides, RAY_PORTS, batch)
    window, queries = batch.window(whole), whole["RayQueries"]
    assert whole[UNIT].scene == {"mesh": mesh.name, "triangles": len(mesh.faces), "kind": KINDS[4], "rays": 192}
    assert window.counts["rays"] == 192
    assert queries.fires("io_runs").index(True) == window.begin
    assert queries.of("io_resolved")[window.end - 1] == 1 and not any(queries.of("io_resolved")[window.end :])
    # Each ray that enters the box has a result, and the units of two rows trace them
    assert window.counts["rays_in_box"] == sum(queries.of("io_results_valid"))
    assert 0 < window.counts["hits"] < window.counts["rays_in_box"] <= 192
    assert 0 < window.traced < window.counts["rays_in_box"]
    with pytest.raises(UserError, match="has not ended"):
        batch.window({name: replace(each, cycles=each.cycles[: window.end - 1]) for name, each in whole.items()})
