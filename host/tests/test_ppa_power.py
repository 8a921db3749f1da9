"""Power: functions and energies of liberties, the simulator of gates, what is counted, and second opinions."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from colonnade.cli import cli
from colonnade.errors import UserError
from colonnade.ppa import energies, liberty, opensta
from colonnade.ppa.cells import Library
from colonnade.ppa.delays import NetTiming
from colonnade.ppa.functions import truth_table
from colonnade.ppa.hierarchy import Hierarchy
from colonnade.ppa.netlist import Netlist
from colonnade.ppa.power import power_of
from colonnade.ppa.power_report import node_scale
from colonnade.ppa.recording import Port, Recording
from colonnade.ppa.replay import Activity, replay

#: Energies at 2 V: 3 fJ for an output's change (4 and 2, at the supply alone), 1 fJ for a clock pin's; leakage 5 pW.
LIBERTY = """library (small) {
  time_unit : "1ps"; voltage_unit : "1V"; nom_voltage : 2; leakage_power_unit : "1pW"; capacitive_load_unit (1, ff);
  cell (INV) { area : 1; leakage_power () { value : 4; when : "A"; } leakage_power () { value : 6; when : "!A"; }
    pg_pin (VDD) { pg_type : primary_power; } pg_pin (VSS) { pg_type : primary_ground; }
    pin (A) { direction : input; capacitance : 1; }
    pin (Y) { direction : output; function : "(!A)";
      internal_power () { related_pin : "A"; related_pg_pin : VDD; rise_power (scalar) { values ("4"); }
        fall_power (scalar) { values ("2"); } }
      internal_power () { related_pin : "A"; related_pg_pin : VSS; rise_power (scalar) { values ("9"); }
        fall_power (scalar) { values ("9"); } } } }
  cell (XOR) { area : 2; pin (A) { direction : input; capacitance : 1; } pin (B) { direction : input; capacitance : 1; }
    pin (Y) { direction : output; function : "A ^ B"; } }
  cell (NAND) { area : 1; pin (A) { direction : input; } pin (B) { direction : input; }
    pin (Y) { direction : output; function : "!(A & B)"; } }
  cell (DFFN) { area : 9; ff (IQN, IQNN) { clocked_on : "C"; next_state : "!D"; }
    pin (C) { direction : input; capacitance : 1; internal_power () { rise_power (scalar) { values ("1"); }
      fall_power (scalar) { values ("1"); } } }
    pin (D) { direction : input; capacitance : 1; } pin (Q) { direction : output; function : "IQN"; } }
}
"""


@pytest.fixture
def library(tmp_path: Path) -> Library:
    (tmp_path / "small.lib").write_text(LIBERTY)
    (tmp_path / "pruned.lib").write_text(liberty.pruned(tmp_path / "small.lib"))
    return liberty.load([tmp_path / "pruned.lib"])


@pytest.fixture
def hierarchy(tmp_path: Path) -> Hierarchy:
    """With a memory of four words of two bits."""
    folder = tmp_path / "design"
    folder.mkdir()
    (folder / "table.sv").write_text("module table(\n  input clock\n);\n  table_ext table_ext (\nendmodule\n")
    (folder / "memories.json").write_text('[{"name": "table_ext", "depth": 4, "width": 2, "ports": ["rw"]}]')
    return Hierarchy(folder)


def cell(kind: str, **pins: int | str) -> dict[str, Any]:
    return {"type": kind, "connections": {pin: [net] for pin, net in pins.items()}}


def top(cells: dict[str, Any], inputs: dict[str, list[int]], outputs: dict[str, list[Any]]) -> dict[str, Any]:
    ports = {
        name: {"direction": "input", "bits": bits} for name, bits in {"clock": [2], "reset": [3], **inputs}.items()
    }
    ports |= {name: {"direction": "output", "bits": bits} for name, bits in outputs.items()}
    wires = [*(bits for each in cells.values() for bits in each["connections"].values())]
    numbers = sorted({bit for bits in wires for bit in bits if isinstance(bit, int)})
    names = {f"w{bit}": {"bits": [bit], "hide_name": 1} for bit in numbers}
    return {"ports": ports, "cells": cells, "netnames": names}


def recording(netlist: Netlist, cycles: list[tuple[int, int]]) -> Recording:
    def joined(ports: dict[str, Any]) -> tuple[Port, ...]:
        return tuple(Port(name, len(bits)) for name, bits in ports.items() if name != "clock")

    return Recording(joined(netlist.inputs), joined(netlist.outputs), tuple(cycles), 0, {}, {})


@pytest.mark.parametrize(
    ("function", "table"),
    [
        ("A", "0101"),
        ("!A + B'", "1110"),
        ("(A&!B) | (!A&B)", "0110"),
        ("A ^ B & A", "0100"),
        ("A B", "0001"),
        ("(A + B)'", "1000"),
        ("1", "1111"),
    ],
)
def test_functions_become_truth_tables(function: str, table: str) -> None:
    assert truth_table(function, ["A", "B"]) == table


@pytest.mark.parametrize("function", ["A &", "(A", "A ? B", "C", "A)"])
def test_what_is_no_function_is_refused(function: str) -> None:
    with pytest.raises(UserError, match="not understood"):
        truth_table(function, ["A", "B"])


def test_energies_are_those_at_the_supply(library: Library, tmp_path: Path) -> None:
    found = energies.load([tmp_path / "small.lib"], ["INV", "DFFN"])
    assert found.voltage == 2
    assert set(found.cells) == {"INV", "DFFN"}
    inverter = found.cells["INV"]
    assert inverter.leakage == pytest.approx(5e-9)
    assert inverter.of_transition("Y", 0.0, 0.0) == pytest.approx(3e-3)
    assert inverter.of_transition("A", 0.0, 0.0) == 0


def test_a_glitch_changes_a_net_twice_and_settles_nothing(library: Library, hierarchy: Hierarchy) -> None:
    cells = {"late": cell("INV", A=4, Y=5), "later": cell("INV", A=5, Y=6), "differ": cell("XOR", A=4, B=6, Y=7)}
    netlist = Netlist({"top": top(cells, {"a": [4]}, {"z": [7]})}, "top", library)
    (z,) = (bit for bit in netlist.outputs["z"] if not isinstance(bit, bool))
    (a,) = (bit for bit in netlist.inputs["a"] if not isinstance(bit, bool))
    delays = [20] * netlist.size
    seen = recording(netlist, [(0, 0), (1, 0), (0, 0), (0, 0)])
    activity = replay(netlist, hierarchy, delays, seen)
    assert (activity.changes[a], activity.settled[a], activity.high[a]) == (2, 2, 0.25)
    assert (activity.changes[z], activity.settled[z]) == (4, 0)
    # A pulse shorter than the gate's delay does not leave it
    delays[z] = 41
    assert replay(netlist, hierarchy, delays, seen).changes[z] == 0
    # Only the cycles from the second on
    assert replay(netlist, hierarchy, delays, seen, begin=2).changes[a] == 1


def test_registers_begin_with_zero_behind_their_inverter(library: Library, hierarchy: Hierarchy) -> None:
    cells = {"kept": cell("DFFN", C=2, D=4, Q=5), "right": cell("INV", A=5, Y=6), "ties": cell("NAND", A=6, B="1", Y=7)}
    netlist = Netlist({"top": top(cells, {"a": [4]}, {"q": [6, "1"], "n": [7]})}, "top", library)
    # q has the input of the cycle before, and a constant bit; n is its inverse
    seen = recording(netlist, [(a, (0b10 | q) << 1 | 1 - q) for a, q in ((0, 0), (1, 0), (0, 1), (1, 0))])
    activity = replay(netlist, hierarchy, [5] * netlist.size, seen)
    (clock,) = (bit for bit in netlist.inputs["clock"] if not isinstance(bit, bool))
    assert activity.changes[clock] == 8
    wrong = replace(seen, cycles=(*seen.cycles[:2], (0, 0b101), seen.cycles[3]))
    with pytest.raises(RuntimeError, match="differ from the RTL in cycle 2: q is 3, not 2"):
        replay(netlist, hierarchy, [5] * netlist.size, wrong)


def test_data_counts_where_its_stream_is_valid(library: Library, hierarchy: Hierarchy) -> None:
    ports = {"s_valid": [4], "s_bits_x": [5]}
    netlist = Netlist({"top": top({}, {"v": [4], "x": [5]}, ports)}, "top", library)
    # Inputs are reset, v, x; outputs valid, x
    invalid = recording(netlist, [(0b01, 0b00), (0b11, 0b11)])
    replay(netlist, hierarchy, [1] * netlist.size, invalid)
    with pytest.raises(RuntimeError, match="cycle 1: s_bits_x is 1, not 0"):
        replay(netlist, hierarchy, [1] * netlist.size, replace(invalid, cycles=((0b01, 0b00), (0b11, 0b10))))


def test_a_memory_shows_what_was_written_and_counts(library: Library, hierarchy: Hierarchy) -> None:
    bits = {
        "RW0_addr": [4, 5],
        "RW0_en": [6],
        "RW0_clk": [2],
        "RW0_wmode": [7],
        "RW0_wdata": [8, 9],
        "RW0_rdata": [10, 11],
    }
    directions = {port: "output" if port == "RW0_rdata" else "input" for port in bits}
    box = {"type": "table", "connections": bits, "port_directions": directions}
    inputs = {"address": [4, 5], "enable": [6], "writes": [7], "data": [8, 9]}
    netlist = Netlist({"top": top({"box": box}, inputs, {"out": [10, 11]})}, "top", library)

    def joined(address: int, enable: int, writes: int, data: int) -> int:
        return address << 4 | enable << 3 | writes << 2 | data

    steps = [joined(0, 0, 0, 0), joined(2, 1, 1, 3), joined(2, 1, 0, 0), joined(1, 1, 0, 0), joined(2, 0, 1, 1)]
    seen = recording(netlist, list(zip(steps, [0, 0, 0, 3, 0], strict=True)))
    activity = replay(netlist, hierarchy, [1] * netlist.size, seen)
    assert activity.accesses == ((2, 1),)


def test_a_net_without_a_driver_fails(library: Library, hierarchy: Hierarchy) -> None:
    netlist = Netlist({"top": top({"gate": cell("INV", A=8, Y=5)}, {}, {"z": [5]})}, "top", library)
    with pytest.raises(RuntimeError, match="1 nets of the gates have no driver"):
        replay(netlist, hierarchy, [1] * netlist.size, recording(netlist, [(0, 0)]))


def test_power_is_capacitance_and_tables_times_changes(library: Library, tmp_path: Path) -> None:
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
    # ½ · 1 fF · 4 V² = 2 fJ a pin's change; a clock pin 2 + 1 fJ twice a cycle; an inverter's input, 2 fJ each cycle
    assert power[""].clock == pytest.approx(6e-3)
    assert power[""].dynamic == pytest.approx(6e-3 + 2e-3)
    assert power[""].leakage == pytest.approx(5e-9)
    assert power["Unit"].dynamic == 0
    assert power["Unit"].leakage == pytest.approx(5e-9)


def test_scaling_is_by_length_and_voltage() -> None:
    assert node_scale(0.49, 0.9) == pytest.approx(1)
    assert node_scale(0.49 / 4, 1.8) == pytest.approx(2 / 4)


def fake_sta(folder: Path, monkeypatch: pytest.MonkeyPatch, answer: str) -> None:
    """An OpenSTA that keeps what it is given and answers to power."""
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
    """A thousand cycles of a real frame on the gates; every output as in the RTL, or it fails."""
    named = os.environ.get("COLONNADE_LIBERTY", "").split()
    if not named:
        pytest.skip("no standard cells: name their liberties in COLONNADE_LIBERTY, blanks between them")
    report = tmp_path / "ppa.json"
    arguments = [argument for file in named for argument in ("--liberty", file)]
    result = CliRunner().invoke(cli, ["ppa", "--config", "tiny", *arguments, "--cycles", "1000", "--json", str(report)])
    assert result.exit_code == 0, result.stderr
    assert "with glitches" in result.stdout
