"""Mutants of a unit at its ports."""

from __future__ import annotations

from pathlib import Path

import pytest
from colonnade.common.errors import UserError

from colonnade_lab.common import yosys
from colonnade_lab.units.mutants import survey
from colonnade_lab.units.verilog import Modules

try:
    yosys.abc_program()
except UserError:
    pytest.skip("no Yosys: run tools/environment proof", allow_module_level=True)

UNIT = """module Adder(
  input        clock,
               reset,
  input  [7:0] io_a,
               io_b,
  output [7:0] io_sum
);

  reg [7:0] sum;
  always @(posedge clock)
    sum <= reset ? 8'h0 : io_a + io_b;
  assign io_sum = (sum == 8'h0 & |sum) ? 8'h1 : sum;
endmodule
"""


@pytest.mark.verilator
def test_mutants_are_told_apart_or_proved_equivalent(tmp_path: Path) -> None:
    (tmp_path / "Adder.sv").write_text(UNIT)
    found = survey(Modules(tmp_path), "Adder", count=30, seed=1, cycles=2000, limit=20)
    assert len(found.classes) == 30
    # The condition is never true: some mutants of it are equivalent. Those of the sum are not
    assert found.counts["equivalent"] > 0 and found.counts["random"] > 10 and not found.counts["open"]
    assert all(kind == "random" for kind, change in found.classes.values() if "$add" in change)


def test_a_unit_of_wires_has_no_mutants(tmp_path: Path) -> None:
    (tmp_path / "Wires.sv").write_text(
        "module Wires(\n  input  io_a,\n  output io_b\n);\n\n  assign io_b = io_a;\nendmodule\n"
    )
    assert not survey(Modules(tmp_path), "Wires", count=9, seed=1, cycles=20, limit=20).classes
