"""Area and timing: liberty files, timing analysis, hierarchy, and the recorded gate counts of `tiny`."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from colonnade.cli.main import cli
from colonnade.common.errors import UserError

from colonnade_lab.ppa import measure
from colonnade_lab.ppa.library import liberty, liberty_files
from colonnade_lab.ppa.library.cells import Library, LookupTable
from colonnade_lab.ppa.netlist import memories
from colonnade_lab.ppa.netlist.hierarchy import BOUNDARIES, LEVELS, Hierarchy, Memory
from colonnade_lab.ppa.netlist.mapped import Netlist
from colonnade_lab.ppa.netlist.synthesis import Technology, count_gates
from colonnade_lab.ppa.studies.guard import differences, gates_of_tiny
from colonnade_lab.ppa.timing import opensta
from colonnade_lab.ppa.timing.static import Analysis

GUARD = Path(__file__).parent / "tiny.json"

#: Timing arc of a gate: delay = 10 ps + 2 × slew + 1 ps per fF; output slew 5 ps.
ARC = """timing () { related_pin : "%s"; timing_sense : %s;
  cell_rise (t) { index_1 ("0, 100"); index_2 ("0, 10"); values ("10, 20", "210, 220"); }
  cell_fall (t) { index_1 ("0, 100"); index_2 ("0, 10"); values ("10, 20", "210, 220"); }
  rise_transition (t) { values ("5, 5", "5, 5"); index_1 ("0, 100"); index_2 ("0, 10"); }
  fall_transition (t) { values ("5, 5", "5, 5"); index_1 ("0, 100"); index_2 ("0, 10"); } }"""

LIBERTY = f"""/* small */ library (small) {{
  delay_model : table_lookup; time_unit : "1ps"; capacitive_load_unit (1, ff);
  lu_table_template (t) {{ variable_1 : input_net_transition; variable_2 : total_output_net_capacitance;
    index_1 ("0, 100"); index_2 ("0, 10"); }}
  lu_table_template (s) {{ variable_1 : related_pin_transition; variable_2 : constrained_pin_transition;
    index_1 ("0, 100"); index_2 ("0, 100"); }}
  cell (NAND) {{ area : 2; leakage_power () {{ value : 1; }}
    pin (A) {{ direction : input; capacitance : 1; }} pin (B) {{ direction : input; capacitance : 1; }}
    pin (Y) {{ direction : output; function : "!(A & B)";
      {ARC % ("A", "negative_unate")} {ARC % ("B", "negative_unate")} }} }}
  cell (ANDB) {{ area : 1; pin (A) {{ direction : input; }} pin (B) {{ direction : input; }}
    pin (Y) {{ direction : output; function : "(!A) & B"; }} }}
  cell (INV) {{ area : 1; pin (A) {{ direction : input; capacitance : 1; }}
    pin (Y) {{ direction : output; function : "(!A)"; {ARC % ("A", "negative_unate")} }} }}
  cell (OLD) {{ area : 1; dont_use : true; }}
  cell (SDFQ) {{ area : 1; }}
  cell (DFF) {{ area : 9; ff (I, N) {{ clocked_on : "C"; next_state : "D"; }}
    pin (C) {{ direction : input; clock : true; }}
    pin (D) {{ direction : input; capacitance : 1; timing () {{ related_pin : "C"; timing_type : setup_rising;
      rise_constraint (s) {{ values ("3, 4", "3, 4"); }} fall_constraint (s) {{ values ("3, 4", "3, 4"); }} }} }}
    pin (Q) {{ direction : output; function : "I";
      {(ARC % ("C", "non_unate")).replace("timing_sense", "timing_type : rising_edge; timing_sense")} }} }}
  cell (GATE) {{ area : 4; clock_gating_integrated_cell : latch_posedge; statetable ("C E", "M") {{ }}
    pin (C) {{ direction : input; clock_gate_clock_pin : true; }}
    pin (E) {{ direction : input; clock_gate_enable_pin : true; timing () {{ related_pin : "C";
      timing_type : setup_rising; rise_constraint (s) {{ values ("7, 7", "7, 7"); }} }} }}
    pin (G) {{ direction : output; clock_gate_out_pin : true; state_function : "C & M"; }} }}
}}
"""


@pytest.fixture
def small(tmp_path: Path) -> Library:
    (tmp_path / "small.lib").write_text(LIBERTY)
    (tmp_path / "pruned.lib").write_text(liberty_files.pruned(tmp_path / "small.lib"))
    return liberty.load([tmp_path / "pruned.lib"])


def test_tables_interpolate_and_extrapolate() -> None:
    table = LookupTable((0.0, 1.0), (0.0, 2.0), ((0.0, 2.0), (1.0, 3.0)))
    assert table.at(0.5, 1.0) == pytest.approx(1.5)
    assert table.at(2.0, 4.0) == pytest.approx(6.0)
    assert LookupTable((0.0,), (0.0,), ((7.0,),)).at(3.0, 4.0) == 7.0


def test_a_liberty_is_read_in_ns_and_pf(small: Library) -> None:
    assert set(small.cells) == {"NAND", "ANDB", "INV", "DFF", "GATE"}
    assert small.nand2.name == "NAND"
    assert small.inverter.name == "INV"
    assert small.cells["DFF"].is_register
    assert small.cells["NAND"].pins["A"].capacitance == pytest.approx(0.001)


def test_fan_out_of_four_is_that_of_the_tables(small: Library) -> None:
    assert small.fo4 == pytest.approx((10 + 2 * 5 + 4) * 1e-3)


def cell(kind: str, **pins: int) -> dict[str, Any]:
    return {"type": kind, "connections": {pin: [net] for pin, net in pins.items()}}


def module(cells: dict[str, Any], names: dict[str, int]) -> dict[str, Any]:
    ports = {
        "a": {"direction": "input", "bits": [3]},
        "clock": {"direction": "input", "bits": [2]},
        "z": {"direction": "output", "bits": [9]},
    }
    return {"ports": ports, "cells": cells, "netnames": {name: {"bits": [net]} for name, net in names.items()}}


def test_paths_run_from_clock_to_set_up(small: Library) -> None:
    cells = {
        "first": cell("DFF", C=2, D=3, Q=4),
        "gate": cell("NAND", A=4, B=3, Y=5),
        "second": cell("DFF", C=2, D=5, Q=9),
    }
    names = {"begins": 4, "between": 5, "z": 9}
    timing = Analysis(Netlist({"top": module(cells, names)}, "top", small), small).timing()
    path = timing.register_to_register
    assert path is not None
    assert (path.begin, path.end, path.cells) == ("begins", "z", ("NAND",))
    # The slew of the clock is 5 ps: 10 + 10 + 1 to the NAND, 10 + 10 + 1 through it, 3.05 of set-up.
    assert path.ns == pytest.approx((21 + 21 + 3.05) * 1e-3)
    assert timing.input_to_register is not None
    assert timing.input_to_register.begin == "a"
    assert timing.register_to_output is not None
    assert timing.register_to_output.ns == pytest.approx((10 + 10 + 4) * 1e-3)
    assert timing.input_to_output is None


def test_a_path_crosses_modules_and_wires_straight_through_them(small: Library) -> None:
    inner = module({"gate": cell("INV", A=3, Y=7)}, {})
    inner["ports"]["z"]["bits"] = [7]
    inner["ports"]["same"] = {"direction": "output", "bits": [7]}
    cells = {
        "first": cell("DFF", C=2, D=3, Q=4),
        "inside": cell("inner", clock=2, a=4, z=5, same=6),
        "one": cell("DFF", C=2, D=5, Q=8),
        "other": cell("DFF", C=2, D=6, Q=9),
    }
    netlist = Netlist({"top": module(cells, {"begins": 4, "p": 5, "q": 6, "r": 8}), "inner": inner}, "top", small)
    path = Analysis(netlist, small).timing().register_to_register
    assert path is not None
    # Both registers load the inverter
    assert path.ns == pytest.approx((21 + 22 + 3.05) * 1e-3)


def test_register_outputs_are_named_after_the_register(small: Library) -> None:
    cells = {
        "first_register": cell("DFF", C=2, D=3, Q=4),
        "gate": cell("INV", A=4, Y=5),
        "last_register": cell("DFF", C=2, D=5, Q=9),
    }
    inside = module(cells, {"hidden": 4, "h": 5})
    inside["ports"]["z"]["bits"] = [9]
    for name in inside["netnames"].values():
        name["hide_name"] = 1
    outside = module({"unit": cell("inner", clock=2, a=3, z=7)}, {"x": 7})
    path = Analysis(Netlist({"top": outside, "inner": inside}, "top", small), small).timing().register_to_register
    assert path is not None
    assert (path.begin, path.end) == ("unit.first", "unit.last")


@pytest.mark.parametrize(("top", "column"), [("Colonnade", "Column"), ("ColonnadeRays", "RayColumn")])
def test_synthesis_stops_at_units(tmp_path: Path, top: str, column: str) -> None:
    sources = {
        top: f"  {column} columns_0 (\n  {column} columns_1 (\n",
        column: "  TraversalUnit a (\n  TraversalUnit b (\n  records records_0 (\n  Arbiter arbiter (\n",
        "TraversalUnit": "  BoxUnit boxUnit (\n  Queue queue (\n  FetchStage fetch (\n",
        "BoxUnit": "  Divider one (\n  Divider other (\n",
        "FetchStage": "  RecordFetch one (\n  RecordFetch other (\n",
        "RecordFetch": "  rays rays_0 (\n",
        "rays": "  rays_ext rays_ext (\n",
        "records": "  records_ext records_ext (\n",
        "Arbiter": "",
        "Queue": "",
        "Divider": "",
    }
    for name, body in sources.items():
        (tmp_path / f"{name}.sv").write_text(f"module {name}(\n  input clock\n);\n{body}endmodule\n")
    shape = {"name": "records_ext", "depth": 8, "width": 4, "ports": ["rw"], "maskBits": None}
    (tmp_path / "memories.json").write_text(json.dumps([shape, shape | {"name": "rays_ext"}]))
    hierarchy = Hierarchy(tmp_path)
    assert hierarchy.closure("TraversalUnit") == (["FetchStage", "Queue", "TraversalUnit"], ["BoxUnit", "RecordFetch"])
    assert hierarchy.closure("BoxUnit") == (["BoxUnit"], ["Divider"])
    assert hierarchy.parts("BoxUnit") == {"Divider": 2}
    assert hierarchy.parts("TraversalUnit") == {}
    assert hierarchy.shape("records") == (8, 4)
    assert hierarchy.closure(column) == (["Arbiter", column], ["TraversalUnit", "records"])
    assert hierarchy.count("BoxUnit", top) == 4
    assert hierarchy.count("BoxUnit", top, BOUNDARIES) == 0
    assert hierarchy.header("Queue") == "module Queue(\n  input clock\n);\nendmodule\n"
    assert [hierarchy.instances(unit, LEVELS[0]) for unit in ("TraversalUnit", "BoxUnit", "RecordFetch")] == [1, 1, 2]
    rays, records = hierarchy.memories()
    assert (rays.level, rays.unit, rays.count) == ("traversal_unit", "RecordFetch", 2)
    assert (records.level, records.unit, records.count, records.bits) == ("column", f"rest of {column}", 1, 32)


def test_flip_flops_and_their_clock_gate_are_counted(small: Library) -> None:
    gate = small.cells["GATE"].clock_gate
    assert gate is not None
    assert (gate.clock, gate.enable, gate.gated) == ("C", "E", "G")
    assert small.has_clock_gates
    assert small.cells["DFF"].clock_gate is None
    cells = {"gate": cell("GATE", C=2, E=5, G=6), "kept": cell("DFF", C=6, D=4, Q=7), "not": cell("INV", A=7, Y=8)}
    gates = count_gates({"cells": cells}, Technology(small, "", None))
    assert (gates.registers, gates.combinational, gates.flops) == (13 / 2, 1 / 2, 1)


def test_enables_of_clock_gates_have_set_up_times(small: Library) -> None:
    cells = {"gate": cell("GATE", C=2, E=3, G=5), "kept_register": cell("DFF", C=5, D=4, Q=9)}
    netlist = Netlist({"top": module(cells, {"d": 4, "g": 5})}, "top", small)
    path = Analysis(netlist, small).timing().input_to_register
    assert path is not None
    assert path.ns == pytest.approx(7e-3)
    assert path.end == "clock of kept"


def test_a_register_file_costs_more_per_bit_than_a_macro() -> None:
    small, large = (Memory("m", "traversal_unit", "contexts", 2, depth, 10, "write,read") for depth in (12, 576))
    assert memories.area_um2(small) == pytest.approx(2 * 120 * 1.0)
    assert memories.area_um2(large) == pytest.approx(2 * 5760 * 0.19)
    assert memories.describe(small)["kge"] == pytest.approx(240 / 0.49 / 1e3)
    assert memories.area_mm2(1.0, 510.0) == pytest.approx(1e-3)


def test_the_chip_has_141_kge_per_unit() -> None:
    assert memories.chip_unit_kge() == pytest.approx(141, abs=0.5)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--liberty", "none.lib"), "no liberty none.lib"),
        (("--delay", "1"), "--delay needs --liberty"),
        (("--target", "ecp5", "--delay", "1"), "takes none of --liberty, --delay and --rates"),
        (("--delay", "0"), "--delay"),
    ],
)
def test_wrong_input_is_one_line(monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], message: str) -> None:
    monkeypatch.setattr(measure, "require_yosys", lambda: None)
    result = CliRunner().invoke(cli, ["ppa", "--config", "tiny", *arguments])
    assert result.exit_code == 2
    assert message in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_a_changed_area_is_reported() -> None:
    recorded = {"BoxUnit": 10.0, "Shader": 20.0, "old": 1.0}
    reported = differences(recorded, {"BoxUnit": 10.15, "Shader": 21.0, "new": 1.0})
    assert reported == ["new is new", "old is missing", "Shader has 21.00 kGE instead of 20.00 (+5.0%)"]


@pytest.mark.skipif(not opensta.is_available(), reason="OpenSTA is not installed")
def test_opensta_finds_the_same_path(small: Library) -> None:
    cells = {"first": cell("DFF", C=2, D=3, Q=4), "gate": cell("INV", A=4, Y=5), "second": cell("DFF", C=2, D=5, Q=9)}
    top = module(cells, {"begins": 4, "between": 5, "z": 9})
    netlist = Netlist({"top": top}, "top", small)
    analysis = Analysis(netlist, small)
    path = analysis.timing().register_to_register
    assert path is not None
    assert opensta.register_to_register(netlist, small, analysis.slew, analysis.output_load) == pytest.approx(
        path.ns, 1e-3
    )


def test_missing_yosys_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    result = CliRunner().invoke(cli, ["ppa", "--config", "tiny"])
    assert result.exit_code == 2
    assert "tools/environment ppa" in result.stderr


@pytest.mark.parametrize("text", ["", "library (a) {", "no cells"])
def test_an_invalid_liberty_is_rejected(tmp_path: Path, text: str) -> None:
    (tmp_path / "bad.lib").write_text(text)
    with pytest.raises(UserError, match="liberty"):
        liberty_files.pruned(tmp_path / "bad.lib")


@pytest.mark.matrix
@pytest.mark.skipif(importlib.util.find_spec("pyosys") is None, reason="no Yosys: run tools/environment ppa")
def test_gates_of_tiny_match_the_recorded_ones() -> None:
    """Detects unintended changes of the area; `tools/figures gates` records new values."""

    changed = differences(json.loads(GUARD.read_text()), gates_of_tiny())
    assert not changed, (
        f"{'; '.join(changed)}: if that is meant, run tools/figures gates and commit lab/tests/ppa/tiny.json"
    )
