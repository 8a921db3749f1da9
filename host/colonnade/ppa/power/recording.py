"""Records the ports of one module while the RTL renders a frame, for a replay on the gate netlist.

A recorder is bound to the module in the simulation. It writes inputs and outputs just before each clock edge, from the
cycle in which ``io_start`` starts the frame. Of several instances, the one that finds no recording yet makes it: the
simulator evaluates them in the order of their rows.
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
from colonnade.device.simulator_build import build_simulator
from colonnade.device.verilator import write_job
from colonnade.mesh.mesh import Mesh
from colonnade.registers.frame import frame_registers
from colonnade.scene.model import Scene
from colonnade.scene.object_mesh import SurfaceFeatures, object_mesh, with_materials
from colonnade.scene.parser import load_scene
from colonnade.scene.view import with_overrides
from colonnade.scene_image.packer import pack

#: Ports with a special role in a recording or its replay.
CLOCK, RESET, START = "clock", "reset", "io_start"

_RECORDER = """
module ColonnadeRecorder(
  input clock, input reset, input start, input [{inputs}:0] inputs, input [{outputs}:0] outputs
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
      other = $fopen("recording", "r");
      if (other == 0) begin
        file = $fopen("recording", "w");
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
bind {module} ColonnadeRecorder recorder(
  .clock({clock}), .reset({reset}), .start({start}), .inputs({{{input_names}}}), .outputs({{{output_names}}})
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
    """A frame size at which each render unit of a column with `rows` units works for about ten thousand cycles."""
    width = 4 * round(6 * rows**0.5)
    return width, width * 3 // 4


def require_recordable(stimulus: Stimulus, manifest: Manifest) -> tuple[int, int]:
    """The size of the frame, checked before the work starts.

    Raises:
        UserError: A program is missing, the size is wrong, or columns have path units.
    """
    if manifest.config["units"]["pathContexts"]:
        raise UserError("power is measured on a render unit; with units.pathContexts use --no-power")
    for program, package in (("verilator", "verilator"), ("g++", "g++"), ("make", "make")):
        require_program(program, "power (--no-power leaves it out)", package)
    size = stimulus.size or whole_frame(int(manifest.config["array"]["rows"]))
    check_size(size, manifest)
    return size


def record(
    config: str,
    overrides: Sequence[str],
    module: str,
    ports: Mapping[str, Any],
    stimulus: Stimulus,
    progress: Progress = QUIET,
) -> Recording:
    """Render a frame on one column of a configuration and record one instance of a module.

    Args:
        config: Configuration, before `overrides`.
        overrides: Changes to the configuration, ``key.path=value``.
        module: Name of the module.
        ports: Ports of the module in Yosys's JSON.
        stimulus: The workload.
        progress: Shows the steps.
    """
    one_column = (*overrides, "array.columns=1")
    design = design_for(config, one_column, progress)
    size = require_recordable(stimulus, design.manifest)
    with progress.step("packing the scene"):
        scene, manifest = stimulus.scene, design.manifest
        mesh = with_materials(scene, stimulus.mesh, SurfaceFeatures.of(manifest))
        image = pack(mesh, manifest, with_overrides(mesh.materials, scene.material))
        registers = frame_registers(scene, image.header, manifest, *size)
    joined = {
        direction: tuple(
            Port(name, len(port["bits"]))
            for name, port in ports.items()
            if port["direction"] == direction and name != CLOCK
        )
        for direction in ("input", "output")
    }
    with _with_recorder(design, module, joined["input"], joined["output"]) as recorded:
        program = build_simulator(recorded, progress)
    with temporary_folder() as folder:
        (folder / "limit").write_text(f"{stimulus.cycles}\n")
        job, _ = write_job(folder, design.manifest, image, [registers])
        with progress.step("recording a frame"):
            done = processes.run([program, job], cwd=folder)
        if done.returncode != 0:
            raise RuntimeError(f"the simulated hardware failed (status {done.returncode}): {done.stderr[-300:]}")
        lines = (folder / "recording").read_text().split("\n")
    (output,) = parse_output(done.stdout.splitlines())
    counters = {name.removeprefix("counters."): n for name, n in output.values.items() if name.startswith("counters.")}
    cycles = tuple((int(line.split()[0], 16), int(line.split()[1], 16)) for line in lines[1:] if line)
    facts = {"mesh": stimulus.mesh.name, "triangles": len(stimulus.mesh.faces), "size": list(size)}
    return Recording(joined["input"], joined["output"], cycles, int(lines[0]), facts, counters)


@contextlib.contextmanager
def _with_recorder(
    design: GeneratedDesign, module: str, inputs: Sequence[Port], outputs: Sequence[Port]
) -> Iterator[GeneratedDesign]:
    """A temporary folder with the design and the recorder."""
    text = _RECORDER.format(
        module=module,
        clock=CLOCK,
        reset=RESET,
        start=START,
        inputs=sum(port.bits for port in inputs) - 1,
        outputs=sum(port.bits for port in outputs) - 1,
        input_names=", ".join(port.name for port in inputs),
        output_names=", ".join(port.name for port in outputs),
    )
    with temporary_folder() as folder:
        for file in design.sources:
            (folder / file.name).symlink_to(file.resolve())
        # Verilator reads files in the order of their names, and the bound recorder must come first
        (folder / "ColonnadeRecorder.sv").write_text(re.sub(r"^\n", "", text))
        yield GeneratedDesign(folder, design.manifest)
