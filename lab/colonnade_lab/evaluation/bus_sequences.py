"""Sequences at the bus of the AXI4 shell: each abuses it, then does legal work, whose result must be the model's.

The work is a frame, or of a device for rays a batch.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from colonnade.common.framebuffer_formats import PIXEL_BYTES, framebuffer_bytes
from colonnade.common.progress import QUIET, Progress
from colonnade.common.temporary import temporary_folder
from colonnade.design.generator import GeneratedDesign
from colonnade.design.manifest import Manifest
from colonnade.design.toolchain import project_root
from colonnade.device.bit_exact import render_model
from colonnade.device.shell_build import build_shell_simulator
from colonnade.device.verilator import run_program
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.scene.parser import load_scene
from colonnade.scene_image.device_image import device_image
from colonnade.scene_image.dram_image import PAGE_BYTES, dram_image
from colonnade.scene_image.file import Loads
from colonnade.scene_image.packer import pack

from colonnade_lab.evaluation.fuzz.rays import RayScene, any_batch

_WIDTH, _HEIGHT, _FORMAT = 20, 6, 0
_MESH = "sphere:1"
_WATCHDOG_CYCLES = 100_000
# With any value of these a frame may legally take longer than anyone waits, or read a scene that is not there.
_QUIET = ("frame.width", "frame.height", "frame.watchdogCycles", "dram.page")
_UNWRITTEN = 0xA5
_IMAGE, _FRAMEBUFFER, _SCENE, _MEMORY = 0x1000, 0x80000, 0x100000, 0x180000
# Of batches: the window, and the ring in it (`batch_sequences.hpp`)
_WINDOW, _WINDOW_BYTES, _RING, _RING_LOG = 0x80000, 0x33000, 0x1000, 5
_RAY_REGISTERS = ("rays.tail", "rays.head", "errors.batch")
_BATCHES = 180
#: Most rays of each batch, in turn: their places hold 128.
_MOST_RAYS = (128, 13, 13, 13, 60, 13, 13, 13, 13)


@dataclass(frozen=True)
class SequenceResult:
    """What sequences have shown.

    Attributes:
        sequences: How many were run: all, or those up to the tenth that broke a rule.
        ended: Those whose abuse has ended.
        exact: Those whose frame, or hits, are the model's.
        violations: Rules of AXI or of the shell that were broken, each time.
        failed: Sequences that broke one.
        cycles: Simulated cycles.
        bursts: Bursts of the masters.
        accesses: Accesses to registers.
        batches: Batches of rays that have ended.
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
    batches: int
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
    base = int(shell["deviceBase"])

    def address(name: str) -> int:
        return base + 4 * manifest.registers[name].address

    write_work = _write_batches if manifest.has_queries else _write_frame
    image, values, lines = write_work(folder, manifest, address)
    (folder / "image").write_bytes(device_image(image, manifest))
    lines.append(f"image {_IMAGE} image")
    if manifest.config["columnBvhMemory"]["cache"]:
        (folder / "scene").write_bytes(dram_image(image, manifest))
        values["dram.page"] = _SCENE // PAGE_BYTES
        lines += [f"scene {_SCENE} scene", f"invalidate {address('control.invalidate')}"]
    lines += [f"register {r['name']} {r['address']} {r['width']} {r['access']}" for r in shell["registers"]]
    end = max(register.address + register.words for register in manifest.registers.values())
    lines.append(f"device {address('control.start')} {base} {base + 4 * end}")
    for name, value in values.items():
        for word_address, word in manifest.registers[name].encode(value):
            lines.append(f"frame {base + 4 * word_address} {word} {int(name not in _QUIET)}")
    lines += [f"error {address(name)}" for name in manifest.registers if name.startswith("errors.")]
    (folder / "job").write_text("\n".join(lines) + "\n")
    return int(shell["busBytes"])


def _write_frame(
    folder: Path, manifest: Manifest, address: Callable[[str], int]
) -> tuple[Loads, dict[str, int], list[str]]:
    """A frame: its image, its registers, and lines of the job."""
    image = pack(load_mesh(_MESH), manifest)
    scene = load_scene(project_root() / "scenes" / "object.toml").with_mesh(_MESH)
    values = dict(frame_registers(scene, image.header, manifest, _WIDTH, _HEIGHT))
    values["frame.watchdogCycles"] = _WATCHDOG_CYCLES
    model = render_model(manifest, image, values)
    tile = int(manifest.config["frame"]["tileSize"])
    stride = -(-_WIDTH // tile) * tile * PIXEL_BYTES[_FORMAT]
    expected = np.full((_HEIGHT, stride), _UNWRITTEN, np.uint8)
    expected[:, : _WIDTH * PIXEL_BYTES[_FORMAT]] = framebuffer_bytes(model, _FORMAT)
    (folder / "framebuffer").write_bytes(expected.tobytes())
    return image, values, [f"framebuffer {_FRAMEBUFFER} framebuffer {stride}"]


def _write_batches(
    folder: Path, manifest: Manifest, address: Callable[[str], int]
) -> tuple[Loads, dict[str, int], list[str]]:
    """Batches of rays: the image of their scene, its registers, and lines of the job."""
    scene, random = RayScene(manifest), np.random.default_rng(1)
    window = _WINDOW, _WINDOW + _WINDOW_BYTES
    lines = [" ".join(("rays", *(str(address(name)) for name in _RAY_REGISTERS), *map(str, window)))]
    for number in range(_BATCHES):
        batch = any_batch(random, _MOST_RAYS[number % len(_MOST_RAYS)])
        hits = scene.answer(batch)
        assert hits is not None
        for part, content in {"batch": batch.words.tobytes(), "rays": batch.rays, "hits": hits}.items():
            (folder / f"{part}{number}").write_bytes(content)
        lines.append(f"batch batch{number} rays{number} hits{number}")
    values = {name: 0 for name, each in manifest.registers.items() if each.access == "rw" and name != "rays.tail"}
    ring = {"ring.base": _WINDOW + _RING, "ring.sizeLog": _RING_LOG}
    return scene.image, values | scene.values | ring, lines
