"""Units of two designs at their ports."""

from __future__ import annotations

from pathlib import Path

import pytest
from colonnade.common.errors import UserError

from colonnade_lab.common import yosys
from colonnade_lab.units.compare import Verdict, compare, report
from colonnade_lab.units.verilog import Modules

try:
    yosys.abc_program()
except UserError:
    pytest.skip("no Yosys: run tools/environment proof", allow_module_level=True)

#: A counter that a stream asks, in a device.
COUNTER = """module Counter(
  input        clock,
               reset,
  output       io_in_ready,
  input        io_in_valid,
  input  [7:0] io_in_bits,
  input        io_out_ready,
  output       io_out_valid,
  output [7:0] io_out_bits
);

  reg  [7:0] sum;
  reg        full;
  always @(posedge clock) begin
    if (reset) begin
      sum <= 8'h0;
      full <= 1'h0;
    end
    else begin
      if (io_in_valid & ~full)
        sum <= {sum};
      full <= full ? ~io_out_ready : io_in_valid;
    end
  end
  assign io_in_ready = ~full;
  assign io_out_valid = full;
  assign io_out_bits = {out};
endmodule
"""
DEVICE = """module Device(
  input        clock,
               reset,
  input        io_in_valid,
  input  [7:0] io_in_bits,
  output [7:0] io_sum
);

  wire [7:0] _counter_io_out_bits;
  wire       _counter_io_out_valid;
  Counter counter (
    .clock        (clock),
    .reset        (reset),
    .io_in_ready  (/* unused */),
    .io_in_valid  (io_in_valid),
    .io_in_bits   (io_in_bits),
    .io_out_ready (1'h1),
    .io_out_valid (_counter_io_out_valid),
    .io_out_bits  (_counter_io_out_bits)
  );
  assign io_sum = {sum};
endmodule
"""
SUM = "sum + io_in_bits"
GATED = "_counter_io_out_valid ? _counter_io_out_bits : 8'h0"


def design(folder: Path, sum_: str = SUM, out: str = "sum", device: str = GATED) -> Modules:
    """A design with these expressions."""
    folder.mkdir()
    for name, text in (("Counter", COUNTER), ("Device", DEVICE)):
        for key, value in (("{sum}", device if name == "Device" else sum_), ("{out}", out)):
            text = text.replace(key, value)
        (folder / f"{name}.sv").write_text(text)
    return Modules(folder)


def verdicts(before: Modules, after: Modules) -> dict[str, Verdict]:
    return {one.unit: one for one in compare(before, after, cycles=2000, limit=20)}


@pytest.fixture
def before(tmp_path: Path) -> Modules:
    return design(tmp_path / "before")


def test_what_did_not_change_is_not_compared(before: Modules, tmp_path: Path) -> None:
    assert not verdicts(before, design(tmp_path / "after"))


def test_another_text_of_the_same_unit_is_proved_equal(before: Modules, tmp_path: Path) -> None:
    after = design(tmp_path / "after", sum_="io_in_bits - ~sum - 8'h1")
    found = verdicts(before, after)
    # The device has the same text, and equal parts
    assert found == {"Counter": Verdict("Counter", "equal", before.digest("Counter"), after.digest("Counter"))}
    assert report(list(found.values()), "Device")["isEqual"]


def test_the_first_difference_is_named_in_each_module_around_it(before: Modules, tmp_path: Path) -> None:
    found = verdicts(before, design(tmp_path / "after", sum_="sum + (io_in_bits | 8'h1)"))
    assert {name: (one.verdict, one.detail.split()[-1]) for name, one in found.items()} == {
        "Counter": ("different", "io_out_bits"),
        "Device": ("different", "io_sum"),
    }
    assert not report(list(found.values()), "Device")["isEqual"]


def test_data_count_only_while_they_are_valid(before: Modules, tmp_path: Path) -> None:
    found = verdicts(before, design(tmp_path / "after", out="full ? sum : 8'hFF"))
    assert [one.verdict for one in found.values()] == ["equal"]


def test_a_unit_may_differ_where_the_device_does_not(before: Modules, tmp_path: Path) -> None:
    # The device always takes what the counter offers
    after = design(tmp_path / "after")
    after.texts["Counter"] = after.texts["Counter"].replace("full ? ~io_out_ready : io_in_valid", "~full & io_in_valid")
    found = verdicts(before, after)
    assert {name: one.verdict for name, one in found.items()} == {"Counter": "different", "Device": "equal"}
    assert report(list(found.values()), "Device")["isEqual"]


def test_a_reset_that_is_cut_is_a_difference(before: Modules, tmp_path: Path) -> None:
    after = design(tmp_path / "after")
    after.texts["Counter"] = after.texts["Counter"].replace("      sum <= 8'h0;\n", "")
    assert verdicts(before, after)["Counter"].verdict == "different"


@pytest.mark.verilator
def test_random_inputs_tell_apart_what_no_proof_reaches(before: Modules, tmp_path: Path) -> None:
    after = design(tmp_path / "after", sum_="(sum == 8'hC5) ? 8'h0 : sum + io_in_bits")
    (one, *_) = compare(before, after, cycles=20_000, limit=0)
    assert one.verdict == "different" and one.detail.endswith("port io_out_bits")
