"""Two versions of a unit side by side, with one set of inputs, compared at their ports.

The same module serves a simulation with random inputs, and a proof by abc. In both a stream keeps what it offers until
it is taken, sinks stall at any time, and what a stream carries is compared only while it is valid. Registers begin with
zero; the reset is set in the first cycle, and any time later.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from colonnade.common import processes
from colonnade.device.simulator_build import build_environment
from colonnade.device.simulator_sources import Port

from colonnade_lab.common.yosys import run_yosys
from colonnade_lab.units import aiger
from colonnade_lab.units.engines import ask

#: Name of the module around both versions.
BENCH = "UnitBench"

#: The input that chooses a mutant; 0: none.
MUTANT = "mutant"

#: Cycles of a random test whose inputs have one pace each.
_EPISODE = 256

_MAIN = """#include "Vbench.h"
#include "verilated.h"

int main(int count, char **arguments) {
    Verilated::commandArgs(count, arguments);
    Vbench bench;
    while (!Verilated::gotFinish()) {
        bench.clock = !bench.clock;
        bench.eval();
    }
}
"""


@dataclass(frozen=True)
class Difference:
    """Where two versions first differ: cycle after the first one, and port."""

    cycle: int
    port: str


class Bench:
    """The bench of one unit.

    Args:
        unit: Name of the first version.
        other: Name of the second version; the same if it only has mutants.
        ports: The ports of both.
        has_mutants: The second version has an input `mutant`.
    """

    def __init__(self, unit: str, other: str, ports: Sequence[Port], has_mutants: bool = False) -> None:
        self.inputs = [port for port in ports if port.is_input and port.name != "reset"]
        self.outputs = [port for port in ports if not port.is_input]
        self._unit, self._other, self._has_mutants = unit, other, has_mutants
        self._has_reset = any(port.name == "reset" for port in ports)
        self._names = {port.name for port in ports}

    def verilog(self, has_clock: bool, mutant: int = 0) -> str:
        """The module for simulation, where `+mutant=` chooses a mutant, and with `FORMAL` for a proof of this one."""
        lines = [f"module {BENCH}(", "  input clock", "`ifdef FORMAL", "  , input reset"]
        lines += [f"  , input {port.range}{port.name}" for port in self.inputs]
        lines += ["`endif", ");"]
        for port in self.outputs:
            lines.append(f"  wire {port.range}a_{port.name}, b_{port.name};")
        lines += ["`ifdef FORMAL", f"  wire [15:0] {MUTANT} = {mutant};", "`else", *self._stimulus(), "`endif"]
        for side, module in (("a", self._unit), ("b", self._other)):
            connections = [".clock(clock)"] if has_clock else []
            connections += [".reset(reset)"] if self._has_reset else []
            connections += [f".{port.name}({port.name})" for port in self.inputs]
            connections += [f".{port.name}({side}_{port.name})" for port in self.outputs]
            if self._has_mutants:
                connections.append(f".{MUTANT}({MUTANT if side == 'b' else 0})")
            lines.append(f"  {module} {side} ({', '.join(connections)});")
        claims = [self._differs(port) for port in self.outputs]
        lines += ["`ifdef FORMAL", *self._contract()]
        lines += [f"  always @* port_{n}: assert(!({claim}));" for n, claim in enumerate(claims)]
        lines += ["`else", "  always @(posedge clock) begin"]
        for n, claim in enumerate(claims):
            lines.append(f'    if ({claim}) begin $display("DIFFERENT %0d {n}", cycle); $finish; end')
        return "\n".join([*lines, "  end", "`endif", "endmodule", ""])

    def _stream(self, name: str) -> str | None:
        """The stream whose payload a port is."""
        match = re.match(r"(\w+?)_bits(?:_|$)", name)
        return match[1] if match else None

    def _differs(self, port: Port) -> str:
        stream = self._stream(port.name)
        valid = f"a_{stream}_valid & " if stream and f"{stream}_valid" in self._output_names else ""
        return f"{valid}(a_{port.name} != b_{port.name})"

    @property
    def _output_names(self) -> set[str]:
        return {port.name for port in self.outputs}

    def _keeps(self, port: Port) -> str | None:
        """When an input of a stream keeps its value: it is offered, and not taken."""
        stream = self._stream(port.name) or (port.name[:-6] if port.name.endswith("_valid") else None)
        if stream is None or f"{stream}_ready" not in self._output_names or f"{stream}_valid" not in self._names:
            return None
        return f"({stream}_valid & ~a_{stream}_ready)"

    def _contract(self) -> list[str]:
        """Assumptions: streams keep what they offer."""
        lines = []
        for port in self.inputs:
            keeps = self._keeps(port)
            if keeps:
                lines += [
                    f"  reg {port.range}was_{port.name}; reg kept_{port.name} = 0;",
                    f"  always @(posedge clock) begin was_{port.name} <= {port.name}; "
                    f"kept_{port.name} <= {keeps} & ~reset; end",
                    f"  always @* assume(!kept_{port.name} || {port.name} == was_{port.name});",
                ]
        return lines

    def _stimulus(self) -> list[str]:
        """Random inputs, whose pace changes with each episode."""
        lines = ["  reg reset = 1; integer cycle = 0, cycles; reg [15:0] " + MUTANT + ";"]
        lines += ['  initial if (!$value$plusargs("cycles=%d", cycles)) cycles = 2000;']
        lines += ['  initial if (!$value$plusargs("mutant=%d", ' + MUTANT + ")) " + MUTANT + " = 0;"]
        update = []
        for n, port in enumerate(self.inputs):
            lines.append(f"  reg {port.range}{port.name} = 0; reg [2:0] pace_{n} = 0;")
            draw = "{" + ", ".join(["$urandom"] * ((port.bits + 31) // 32)) + "}"
            value = f"{port.bits}'({draw})"
            if port.bits == 1:
                # A claim or a flag: rare, as often as not, or mostly
                value = f"(($urandom & 7) < (pace_{n}[1:0] == 0 ? 1 : pace_{n}[1:0] == 3 ? 7 : 4))"
                moves = "1"
            else:
                width = f"{port.bits}"
                value = (
                    f"(($urandom & 7) == 0) ? {width}'(0) : (($urandom & 7) == 0) ? ~{width}'(0) : "
                    f"(($urandom & 3) == 0) ? ({value} >> ($urandom % {width})) : {value}"
                )
                moves = f"(pace_{n}[2] | (($urandom & 15) == 0))"
            keeps = self._keeps(port)
            update.append(f"      if ({moves}{f' & ~{keeps}' if keeps else ''}) {port.name} <= {value};")
            update.append(f"      if ((cycle % {_EPISODE}) == 0) pace_{n} <= 3'($urandom);")
        lines += ["  always @(posedge clock) begin", "      cycle <= cycle + 1;"]
        lines += ["      reset <= cycle < 3 | (($urandom & 511) == 0);", *update]
        return [*lines, "      if (cycle >= cycles) $finish;", "  end"]


def build(folder: Path, sources: Sequence[Path], verilator: Sequence[str], log: Path) -> Path:
    """Build the simulation of a bench.

    Args:
        folder: Where `bench.sv` is.
        sources: The modules of both versions.
        verilator: The program with its options.
        log: File for its output.

    Raises:
        RuntimeError: It does not build.
    """
    (folder / "main.cpp").write_text(_MAIN)
    command = [*verilator, "+define+SYNTHESIS", "-Wno-fatal", "-Wno-lint", "--top-module", BENCH, "--Mdir", "obj"]
    command += ["--prefix", "Vbench", "--exe", "-o", "bench", "main.cpp", "bench.sv", *map(str, sources)]
    with log.open("w") as stream:
        done = processes.run(command, cwd=folder, env=build_environment(), stdout=stream, stderr=stream)
    if done.returncode != 0:
        raise RuntimeError(f"the bench does not build: see {log}")
    return folder / "obj" / "bench"


def simulate(program: Path, bench: Bench, cycles: int, seed: int, mutant: int = 0) -> Difference | None:
    """Run a bench with random inputs up to the first difference."""
    options = [f"+cycles={cycles}", f"+mutant={mutant}", f"+verilator+seed+{seed}"]
    done = processes.run([program, *options])
    found = re.search(r"^DIFFERENT (\d+) (\d+)$", done.stdout or "", re.MULTILINE)
    return Difference(int(found[1]), bench.outputs[int(found[2])].name) if found else None


def prove(folder: Path, bench: Bench, sources: Sequence[Path], limit: int) -> Difference | bool:
    """Ask abc whether both versions are equal: True, or False where the limit, in CPU seconds, leaves it open."""
    script = [f"read_verilog -sv {file}" for file in sources]
    script += ["read_verilog -sv -formal bench.sv", f"hierarchy -check -top {BENCH}", *aiger.flatten(free=False)]
    run_yosys([*script, *aiger.write_circuits("bench", {"equal": "t:nothing"}, "1,1'z")], folder, folder / "yosys.log")
    answer = ask(folder / "equal.aig", "bmc3 -F 12 -C 2000", limit)
    if not answer.failed:
        answer = ask(folder / "equal.aig", "scorr; dc2; scorr; pdr -s -f", limit)
    for claim, frame in answer.failed.items():
        name = aiger.claims(folder, "equal")[claim]
        return Difference(frame, bench.outputs[int(name.removeprefix("port_"))].name)
    return answer.is_proved
