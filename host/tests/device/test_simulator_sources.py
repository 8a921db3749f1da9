"""The coupling of a simulator's models: parsing and rewriting of firtool's Verilog."""

from __future__ import annotations

from pathlib import Path

import pytest

from colonnade.device.simulator_sources import (
    PART_SIZE,
    both_edges,
    coupling,
    held_model,
    large_parts,
    module_ports,
    open_module,
    write_sources,
)

UNIT = """\
module TraversalUnit(
  input          clock,
                 reset,
  input  [31:0]  io_registers_frame_unitShift,
  input          io_positions_valid,
  output         io_positions_ready,
  input  [319:0] io_broadcasts_0_bits_record,
  output [16:0]  io_requests_bits_address,
  input          io_requests_ready,
  output         io_unused
);

  Queue1_Pixel outgoing (
    .clock (clock)
  );
  always @(posedge clock) begin
  end // always @(posedge)
endmodule
"""


def instance(number: int) -> str:
    suffix = f"_{number}" if number else ""
    return f"""\
  TraversalUnit TraversalUnit{suffix} (
    .clock (clock),
    .reset (reset),
    .io_registers_frame_unitShift (io_registers_frame_unitShift),
    .io_positions_valid (_walker_io_positions_{number}_valid & ~(a | b)),
    .io_positions_ready
      (_TraversalUnit{suffix}_io_positions_ready),
    .io_broadcasts_0_bits_record (_controller_io_broadcasts_0_bits_record),
    .io_requests_bits_address (_TraversalUnit{suffix}_io_requests_bits_address),
    .io_requests_ready (_controller_io_requests_{number}_ready),
    .io_unused (/* unused */)
  );
"""


CONTROLLER = "module RtController(\n  input clock,\n  output io_end_valid\n);\nendmodule\n"
PATHS = """\
module PathUnit(
  input clock
);
  RtController controller (
    .clock (clock),
    .io_end_valid (_controller_io_end_valid)
  );
endmodule
"""
TRACER = f"""\
module PathTracer(
  input clock
);
  wire before;
  PathUnit paths (
  );
{instance(0)}{instance(1)}  wire behind;
endmodule
"""


def test_ports_have_direction_width_and_kind() -> None:
    ports = {port.name: port for port in module_ports(UNIT, "TraversalUnit")}
    assert "clock" not in ports
    assert {name: port.bits for name, port in ports.items() if port.bits > 1} == {
        "io_registers_frame_unitShift": 32,
        "io_broadcasts_0_bits_record": 320,
        "io_requests_bits_address": 17,
    }
    kinds = {name: port.kind for name, port in ports.items()}
    assert kinds == {
        "reset": "DIRECT",
        "io_registers_frame_unitShift": "REGISTERS",
        "io_positions_valid": "INPUTS",
        "io_positions_ready": "OUTPUTS",
        "io_broadcasts_0_bits_record": "INPUTS",
        "io_requests_bits_address": "OUTPUTS",
        "io_requests_ready": "DIRECT",
        "io_unused": "OUTPUTS",
    }
    assert ports["io_broadcasts_0_bits_record"].cpp_type == "VlWide<10>"
    assert ports["io_requests_bits_address"].cpp_type == "IData"


def test_an_unknown_port_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"cannot parse a port of TraversalUnit: inout x"):
        module_ports("module TraversalUnit(\n  inout x\n);\n", "TraversalUnit")


def test_registers_use_both_edges_of_any_clock() -> None:
    text = both_edges("  always @(posedge clock) begin\n  end // always @(posedge)\n  always @(posedge RW0_clk)\n")
    assert text == "  always @(edge clock) begin\n  end // always @(posedge)\n  always @(edge RW0_clk)\n"


def test_a_model_registers_inputs_of_some_kinds_by_their_events() -> None:
    events = {"REGISTERS": "takeRegisters", "INPUTS": "clock"}
    text = held_model("UnitModel", "TraversalUnit", module_ports(UNIT, "TraversalUnit"), events)
    held = {line.split()[-1].rstrip(";") for line in text.splitlines() if line.startswith("  reg ")}
    assert held == {"held_io_registers_frame_unitShift", "held_io_positions_valid", "held_io_broadcasts_0_bits_record"}
    assert "    .io_positions_valid(held_io_positions_valid)" in text
    assert "    .io_requests_ready(io_requests_ready)" in text
    assert text.startswith("module UnitModel(\n  input clock,\n  input takeRegisters,\n")
    assert "always @(edge clock) held_io_positions_valid <= io_positions_valid;" in text
    assert "always @(edge takeRegisters) held_io_registers_frame_unitShift <= io_registers_frame_unitShift;" in text


def test_variables_replace_the_ports_of_removed_instances() -> None:
    opened = open_module(TRACER, "PathTracer", "TraversalUnit", module_ports(UNIT, "TraversalUnit"), True)
    assert opened.count == 2
    assert "TraversalUnit TraversalUnit" not in opened.verilog
    assert opened.verilog.index("wire before") < opened.verilog.index("wire behind")
    assert opened.shared == {"reset", "io_registers_frame_unitShift", "io_broadcasts_0_bits_record"}
    lines = [line.strip() for line in opened.verilog.splitlines()]
    public = "/*verilator public_flat_rd*/"
    assert f"wire TraversalUnit_1_io_positions_valid {public} = _walker_io_positions_1_valid & ~(a | b);" in lines
    assert sum("shared_io_broadcasts_0_bits_record" in line for line in lines) == 1
    variable = "TraversalUnit_1_io_requests_bits_address"
    assert f"reg [16:0] {variable} /*verilator public_flat_rw*/;" in lines
    assert f"always @(edge TraversalUnit_event) held_{variable} <= {variable};" in lines
    assert f"assign _{variable} = held_{variable};" in lines
    assert lines.count("reg TraversalUnit_event /*verilator public_flat_rw*/;") == 1
    assert "io_unused" not in opened.verilog
    own = open_module(TRACER, "PathTracer", "TraversalUnit", module_ports(UNIT, "TraversalUnit"), False)
    assert f"always @(edge TraversalUnit_1_event) held_{variable} <= {variable};" in own.verilog


def test_the_harness_gets_every_connected_port() -> None:
    opened = open_module(TRACER, "PathTracer", "TraversalUnit", module_ports(UNIT, "TraversalUnit"), True)
    header = coupling(opened, "Unit", "Column", "Column__DOT__tracer")
    assert "#define Unit_DIRECT(DO) DO(reset) DO(io_requests_ready)\n" in header
    assert "#define Unit_REGISTERS(DO) DO(io_registers_frame_unitShift)\n" in header
    assert header.count("&root.Column__DOT__tracer__DOT__TraversalUnit_shared_io_broadcasts_0_bits_record") == 2
    assert header.count("&root.Column__DOT__tracer__DOT__TraversalUnit_event}") == 2
    assert "io_unused" not in header


def test_each_model_gets_its_modules(tmp_path: Path) -> None:
    top = "  Column columns_0 (\n    .clock (clock),\n    .io_start (start)\n  );\n"
    inside = "  PathTracer tracer (\n    .clock (clock)\n  );\n  ColumnBvhMemory memory (\n    .clock (clock)\n  );\n"
    files = {
        "TraversalUnit": UNIT,
        "Queue1_Pixel": "module Queue1_Pixel(\n  input clock\n);\nendmodule\n",
        "PathTracer": TRACER,
        "Column": f"module Column(\n  input clock,\n  input io_start\n);\n{inside}endmodule\n",
        "PathUnit": PATHS,
        "RtController": CONTROLLER,
        "ColumnBvhMemory": "module ColumnBvhMemory(\n  input clock\n);\n"
        "  records_64x320 records_ext (\n  );\n  records_64x320 records_1_ext (\n  );\nendmodule\n",
        "records_64x320": "module records_64x320(\n  input RW0_clk\n);\n  reg [319:0] Memory[0:63];\nendmodule\n",
        "Colonnade": f"module Colonnade(\n  input clock\n);\n{top}endmodule\n",
        "Recorder": "bind TraversalUnit ColonnadeRecorder recorder();\n",
        "Unused": "module Unused(\n);\nendmodule\n",
    }
    folder, out = tmp_path / "in", tmp_path / "out"
    folder.mkdir()
    out.mkdir()
    for name, text in files.items():
        (folder / f"{name}.sv").write_text(text)
    models = write_sources(sorted(folder.iterdir()), out, ["RtController", "BounceUnit"])
    assert {top: [path.stem for path in paths] for top, paths in models.items()} == {
        "UnitModel": ["Recorder", "Queue1_Pixel", "TraversalUnit", "UnitModel"],
        "RtControllerModel": ["RtController", "RtControllerModel"],
        "ColumnModel": ["Column", "ColumnBvhMemory", "ColumnModel", "PathTracer", "PathUnit", "records_64x320"],
        "Colonnade": ["Colonnade"],
    }
    assert "Memory[0:63] /*verilator public_flat_rw*/;" in (out / "ColumnModel" / "records_64x320.sv").read_text()
    header = (out / "coupling.hpp").read_text()
    assert "constexpr unsigned banksOfColumn = 2;" in header
    assert "#define EACH_PART(DO) DO(RtController)\n" in header
    assert "&root.ColumnModel__DOT__inner__DOT__tracer__DOT__paths__DOT__RtController_0_io_end_valid" in header


def test_a_part_is_a_model_if_all_of_it_is_large(tmp_path: Path) -> None:
    twice = "module BouncePipeline(\n);\n  BounceUnit a (\n  );\n  BounceUnit b (\n  );\nendmodule\n"
    half = "module BounceUnit(\n);\nendmodule\n".ljust(PART_SIZE // 2)
    for name, text in {
        "PathUnit": PATHS,
        "RtController": CONTROLLER,
        "BouncePipeline": twice,
        "BounceUnit": half,
    }.items():
        (tmp_path / f"{name}.sv").write_text(text)
    assert large_parts(sorted(tmp_path.iterdir())) == ["BounceUnit"]
