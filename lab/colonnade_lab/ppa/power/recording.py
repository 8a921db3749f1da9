"""Records the ports of modules while the RTL renders a frame, for a replay on their gate netlists.

A recorder for each module is bound into the simulation: to the traversal unit itself, and to the column for modules
that follow paths. It writes inputs and outputs just before each clock edge, from the cycle in which ``io_start`` starts
the frame. Of several traversal units, the one that finds no recording yet makes it: the simulator evaluates them in the
order of their rows.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from colonnade.common import processes
from colonnade.common.errors import UserError
from colonnade.common.progress import QUIET, Progress
from colonnade.common.temporary import temporary_folder
from colonnade.design.frame_limits import check_size
from colonnade.design.generator import GeneratedDesign, design_for
from colonnade.design.manifest import Manifest
from colonnade.design.toolchain import project_root, require_program
from colonnade.device.harness_job import parse_output
from colonnade.device.scene import DeviceScene
from colonnade.device.simulator_build import build_simulator
from colonnade.device.simulator_sources import TRACER, UNIT
from colonnade.device.verilator import write_job
from colonnade.mesh.materials.mesh import Mesh
from colonnade.scene.model import Scene
from colonnade.scene.object_mesh import object_mesh
from colonnade.scene.parser import load_scene

#: Ports with a special role in a recording or its replay.
CLOCK, RESET, START = "clock", "reset", "io_start"

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


@dataclass(frozen=True)
class Port:
    """A port of the recorded module."""

    name: str
    bits: int


@dataclass(frozen=True)
class Recording:
    """The values at a module's ports in each cycle.

    Attributes:
        inputs: Inputs without the clock; concatenated with the first as the most significant.
        outputs: Outputs, concatenated alike.
        cycles: Concatenated inputs and concatenated outputs of each cycle.
        idle_cycles: Cycles between reset and the first recorded one.
        scene: Mesh, triangles and size, for reports.
        counters: Counters of the whole frame.
    """

    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    cycles: tuple[tuple[int, int], ...]
    idle_cycles: int
    scene: Mapping[str, Any]
    counters: Mapping[str, int]

    def of(self, name: str) -> list[int]:
        """The values of one port."""
        for index, ports in enumerate((self.inputs, self.outputs)):
            shift = sum(port.bits for port in ports)
            for port in ports:
                shift -= port.bits
                if port.name == name:
                    mask = (1 << port.bits) - 1
                    return [cycle[index] >> shift & mask for cycle in self.cycles]
        raise RuntimeError(f"the recorded module has no port {name}, which the energy per ray needs")

    def fires(self, stream: str) -> list[bool]:
        """Whether the stream `stream` transfers data, in each cycle."""
        pairs = zip(self.of(f"{stream}_valid"), self.of(f"{stream}_ready"), strict=True)
        return [bool(valid and ready) for valid, ready in pairs]


@dataclass(frozen=True)
class Stimulus:
    """The power workload: a frame, and how much of it is recorded.

    Attributes:
        scene: The scene; its mesh is not read.
        mesh: The mesh.
        size: Width and height, pixels; None: `whole_frame`.
        cycles: Maximum number of recorded cycles from the start of the frame.
    """

    scene: Scene
    mesh: Mesh
    size: tuple[int, int] | None
    cycles: int

    @staticmethod
    def of_benchmark(mesh: str, size: tuple[int, int] | None, cycles: int) -> Stimulus:
        """The benchmark scene with a mesh, a name or a file."""
        scene = load_scene(project_root() / "scenes" / "object.toml").with_mesh(mesh)
        return Stimulus(scene, object_mesh(scene, corner_colours=True), size, cycles)


def whole_frame(rows: int) -> tuple[int, int]:
    """A frame size at which each traversal unit of a column with `rows` units works for about ten thousand cycles."""
    width = 4 * round(6 * rows**0.5)
    return width, width * 3 // 4


def require_recordable(stimulus: Stimulus, manifest: Manifest) -> tuple[int, int]:
    """The size of the frame, checked before the work starts.

    Raises:
        UserError: A program is missing, the size is wrong, or the design has no frames.
    """
    if manifest.config["frame"]["rays"]:
        raise UserError("power is that of a frame, which a device with frame.rays has none of: give --no-power")
    for program, package in (("verilator", "verilator"), ("g++", "g++"), ("make", "make")):
        require_program(program, "power (--no-power leaves it out)", package)
    size = stimulus.size or whole_frame(int(manifest.config["array"]["rows"]))
    check_size(size, manifest)
    return size


def record(
    config: str,
    overrides: Sequence[str],
    modules: Mapping[str, Mapping[str, Any]],
    stimulus: Stimulus,
    progress: Progress = QUIET,
) -> dict[str, Recording]:
    """Render a frame on one column of a configuration and record one instance of each module.

    Args:
        config: Configuration, before `overrides`.
        overrides: Changes to the configuration, ``key.path=value``.
        modules: Ports in Yosys's JSON of the modules: a traversal unit, and others of its column.
        stimulus: The workload.
        progress: Shows the steps.
    """
    one_column = (*overrides, "array.columns=1")
    design = design_for(config, one_column, progress)
    size = require_recordable(stimulus, design.manifest)
    with progress.step("packing the scene"):
        prepared = DeviceScene.of(stimulus.scene, design.manifest, stimulus.mesh)
        registers = prepared.registers(size)
    ports = {module: _Ports.of(yosys) for module, yosys in modules.items()}
    with _with_recorders(design, ports) as recorded:
        program = build_simulator(recorded, progress)
    with temporary_folder() as folder:
        (folder / "limit").write_text(f"{stimulus.cycles}\n")
        job, _ = write_job(folder, design.manifest, prepared.image, [registers])
        with progress.step("recording a frame"):
            done = processes.run([program, job], cwd=folder)
        if done.returncode != 0:
            raise RuntimeError(f"the simulated hardware failed (status {done.returncode}): {done.stderr[-300:]}")
        lines = {module: (folder / f"{module}.recording").read_text().splitlines() for module in ports}
    (output,) = parse_output(done.stdout.splitlines())
    counters = {name.removeprefix("counters."): n for name, n in output.values.items() if name.startswith("counters.")}
    facts = {"mesh": stimulus.mesh.name, "triangles": len(stimulus.mesh.faces), "size": list(size)}
    return {
        module: Recording(of.inputs, of.outputs, _cycles(lines[module]), int(lines[module][0]), facts, counters)
        for module, of in ports.items()
    }


@dataclass(frozen=True)
class _Ports:
    """The ports of a recorded module, without the clock."""

    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]

    @staticmethod
    def of(ports: Mapping[str, Any]) -> _Ports:
        def towards(direction: str) -> tuple[Port, ...]:
            found = ((name, port) for name, port in ports.items() if port["direction"] == direction)
            return tuple(Port(name, len(port["bits"])) for name, port in found if name != CLOCK)

        return _Ports(towards("input"), towards("output"))


def _cycles(lines: Sequence[str]) -> tuple[tuple[int, int], ...]:
    """Inputs and outputs of each cycle, from the lines of a recording."""
    words = (line.split() for line in lines[1:])
    return tuple((int(inputs, 16), int(outputs, 16)) for inputs, outputs in words)


@contextlib.contextmanager
def _with_recorders(design: GeneratedDesign, modules: Mapping[str, _Ports]) -> Iterator[GeneratedDesign]:
    """A temporary folder with the design and a recorder for each module."""
    with temporary_folder() as folder:
        for file in design.sources:
            (folder / file.name).symlink_to(file.resolve())
        for module, ports in modules.items():
            (folder / f"ColonnadeRecorder_{module}.sv").write_text(_recorder(module, ports, design))
        yield GeneratedDesign(folder, design.manifest)


def _recorder(module: str, ports: _Ports, design: GeneratedDesign) -> str:
    """The Verilog of a module's recorder, with its `bind` statement."""
    scope, instance = module, ""
    if module != UNIT:
        scope = TRACER
        name = re.findall(rf"^  {module}\s+(\w+) \(", (design.dir / f"{TRACER}.sv").read_text(), re.MULTILINE)[0]
        instance = f"{name}."

    def joined(names: Sequence[Port]) -> str:
        return ", ".join(f"{instance}{port.name}" for port in names)

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
