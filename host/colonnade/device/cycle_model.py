"""The cycles of a frame by the cycle model: docs/cycles.md.

The bit-exact model renders the frame and notes what it asks of the units of the device. The cycle model in
``cpp/cycles`` simulates the units on these notes, with the latencies of the RTL's structure. No Verilog is built.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from colonnade import _core
from colonnade.common.errors import UserError
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import loaded_model
from colonnade.scene_image.file import SceneImage

#: Cycles of DRAM to the first beat of a line, and from a beat to the next, as in `colonnade.device.verilator.Stalls`.
DRAM_LATENCY, DRAM_INTERVAL = 100, 1


@dataclass(frozen=True)
class NotedFrame:
    """A frame whose work the model has noted.

    Attributes:
        model: A ``colonnade._core.Model`` that holds the notes.
        record_bytes: Bytes of a record.
        counters: Counters that do not depend on time, by name.
        errors: Error bits of the frame.
    """

    model: Any
    record_bytes: int
    counters: Mapping[str, int]
    errors: tuple[str, ...]

    @staticmethod
    def of(manifest: Manifest, image: SceneImage, registers: Mapping[str, int]) -> NotedFrame:
        """Render a frame.

        Args:
            manifest: The manifest of a design with the number formats, the tree and the features of the frame.
            image: What the device holds.
            registers: All rw registers by name.
        """
        model = loaded_model(manifest, image)
        model.start(dict(registers))
        model.note_work(registers["frame.height"])
        errors = tuple(name for name, is_set in model.errors().items() if is_set)
        return NotedFrame(model, int(image.records.shape[1]), model.counters(), errors)

    def cycles(
        self, manifest: Manifest, dram_latency: int = DRAM_LATENCY, dram_interval: int = DRAM_INTERVAL
    ) -> dict[str, int]:
        """The counters of the frame on a design, as the RTL has them; ``cycles`` among them.

        Args:
            manifest: Of a design that renders the same frame: other units and memories, the same number formats.
            dram_latency: Of a design with a cache: cycles from a read of DRAM to its first beat.
            dram_interval: Cycles from a beat to the next one.

        Raises:
            UserError: The cycle model does not know such a design.
        """
        design = design_values(manifest, self.record_bytes)
        try:
            timed = self.model.cycles(design, dram_latency, dram_interval)
        except ValueError as error:
            raise UserError(str(error)) from None
        return {**self.counters, **timed}


def bounce_cycles(manifest: Manifest) -> dict[str, int]:
    """Cycles of a bounce unit by what is hit: docs/shading.md, Bounces.

    Raises:
        ValueError: The cycle model does not know the design.
    """
    cycles: dict[str, int] = _core.bounce_cycles(design_values(manifest, record_bytes=0))
    return cycles


def knows_design(manifest: Manifest) -> bool:
    """Whether the cycle model knows a design: its Limits in docs/cycles.md."""
    try:
        bounce_cycles(manifest)
    except ValueError:
        return False
    return True


def design_values(manifest: Manifest, record_bytes: int) -> dict[str, int]:
    """What the cycle model knows of a design: fields of its configuration by their paths, and its numbers."""
    values = {name: int(value) for name, value in manifest.numbers.items()} | {"recordBytes": record_bytes}

    def add(path: str, value: Any) -> None:
        if isinstance(value, Mapping):
            for key, part in value.items():
                add(f"{path}.{key}" if path else key, part)
        elif isinstance(value, int):
            values[path] = int(value)

    add("", manifest.config)
    return values
