"""A small cell library and its netlists, for the tests of power and replay."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from colonnade_lab.ppa.library import liberty, liberty_files
from colonnade_lab.ppa.library.cells import Library
from colonnade_lab.ppa.netlist.hierarchy import Hierarchy
from colonnade_lab.ppa.netlist.mapped import Netlist
from colonnade_lab.ppa.power.recording import Port, Recording

#: At 2 V: 3 fJ per output transition (rise 4, fall 2, supply rail only), 1 fJ per clock transition, 5 pW of leakage.
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
  cell (GATE) { area : 4; clock_gating_integrated_cell : "latch_posedge"; statetable ("C E", "M") { }
    pin (C) { direction : input; capacitance : 1; clock_gate_clock_pin : true; }
    pin (E) { direction : input; capacitance : 1; clock_gate_enable_pin : true; timing () { related_pin : "C";
      timing_type : setup_rising; rise_constraint (scalar) { values ("7"); } } }
    pin (G) { direction : output; clock_gate_out_pin : true; state_function : "C & M"; } }
}
"""


def small_library(tmp_path: Path) -> Library:
    """The cells of `LIBERTY`, written to ``small.lib`` in `tmp_path`."""
    (tmp_path / "small.lib").write_text(LIBERTY)
    (tmp_path / "pruned.lib").write_text(liberty_files.pruned(tmp_path / "small.lib"))
    return liberty.load([tmp_path / "pruned.lib"])


def small_hierarchy(tmp_path: Path) -> Hierarchy:
    """A hierarchy with a memory of four words of two bits."""
    folder = tmp_path / "design"
    folder.mkdir()
    (folder / "table.sv").write_text("module table(\n  input clock\n);\n  table_ext table_ext (\nendmodule\n")
    (folder / "memories.json").write_text('[{"name": "table_ext", "depth": 4, "width": 2, "ports": ["rw"]}]')
    return Hierarchy(folder)


def cell(kind: str, **pins: int | str) -> dict[str, Any]:
    """A cell in Yosys's JSON; the value of a pin is a net number or a constant."""
    return {"type": kind, "connections": {pin: [net] for pin, net in pins.items()}}


def top(cells: dict[str, Any], inputs: dict[str, list[int]], outputs: dict[str, list[Any]]) -> dict[str, Any]:
    """A module in Yosys\'s JSON, with clock (net 2) and reset (net 3)."""
    ports = {
        name: {"direction": "input", "bits": bits} for name, bits in {"clock": [2], "reset": [3], **inputs}.items()
    }
    ports |= {name: {"direction": "output", "bits": bits} for name, bits in outputs.items()}
    wires = [*(bits for each in cells.values() for bits in each["connections"].values())]
    numbers = sorted({bit for bits in wires for bit in bits if isinstance(bit, int)})
    names = {f"w{bit}": {"bits": [bit], "hide_name": 1} for bit in numbers}
    return {"ports": ports, "cells": cells, "netnames": names}


def recording(netlist: Netlist, cycles: list[tuple[int, int]]) -> Recording:
    """A recording at the ports of a netlist, from the concatenated inputs and outputs of each cycle."""

    def joined(ports: dict[str, Any]) -> tuple[Port, ...]:
        return tuple(Port(name, len(bits)) for name, bits in ports.items() if name != "clock")

    return Recording(joined(netlist.inputs), joined(netlist.outputs), tuple(cycles), 0, {})
