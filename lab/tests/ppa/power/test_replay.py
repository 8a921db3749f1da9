"""The gate simulator: functions, glitches, registers, memories, and the comparison with a recording."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from colonnade.common.errors import UserError
from small_gates import cell, recording, small_hierarchy, small_library, top

from colonnade_lab.ppa.library.cells import Library
from colonnade_lab.ppa.library.functions import truth_table
from colonnade_lab.ppa.netlist.hierarchy import Hierarchy
from colonnade_lab.ppa.netlist.mapped import Netlist
from colonnade_lab.ppa.power.replay import replay


@pytest.fixture
def library(tmp_path: Path) -> Library:
    return small_library(tmp_path)


@pytest.fixture
def hierarchy(tmp_path: Path) -> Hierarchy:
    return small_hierarchy(tmp_path)


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
def test_an_invalid_function_is_rejected(function: str) -> None:
    with pytest.raises(UserError, match="cannot parse"):
        truth_table(function, ["A", "B"])


def test_a_glitch_counts_two_transitions_and_none_settled(library: Library, hierarchy: Hierarchy) -> None:
    cells = {"late": cell("INV", A=4, Y=5), "later": cell("INV", A=5, Y=6), "differ": cell("XOR", A=4, B=6, Y=7)}
    netlist = Netlist({"top": top(cells, {"a": [4]}, {"z": [7]})}, "top", library)
    (z,) = (bit for bit in netlist.outputs["z"] if not isinstance(bit, bool))
    (a,) = (bit for bit in netlist.inputs["a"] if not isinstance(bit, bool))
    delays = [20] * netlist.size
    seen = recording(netlist, [(0, 0), (1, 0), (0, 0), (0, 0)])
    activity = replay(netlist, hierarchy, delays, seen)
    assert (activity.changes[a], activity.settled[a], activity.high[a]) == (2, 2, 0.25)
    assert (activity.changes[z], activity.settled[z]) == (4, 0)
    # The gate suppresses a pulse that is shorter than its delay
    delays[z] = 41
    assert replay(netlist, hierarchy, delays, seen).changes[z] == 0
    # Counts from the second cycle on
    assert replay(netlist, hierarchy, delays, seen, begin=2).changes[a] == 1


def test_registers_with_inverters_start_at_zero(library: Library, hierarchy: Hierarchy) -> None:
    cells = {"kept": cell("DFFN", C=2, D=4, Q=5), "right": cell("INV", A=5, Y=6), "ties": cell("NAND", A=6, B="1", Y=7)}
    netlist = Netlist({"top": top(cells, {"a": [4]}, {"q": [6, "1"], "n": [7]})}, "top", library)
    # q is the input of the previous cycle and a constant bit; n is its inverse
    seen = recording(netlist, [(a, (0b10 | q) << 1 | 1 - q) for a, q in ((0, 0), (1, 0), (0, 1), (1, 0))])
    activity = replay(netlist, hierarchy, [5] * netlist.size, seen)
    (clock,) = (bit for bit in netlist.inputs["clock"] if not isinstance(bit, bool))
    assert activity.changes[clock] == 8
    wrong = replace(seen, cycles=(*seen.cycles[:2], (0, 0b101), seen.cycles[3]))
    with pytest.raises(RuntimeError, match="differ from the RTL in cycle 2: q is 3, not 2"):
        replay(netlist, hierarchy, [5] * netlist.size, wrong)


def test_a_register_behind_a_clock_gate_keeps_its_value(library: Library, hierarchy: Hierarchy) -> None:
    cells = {
        "gate": cell("GATE", C=2, E=5, G=6),
        "kept": cell("DFFN", C=6, D=4, Q=7),
        "right": cell("INV", A=7, Y=8),
    }
    netlist = Netlist({"top": top(cells, {"a": [4], "e": [5]}, {"q": [8]})}, "top", library)
    # Inputs are reset, a, e; q is the last a with e set
    steps = [(0b00, 0), (0b11, 0), (0b00, 1), (0b10, 1), (0b01, 1), (0b10, 0)]
    seen = recording(netlist, steps)
    activity = replay(netlist, hierarchy, [5] * netlist.size, seen)
    ((gated, enable),) = netlist.clock_gates()
    assert netlist.inputs["e"] == [enable]
    assert (activity.changes[gated], activity.settled[gated]) == (4, 4)
    wrong = replace(seen, cycles=(*steps[:3], (0b10, 0), *steps[4:]))
    with pytest.raises(RuntimeError, match="cycle 3: q is 1, not 0"):
        replay(netlist, hierarchy, [5] * netlist.size, wrong)


def test_a_gate_of_another_clock_is_refused(library: Library, hierarchy: Hierarchy) -> None:
    cells = {"gate": cell("GATE", C=4, E=5, G=6), "kept": cell("DFFN", C=6, D=4, Q=7)}
    netlist = Netlist({"top": top(cells, {"a": [4], "e": [5]}, {"q": [7]})}, "top", library)
    with pytest.raises(RuntimeError, match="not driven by the port clock"):
        replay(netlist, hierarchy, [5] * netlist.size, recording(netlist, [(0, 0)]))


def test_stream_data_is_compared_only_where_valid(library: Library, hierarchy: Hierarchy) -> None:
    ports = {"s_valid": [4], "s_bits_x": [5]}
    netlist = Netlist({"top": top({}, {"v": [4], "x": [5]}, ports)}, "top", library)
    # Inputs are reset, v, x; outputs valid, x
    invalid = recording(netlist, [(0b01, 0b00), (0b11, 0b11)])
    replay(netlist, hierarchy, [1] * netlist.size, invalid)
    with pytest.raises(RuntimeError, match="cycle 1: s_bits_x is 1, not 0"):
        replay(netlist, hierarchy, [1] * netlist.size, replace(invalid, cycles=((0b01, 0b00), (0b11, 0b10))))


def test_a_memory_returns_written_words_and_counts_accesses(library: Library, hierarchy: Hierarchy) -> None:
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


def test_a_read_port_without_an_enable_reads_in_every_cycle(library: Library, hierarchy: Hierarchy) -> None:
    bits = {"R0_addr": [4, 5], "R0_clk": [2], "R0_data": [6, 7]}
    directions = {port: "output" if port == "R0_data" else "input" for port in bits}
    box = {"type": "table", "connections": bits, "port_directions": directions}
    netlist = Netlist({"top": top({"box": box}, {"address": [4, 5]}, {"out": [6, 7]})}, "top", library)
    activity = replay(netlist, hierarchy, [1] * netlist.size, recording(netlist, [(0, 0)] * 3))
    assert activity.accesses == ((3, 0),)


def test_a_net_without_a_driver_fails(library: Library, hierarchy: Hierarchy) -> None:
    netlist = Netlist({"top": top({"gate": cell("INV", A=8, Y=5)}, {}, {"z": [5]})}, "top", library)
    with pytest.raises(RuntimeError, match="1 nets of the gate netlist have no driver"):
        replay(netlist, hierarchy, [1] * netlist.size, recording(netlist, [(0, 0)]))
