"""Frames by the cycle model: where their cycles go, and two designs against each other (docs/cycles.md)."""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from colonnade.common.errors import UserError
from colonnade.design.frame_limits import check_size
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import loaded_model, model_frame
from colonnade.device.cycle_model import DRAM_INTERVAL, DRAM_LATENCY, NotedFrame
from colonnade.device.device import require_no_errors
from colonnade.mesh.materials.mesh import Mesh
from colonnade.render.report import counted_report
from colonnade.scene.model import Scene
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene_image.dram_image import moved_bytes

from colonnade_lab.evaluation.throughput import figures

#: DRAM latencies at which two designs are compared: a frame's cycles move by more than a per cent between them.
LATENCIES = (99, 100, 101)


def frame_cycles(
    prepared: DeviceScene,
    size: tuple[int, int],
    dram_latency: int = DRAM_LATENCY,
    dram_interval: int = DRAM_INTERVAL,
) -> dict[str, Any]:
    """The report of a frame as of the RTL, with its cycles by the cycle model.

    Args:
        prepared: The scene on the design.
        size: Width and height, pixels.
        dram_latency: Of a design with a cache: cycles from a read to its first beat.
        dram_interval: Cycles from a beat to the next one.

    Returns:
        `colonnade.render.report.FrameReport.as_json`, and `colonnade_lab.evaluation.throughput.figures`.

    Raises:
        UserError: The design is not modelled, or the frame has an error bit.
    """
    manifest, image = prepared.manifest, prepared.image
    check_size(size, manifest)
    noted = NotedFrame.of(manifest, image, prepared.registers(size))
    require_no_errors(noted.errors)
    counters = noted.cycles(manifest, dram_latency, dram_interval)
    report = counted_report("cycles", manifest, image.header, size, counters, noted.errors).as_json()
    report["config_hash"] = manifest.config_hash
    if manifest.config["columnBvhMemory"]["cache"] is not None:
        report["dram_line_bytes"] = moved_bytes(manifest)
    return report | figures(report)


@dataclass(frozen=True)
class Compared:
    """A frame on two designs.

    Attributes:
        name: Of the frame.
        cycles: Of the first design and of the second one, at each latency.
        differing_pixels: Pixels whose colours differ.
    """

    name: str
    cycles: tuple[tuple[int, ...], tuple[int, ...]]
    differing_pixels: int

    @property
    def ratios(self) -> list[float]:
        """Cycles of the first design over the second one's, at each latency."""
        return [first / second for first, second in zip(*self.cycles, strict=True)]

    def as_json(self) -> dict[str, Any]:
        """The frame as values that JSON can hold."""
        return {
            "name": self.name,
            "cycles": [list(cycles) for cycles in self.cycles],
            "differing_pixels": self.differing_pixels,
        }


def compare(name: str, scene: Scene, mesh: Mesh | None, designs: Sequence[Manifest], size: tuple[int, int]) -> Compared:
    """Render a frame on two designs, and count its cycles at each of `LATENCIES`."""
    cycles, colours = [], []
    for manifest in designs:
        prepared = DeviceScene.of(scene, manifest, mesh, size=size)
        check_size(size, manifest)
        registers = prepared.registers(size)
        noted = NotedFrame.of(manifest, prepared.image, registers)
        require_no_errors(noted.errors)
        has_cache = manifest.config["columnBvhMemory"]["cache"] is not None
        found = [noted.cycles(manifest, latency)["cycles"] for latency in (LATENCIES if has_cache else LATENCIES[:1])]
        cycles.append(tuple(found if has_cache else found * len(LATENCIES)))
        colours.append(model_frame(loaded_model(manifest, prepared.image), registers).colour)
    differing = int(np.any(colours[0] != colours[1], axis=2).sum())
    return Compared(name, (cycles[0], cycles[1]), differing)


@dataclass(frozen=True)
class Change:
    """The mean change of several frames: the geometric mean of ratios, and its scatter over `LATENCIES`."""

    mean: float
    scatter: float

    @staticmethod
    def of(frames: Sequence[Compared]) -> Change:
        """The sum of all frames."""
        means = [
            math.exp(statistics.fmean(math.log(frame.ratios[i]) for frame in frames)) for i in range(len(LATENCIES))
        ]
        return Change(statistics.fmean(means) - 1.0, statistics.stdev(means))


def changed_units(reports: Sequence[Mapping[str, Any]]) -> list[tuple[str, float, float]]:
    """Units whose gates differ between two reports of `colonnade ppa`, with the kGE of all instances in a level."""
    first, second = (report["units"] for report in reports)
    names = [*first, *(name for name in second if name not in first)]
    kge = [
        (name, *(float(units[name]["kge"]) if name in units else 0.0 for units in (first, second))) for name in names
    ]
    return [(name, one, other) for name, one, other in kge if one != other]


def require_frames(manifests: Sequence[Manifest]) -> None:
    """A `UserError` for a design that renders no frames."""
    if any(manifest.has_queries for manifest in manifests):
        raise UserError("the cycle model renders frames, and this design has queries")
