"""Power: energies of liberty files, sums, reports, OpenSTA, and the checks of the workload."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from click.testing import CliRunner
from colonnade.cli.main import cli
from colonnade.common.errors import UserError
from colonnade.design.generator import manifest_for
from small_gates import cell, small_library, top

from colonnade_lab.evaluation.ray_bench import KINDS
from colonnade_lab.ppa.library import energies
from colonnade_lab.ppa.library.cells import Library
from colonnade_lab.ppa.netlist.activity import Activity
from colonnade_lab.ppa.netlist.mapped import Netlist
from colonnade_lab.ppa.power.activity import Power, power_of
from colonnade_lab.ppa.power.batch import BatchWorkload
from colonnade_lab.ppa.power.frame import FrameWorkload
from colonnade_lab.ppa.power.record import require_recordable
from colonnade_lab.ppa.power.report import node_scale
from colonnade_lab.ppa.power.sums import Sum, by_unit
from colonnade_lab.ppa.power.window import Window
from colonnade_lab.ppa.timing import opensta
from colonnade_lab.ppa.timing.delays import NetTiming


@pytest.fixture
def library(tmp_path: Path) -> Library:
    return small_library(tmp_path)


def test_energies_are_those_of_the_supply_rail(library: Library, tmp_path: Path) -> None:
    found = energies.load([tmp_path / "small.lib"], ["INV", "DFFN"])
    assert found.voltage == 2
    assert set(found.cells) == {"INV", "DFFN"}
    inverter = found.cells["INV"]
    assert inverter.leakage == pytest.approx(5e-9)
    assert inverter.of_transition("Y", 0.0, 0.0) == pytest.approx(3e-3)
    assert inverter.of_transition("A", 0.0, 0.0) == 0


def test_power_is_capacitance_and_tables_times_transitions(library: Library, tmp_path: Path) -> None:
    inner = top({"g": cell("INV", A=4, Y=5)}, {"a": [4]}, {})
    cells = {
        "kept": cell("DFFN", C=2, D=4, Q=5),
        "right": cell("INV", A=5, Y=6),
        "below": {"type": "Unit", "connections": {"a": [6]}},
    }
    netlist = Netlist({"top": top(cells, {"a": [4]}, {}), "Unit": inner}, "top", library)
    found = energies.load([tmp_path / "small.lib"], ["INV", "DFFN"])
    timing = NetTiming([1] * netlist.size, [0.0] * netlist.size, [0.0] * netlist.size)
    changes = [0] * netlist.size
    (clock,) = (bit for bit in netlist.inputs["clock"] if not isinstance(bit, bool))
    changes[clock] = 20
    register = next(instance for instance in netlist.instances if instance.cell.is_register)
    changes[register.nets["Q"]] = 10
    power = power_of(netlist, found, timing, changes, cycles=10, megahertz=1000)
    # ½ · 1 fF · 4 V² = 2 fJ per transition; a clock pin: 2 + 1 fJ twice per cycle; an inverter's input: 2 fJ per cycle
    assert power[""].clock == pytest.approx(6e-3)
    assert power[""].dynamic == pytest.approx(6e-3 + 2e-3)
    assert power[""].leakage == pytest.approx(5e-9)
    assert power["Unit"].dynamic == 0
    assert power["Unit"].leakage == pytest.approx(5e-9)


def test_clock_gates_count_as_clock_power(library: Library, tmp_path: Path) -> None:
    cells = {"gate": cell("GATE", C=2, E=4, G=5), "kept": cell("DFFN", C=5, D=4, Q=6)}
    netlist = Netlist({"top": top(cells, {"e": [4]}, {"q": [6]})}, "top", library)
    found = energies.load([tmp_path / "small.lib"], ["GATE", "DFFN"])
    timing = NetTiming([1] * netlist.size, [0.0] * netlist.size, [0.0] * netlist.size)
    changes = [0] * netlist.size
    ((gated, _),) = netlist.clock_gates()
    (clock,) = (bit for bit in netlist.inputs["clock"] if not isinstance(bit, bool))
    changes[clock], changes[gated] = 20, 10
    power = power_of(netlist, found, timing, changes, cycles=10, megahertz=1000)[""]
    # The clock pin of the gate: 2 fJ twice per cycle; of the register: 3 fJ twice in every other cycle
    assert power.clock == power.dynamic == pytest.approx(4e-3 + 3e-3)


def test_power_belongs_to_the_innermost_unit() -> None:
    flat = Power(1.0, 2.0, 3.0)
    shader = "SequentialShader"
    owners = ("", "Queue", shader, f"{shader}/CosineUnit", f"{shader}/BounceUnit", f"{shader}/BounceUnit/Divider")
    for module, rest in (("TraversalUnit", "contexts"), ("PathUnit", "PathUnit")):
        found = by_unit(dict.fromkeys(owners, flat), module)
        assert {unit: power.clock for unit, power in found.items()} == {rest: 2, shader: 2, "BounceUnit": 2}


def test_a_path_unit_counts_with_the_rays_of_its_row() -> None:
    """The energies of all units add up to a ray's, with each part of a column counted once."""
    counts = {"pixels": 40, "rays": 60, "rays_in_box": 50, "hits": 20}
    shares = {"TraversalUnit": 1.0, "PathUnit": 0.2, "PathHits": 0.2}
    window = Window(10, 110, counts, traced=10, shares=shares, records_share=0.2)
    found = Sum(window, megahertz=200, scale=3)
    for module, owners in (("TraversalUnit", ("BoxUnit", "")), ("PathUnit", ("RtController", "")), ("PathHits", ("",))):
        powers = dict.fromkeys(owners, Power(0.5, 2.0, 0.25))
        still = dict.fromkeys(owners, Power(0.5, 1.0, 0.25))
        found.add(module, {"zero_delay": still, "glitch_aware": powers}, {("", "table"): 1.0})
    found.records = 0.5
    assert found.kinds() == {"own": pytest.approx(1.4), "records": 0.5}
    total = found.totals()["glitch_aware"]
    # Two owners of the traversal unit, and a fifth of three in the column
    assert total["dynamic_mw"] == pytest.approx(2 * 2.6)
    assert total["total_mw"] == pytest.approx(2.25 * 2.6 + 1.9)
    # 0.5 µs, 10 of the column's in-box rays and 12 of its rays
    assert total["energy_per_ray_nj"] == pytest.approx(total["total_mw"] * 0.5 / 10)
    assert total["energy_per_any_ray_nj"] == pytest.approx(total["total_mw"] * 0.5 / 12)
    units = found.units()
    assert set(units) == {"BoxUnit", "contexts", "RtController", "PathUnit", "PathHits"}
    assert units["PathHits"]["power_mw"] == pytest.approx((2.25 + 1.0) / 5)
    table = {"memory": "table", "power_mw": 1.0, "energy_per_ray_nj": pytest.approx(0.05)}
    assert found.memories()[0] == {"unit": "contexts"} | table
    assert sum(memory["power_mw"] for memory in found.memories()) == pytest.approx(1.4)
    for kind, of_kind in found.totals().items():
        energies = [unit["energy_per_ray_nj_at_28nm"][kind] for unit in units.values()]
        records = 0.5 * 0.5 / 10
        assert of_kind["at_28nm"]["energy_per_ray_nj"] == pytest.approx(sum(energies) + records)


def test_the_workload_is_checked_before_synthesis(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    manifest = manifest_for("tiny").manifest
    whole = FrameWorkload.of_benchmark("cube", None, 10)
    require_recordable(whole, manifest)
    assert whole.size_of(manifest) == (24, 18)
    with pytest.raises(UserError, match="answers no batches"):
        require_recordable(BatchWorkload(whole.mesh, KINDS[0], 64, 10), manifest)
    with pytest.raises(UserError, match="no mesh"):
        require_recordable(FrameWorkload.of_benchmark("no-such-mesh", None, 10), manifest)
    with pytest.raises(UserError, match="9999"):
        require_recordable(FrameWorkload.of_benchmark("cube", (9999, 10), 10), manifest)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UserError, match="no verilator found, which power"):
        require_recordable(FrameWorkload.of_benchmark("cube", None, 10), manifest)


def test_scaling_is_by_length_and_voltage() -> None:
    assert node_scale(0.49, 0.9) == pytest.approx(1)
    assert node_scale(0.49 / 4, 1.8) == pytest.approx(2 / 4)


def fake_sta(folder: Path, monkeypatch: pytest.MonkeyPatch, answer: str) -> None:
    """A stand-in for OpenSTA that stores its inputs and reports power."""
    program = folder / "sta"
    program.write_text(
        f'#!/bin/sh\ncp unit.v unit.saif "{folder}"\nif grep -q "info commands" script.tcl; then echo "{answer}"; fi\n'
        'if grep -q "^report_power" script.tcl; then\n'
        'echo "Power Power Power Power (mWatts)"; echo "Total 1.0e-01 2.0e-01 1.0e-03 3.01e-01 100.0%"; fi\n'
    )
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")


def test_a_newer_opensta_is_asked_for_power(library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake_sta(tmp_path, monkeypatch, "read_saif")
    assert opensta.reads_activities()
    netlist = Netlist({"top": top({"gate": cell("INV", A=4, Y=5)}, {"a": [4]}, {"z": [5]})}, "top", library)
    activity = Activity(10, (3,) * netlist.size, (3,) * netlist.size, (0.25,) * netlist.size, ())
    assert opensta.power(netlist, [tmp_path / "small.lib"], activity, 0.01, 200) == pytest.approx(0.301)
    saif = (tmp_path / "unit.saif").read_text()
    assert "(DURATION 50000)" in saif
    assert saif.count("(T0 37500) (T1 12500) (TX 0) (TC 3)") == netlist.size
    assert "INV g0 (.A(n" in (tmp_path / "unit.v").read_text()


def test_an_old_opensta_is_not_asked_for_power(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake_sta(tmp_path, monkeypatch, "")
    assert not opensta.reads_activities()


def test_a_wrong_size_is_one_line() -> None:
    result = CliRunner().invoke(cli, ["ppa", "--config", "tiny", "--size", "big"])
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1


@pytest.mark.matrix
def test_the_gates_of_tiny_do_what_the_rtl_does(tmp_path: Path) -> None:
    """A thousand cycles of a frame on the gate netlist; the replay compares all outputs with the RTL."""
    named = os.environ.get("COLONNADE_LIBERTY", "").split()
    if not named:
        pytest.skip("no standard cells: name their liberties in COLONNADE_LIBERTY, blanks between them")
    report = tmp_path / "ppa.json"
    arguments = [argument for file in named for argument in ("--liberty", file)]
    result = CliRunner().invoke(cli, ["ppa", "--config", "tiny", *arguments, "--cycles", "1000", "--json", str(report)])
    assert result.exit_code == 0, result.stderr
    assert "with glitches" in result.stdout
