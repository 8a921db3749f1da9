"""Records the ports of modules while the RTL works, for a replay on their gate netlists.

A recorder for each module is bound into the simulation: to the traversal unit itself, and to the column for the others.
It writes inputs and outputs just before each clock edge, from the cycle in which ``io_start`` starts the work. Of
several traversal units, the one that finds no recording yet makes it: the simulator evaluates them in the order of
their rows.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from typing import Any

from colonnade.common.progress import QUIET, Progress
from colonnade.common.temporary import temporary_folder
from colonnade.design.config_name import Overrides
from colonnade.design.generator import GeneratedDesign, design_for
from colonnade.design.manifest import Manifest
from colonnade.design.toolchain import require_program
from colonnade.device.simulator_sources import UNIT

from colonnade_lab.ppa.power.recording import CLOCK, RESET, START, Port, Recording
from colonnade_lab.ppa.power.workload import OneColumn, Workload

_RECORDER = """
module ColonnadeRecorder_{module}(
  input clock, input reset, input start, input [{input_bits}-1:0] inputs, input [{output_bits}-1:0] outputs
);
  integer file, limit, unused, other, left, idle_cycles;
  initial begin
    left = 0;
    file = $fopen("limit", "r");
    unused = $fscanf(file, "%d", limit);
    $fclose(file);
    file = 0;
  end
  always @(posedge clock) begin
    idle_cycles <= reset ? 0 : idle_cycles + 1;
    if (start && file == 0) begin
      other = $fopen("{module}.recording", "r");
      if (other == 0) begin
        file = $fopen("{module}.recording", "w");
        $fwrite(file, "%0d\\n", idle_cycles);
        $fwrite(file, "%h %h\\n", inputs, outputs);
        left <= limit - 1;
      end else $fclose(other);
    end else if (left != 0) begin
      $fwrite(file, "%h %h\\n", inputs, outputs);
      left <= left - 1;
    end
  end
endmodule
bind {scope} ColonnadeRecorder_{module} recorder_{module}(
  .clock({clock}), .reset({reset}), .start({start}), .inputs({{{inputs}}}), .outputs({{{outputs}}})
);
"""


def require_recordable(workload: Workload, manifest: Manifest) -> None:
    """Check a workload before the work begins.

    Raises:
        UserError: A program is missing, or the design cannot do it.
    """
    for program, package in (("verilator", "verilator"), ("g++", "g++"), ("make", "make")):
        require_program(program, "power (--no-power leaves it out)", package)
    workload.check(manifest)


def record(
    config: str,
    overrides: Sequence[str],
    modules: Mapping[str, Mapping[str, Any]],
    workload: Workload,
    progress: Progress = QUIET,
) -> dict[str, Recording]:
    """Let one column of a configuration do a workload and record one instance of each module.

    Args:
        config: Configuration, before `overrides`.
        overrides: Changes to the configuration, ``key.path=value``.
        modules: Ports in Yosys's JSON of the workload's modules.
        workload: What it does.
        progress: Shows the steps.
    """
    one_column: Overrides = (*overrides, "array.columns=1")
    design = design_for(config, one_column, progress)
    require_recordable(workload, design.manifest)
    ports = {module: _Ports.of(yosys, _words(design, module)) for module, yosys in modules.items()}
    with _with_recorders(design, ports, workload.outer) as recorded, temporary_folder() as folder:
        (folder / "limit").write_text(f"{workload.cycles}\n")
        facts = workload.run(OneColumn(config, one_column, design), recorded, folder, progress)
        lines = {module: (folder / f"{module}.recording").read_text().splitlines() for module in ports}
    return {
        module: Recording(of.inputs, of.outputs, _cycles(lines[module]), int(lines[module][0]), facts)
        for module, of in ports.items()
    }


@dataclass(frozen=True)
class _Ports:
    """The ports of a recorded module, without the clock.

    Attributes:
        inputs: Inputs of the gates.
        outputs: Outputs of the gates that the simulated module has.
        absent: Inputs that it does not have, since no unit reads them: they reach memories alone, and are 0.
    """

    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    absent: frozenset[str]

    @staticmethod
    def of(ports: Mapping[str, Any], present: Set[str]) -> _Ports:
        """The ports of gates in Yosys's JSON; `present` has all names of the simulated module."""

        def towards(direction: str) -> tuple[Port, ...]:
            found = ((name, port) for name, port in ports.items() if port["direction"] == direction)
            return tuple(Port(name, len(port["bits"])) for name, port in found if name != CLOCK)

        inputs = towards("input")
        outputs = tuple(port for port in towards("output") if port.name in present)
        return _Ports(inputs, outputs, frozenset(port.name for port in inputs) - present)


def _words(design: GeneratedDesign, module: str) -> Set[str]:
    """The words of a module's Verilog, its ports among them."""
    return set(re.findall(r"\w+", (design.dir / f"{module}.sv").read_text()))


def _cycles(lines: Sequence[str]) -> tuple[tuple[int, int], ...]:
    """Inputs and outputs of each cycle, from the lines of a recording."""
    words = (line.split() for line in lines[1:])
    return tuple((int(inputs, 16), int(outputs, 16)) for inputs, outputs in words)


@contextlib.contextmanager
def _with_recorders(design: GeneratedDesign, modules: Mapping[str, _Ports], outer: str) -> Iterator[GeneratedDesign]:
    """A temporary folder with the design and a recorder for each module."""
    with temporary_folder() as folder:
        for file in design.sources:
            (folder / file.name).symlink_to(file.resolve())
        for module, ports in modules.items():
            (folder / f"ColonnadeRecorder_{module}.sv").write_text(_recorder(module, ports, design, outer))
        yield GeneratedDesign(folder, design.manifest)


def _recorder(module: str, ports: _Ports, design: GeneratedDesign, outer: str) -> str:
    """The Verilog of a module's recorder, with its `bind` statement."""
    scope, instance = module, ""
    if module != UNIT:
        scope = outer
        name = re.findall(rf"^  {module}\s+(\w+) \(", (design.dir / f"{outer}.sv").read_text(), re.MULTILINE)[0]
        instance = f"{name}."

    def joined(names: Sequence[Port]) -> str:
        return ", ".join(f"{port.bits}'h0" if port.name in ports.absent else f"{instance}{port.name}" for port in names)

    return _RECORDER.lstrip().format(
        module=module,
        scope=scope,
        clock=CLOCK,
        reset=RESET,
        start=START,
        input_bits=sum(port.bits for port in ports.inputs),
        output_bits=sum(port.bits for port in ports.outputs),
        inputs=joined(ports.inputs),
        outputs=joined(ports.outputs),
    )
