"""Sequences at the bus of the AXI4 shell: each abuses it, then renders a frame, which must be the model's."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from colonnade.common.framebuffer_formats import PIXEL_BYTES, framebuffer_bytes
from colonnade.common.progress import QUIET, Progress
from colonnade.common.temporary import temporary_folder
from colonnade.design.generator import GeneratedDesign
from colonnade.design.toolchain import project_root
from colonnade.device.bit_exact import render_model
from colonnade.device.shell_build import build_shell_simulator
from colonnade.device.verilator import run_program
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.scene.parser import load_scene
from colonnade.scene_image.device_image import device_image
from colonnade.scene_image.dram_image import PAGE_BYTES, dram_image
from colonnade.scene_image.packer import pack

_WIDTH, _HEIGHT, _FORMAT = 20, 6, 0
_MESH = "sphere:1"
_WATCHDOG_CYCLES = 100_000
# With any value of these a frame may legally take longer than anyone waits, or read a scene that is not there.
_QUIET = ("frame.width", "frame.height", "frame.watchdogCycles", "dram.page")
_UNWRITTEN = 0xA5
_IMAGE, _FRAMEBUFFER, _SCENE, _MEMORY = 0x1000, 0x80000, 0x100000, 0x180000


@dataclass(frozen=True)
class SequenceResult:
    """What sequences have shown.

    Attributes:
        sequences: How many were run: all, or those up to the tenth that broke a rule.
        ended: Those whose abuse has ended.
        exact: Those whose frame is the model's.
        violations: Rules of AXI or of the shell that were broken, each time.
        failed: Sequences that broke one.
        cycles: Simulated cycles.
        bursts: Bursts of the masters.
        accesses: Accesses to registers.
        broken_rules: A line for each broken rule, with the sequence in which it was broken first.
    """

    sequences: int
    ended: int
    exact: int
    violations: int
    failed: int
    cycles: int
    bursts: int
    accesses: int
    broken_rules: tuple[str, ...]

    @property
    def is_right(self) -> bool:
        """Nothing was broken."""
        return self.violations == 0 and self.sequences == self.ended == self.exact


def run_sequences(design: GeneratedDesign, sequences: int, seed: int = 0, progress: Progress = QUIET) -> SequenceResult:
    """Run sequences of consecutive seeds, from ``seed`` on. A seed gives the abuse, the slaves and their order.

    Args:
        design: A design with its shell (`generator.shell_design_for`), without a pixel stream.
        sequences: How many.
        seed: Of the first one.
        progress: Shows the steps.
    """
    program = build_shell_simulator(design, progress)
    with temporary_folder() as folder:
        bus_bytes = _write_job(folder, design)
        options = {"bus": bus_bytes, "memory": _MEMORY, "seed": seed, "sequences": sequences}
        arguments = [text for name, value in options.items() for text in (f"--{name}", str(value))]
        with progress.step("running sequences at the bus") as report:
            *broken, last = run_program([str(program), *arguments, "job"], folder, report)
    words = last.split()
    values = {name: int(value) for name, value in zip(words[::2], words[1::2], strict=True)}
    return SequenceResult(**values, broken_rules=tuple(line.removeprefix("broken ") for line in broken))


def _write_job(folder: Path, design: GeneratedDesign) -> int:
    """The job of the testbench and its files; the bytes of the bus."""
    manifest = design.manifest
    shell = json.loads((design.dir / "shell.json").read_text())
    image = pack(load_mesh(_MESH), manifest)
    scene = load_scene(project_root() / "scenes" / "object.toml").with_mesh(_MESH)
    values = dict(frame_registers(scene, image.header, manifest, _WIDTH, _HEIGHT))
    values["frame.watchdogCycles"] = _WATCHDOG_CYCLES
    model = render_model(manifest, image, values)
    tile = int(manifest.config["frame"]["tileSize"])
    stride = -(-_WIDTH // tile) * tile * PIXEL_BYTES[_FORMAT]
    expected = np.full((_HEIGHT, stride), _UNWRITTEN, np.uint8)
    expected[:, : _WIDTH * PIXEL_BYTES[_FORMAT]] = framebuffer_bytes(model, _FORMAT)
    (folder / "image").write_bytes(device_image(image, manifest))
    (folder / "framebuffer").write_bytes(expected.tobytes())
    lines = [f"image {_IMAGE} image", f"framebuffer {_FRAMEBUFFER} framebuffer {stride}"]
    if manifest.config["columnBvhMemory"]["cache"]:
        (folder / "scene").write_bytes(dram_image(image, manifest))
        values["dram.page"] = _SCENE // PAGE_BYTES
        lines.append(f"scene {_SCENE} scene")
        invalidate = manifest.registers["control.invalidate"].address
        lines.append(f"invalidate {int(shell['deviceBase']) + 4 * invalidate}")
    lines += [f"register {r['name']} {r['address']} {r['width']} {r['access']}" for r in shell["registers"]]
    base = int(shell["deviceBase"])
    end = max(register.address + register.words for register in manifest.registers.values())
    lines.append(f"device {base + 4 * manifest.registers['control.start'].address} {base} {base + 4 * end}")
    for name, value in values.items():
        for address, word in manifest.registers[name].encode(value):
            lines.append(f"frame {base + 4 * address} {word} {int(name not in _QUIET)}")
    errors = [register for name, register in manifest.registers.items() if name.startswith("errors.")]
    lines += [f"error {base + 4 * register.address}" for register in errors]
    (folder / "job").write_text("\n".join(lines) + "\n")
    return int(shell["busBytes"])
