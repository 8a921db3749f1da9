"""The page of the demonstration: its videos, and a table of time and energy a frame."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from colonnade_lab.evaluation.demonstration.measure import FrameCost
from colonnade_lab.evaluation.demonstration.moved import MovedCost

#: The device's clock.
MEGAHERTZ = 200.0


@dataclass(frozen=True)
class Way:
    """One way to the maps of a moving camera.

    Attributes:
        every: Number of frames from a keyframe to the next.
        costs: Of its frames.
        video: MP4 file.
    """

    every: int
    costs: Sequence[FrameCost]
    video: Path

    @property
    def title(self) -> str:
        """For headings."""
        return "maps of each frame" if self.every == 1 else f"maps of every {self.every}th frame"


@dataclass(frozen=True)
class Energy:
    """Energy of a ray.

    Attributes:
        nanojoules: At 28 nm, with glitches.
        source: The data file.
    """

    nanojoules: float
    source: str


def mean_of(costs: Sequence[FrameCost], value: Callable[[FrameCost], float | None]) -> float | None:
    """The mean of a value over the frames that have it; None without one."""
    found = [one for cost in costs if (one := value(cost)) is not None]
    return sum(found) / len(found) if found else None


def figures(costs: Sequence[FrameCost], energy: Energy) -> dict[str, float | None]:
    """Means of a frame, milliseconds and microjoules. Loads and encodings are spread over all frames.

    Keys: ``encode``, ``worst_encode`` (of a keyframe), ``registers``, ``load``, ``frame``; ``device`` and ``live``,
    their sums without and with the encoder; ``microjoules``.
    """
    milliseconds = 1e-3 / MEGAHERTZ
    found: dict[str, float | None] = {
        "encode": mean_of(costs, lambda cost: cost.encode_ms),
        "worst_encode": max(cost.encode_ms for cost in costs[1:] or costs),
        "registers": mean_of(costs, lambda cost: cost.registers_ms),
        "load": mean_of(costs, lambda cost: milliseconds * cost.load_cycles),
        "frame": mean_of(costs, lambda cost: None if cost.cycles is None else milliseconds * cost.cycles),
    }
    parts = [found[name] for name in ("registers", "load", "frame")]
    known = [part for part in parts if part is not None]
    found["device"] = sum(known) if len(known) == len(parts) else None
    encode, device = found["encode"], found["device"]
    found["live"] = None if device is None or encode is None else device + encode
    rays = mean_of(costs, lambda cost: cost.rays_in_box)
    return found | {"microjoules": None if rays is None else 1e-3 * rays * energy.nanojoules}


@dataclass(frozen=True)
class Moved:
    """The frames of a scene whose objects move.

    Attributes:
        triangles: Of all objects.
        bent: Figures of meshes that bend.
        costs: Of its frames.
        video: MP4 file.
        rate: Frames a second of the video.
    """

    triangles: int
    bent: int
    costs: Sequence[MovedCost]
    video: Path
    rate: float

    def figures(self, energy: Energy) -> dict[str, float | None]:
        """Means of a frame with all of its samples.

        Keys: ``encode``, milliseconds; ``refit``, milliseconds, and ``triangles``, refitted in one; ``rays`` in the
        objects' box, ``nodes``, read by one of them, ``worst_nodes``, of the worst frame; ``steps`` of marches;
        ``load`` of the maps and ``frame``, milliseconds; ``rate``, of both, a second; ``millijoules``.
        """

        def mean(value: Callable[[MovedCost], float]) -> float:
            return sum(map(value, self.costs)) / len(self.costs)

        refit = mean(lambda cost: cost.refit_ms)
        rays = mean(lambda cost: cost.samples * cost.rays_in_box)
        cycles = [cost.samples * cost.cycles for cost in self.costs if cost.cycles is not None]
        frame = 1e-3 * sum(cycles) / len(cycles) / MEGAHERTZ if cycles else None
        load = 1e-3 * mean(lambda cost: cost.load_cycles) / MEGAHERTZ
        return {
            "encode": mean(lambda cost: cost.encode_ms),
            "refit": refit,
            "triangles": self.bent / refit,
            "rays": rays,
            "nodes": mean(lambda cost: cost.node_reads) / mean(lambda cost: cost.rays_in_box),
            "worst_nodes": max(cost.node_reads / max(cost.rays_in_box, 1) for cost in self.costs),
            "steps": mean(lambda cost: cost.samples * cost.march_steps),
            "load": load,
            "frame": frame,
            "rate": None if frame is None else 1e3 / (load + frame),
            "millijoules": 1e-6 * rays * energy.nanojoules,
        }

    def rows(self, energy: Energy) -> list[dict[str, str]]:
        """Rows of the page's table."""
        found = self.figures(energy)
        names = {
            "encode": "live encoder on a core: ms",
            "refit": "pose, vertices and records, the driver on a core: ms",
            "triangles": "refitted triangles a millisecond",
            "rays": "rays in the objects' box",
            "nodes": "nodes that one of them reads",
            "worst_nodes": "of the worst frame",
            "steps": "march steps",
            "load": "load of the maps, 200 MHz: ms",
            "frame": "frame, 200 MHz: ms",
            "rate": "frames a second of the device",
            "millijoules": "energy of the rays: mJ",
        }
        return [
            {"name": name, "cell": "–" if (value := found[key]) is None else _number(value)}
            for key, name in names.items()
        ]

    def simulated(self) -> list[list[str]]:
        """Rows of frames that the RTL rendered."""
        return [
            [f"{number}", f"{cost.rays_in_box:,}", f"{cost.march_steps:,}", f"{cost.cycles:,}", f"{cost.differing:,}"]
            for number, cost in enumerate(self.costs)
            if cost.cycles is not None
        ]


def _number(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000 else f"{value:.4g}"


def page(
    ways: Sequence[Way],
    size: tuple[int, int],
    rate: float,
    notes: Sequence[str],
    energy: Energy,
    moved: Moved | None = None,
) -> str:
    """The HTML of the page, with its videos.

    Args:
        ways: The ways to compare; none: that part is left out.
        size: Of the frames, pixels.
        rate: Frames a second.
        notes: How it was measured, one sentence each.
        energy: Of a ray.
        moved: Frames of objects that move; None: that part is left out.
    """
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("live.html.jinja").render(
        frames=len(ways[0].costs) if ways else 0,
        size=f"{size[0]}×{size[1]} pixels",
        rate=f"{rate:g}",
        ways=[{"title": way.title, "video": base64.b64encode(way.video.read_bytes()).decode("ascii")} for way in ways],
        rows=_rows([figures(way.costs, energy) for way in ways]),
        notes=notes,
        simulated=[row for way in ways for row in _simulated(way)],
        moved=None if moved is None else _moved_part(moved, energy),
    )


def _moved_part(moved: Moved, energy: Energy) -> dict[str, Any]:
    return {
        "frames": len(moved.costs),
        "rate": f"{moved.rate:g}",
        "triangles": f"{moved.triangles:,}",
        "samples": moved.costs[0].samples,
        "video": base64.b64encode(moved.video.read_bytes()).decode("ascii"),
        "rows": moved.rows(energy),
        "simulated": moved.simulated(),
    }


def _rows(columns: Sequence[Mapping[str, float | None]]) -> list[dict[str, Any]]:
    def row(name: str, key: str, unit: str = "ms", is_sum: bool = False) -> dict[str, Any]:
        cells = ["–" if column[key] is None else f"{column[key]:.3g} {unit}" for column in columns]
        return {"name": name, "cells": cells, "is_sum": is_sum}

    def rate(name: str, key: str) -> dict[str, Any]:
        cells = ["–" if not (value := column[key]) else f"{1e3 / value:,.0f}" for column in columns]
        return {"name": name, "cells": cells, "is_sum": True}

    return [
        row("registers, colonnade_view on a core", "registers"),
        row("load of the maps, 200 MHz", "load"),
        row("frame, 200 MHz", "frame"),
        row("sum with maps given", "device", is_sum=True),
        rate("frames a second with maps given", "device"),
        row("live encoder on a core, mean of all frames", "encode"),
        row("the slowest keyframe after the first", "worst_encode"),
        row("sum with the live encoder", "live", is_sum=True),
        rate("frames a second with the live encoder", "live"),
        row("energy of the rays in the object's box", "microjoules", "µJ"),
    ]


def _simulated(way: Way) -> list[list[str]]:
    return [
        [
            str(number),
            "its own" if number % way.every == 0 else f"those of frame {number - number % way.every}",
            f"{cost.rays_in_box:,}",
            f"{cost.march_steps:,}",
            f"{cost.cycles:,}",
            f"{1e-3 * cost.cycles / MEGAHERTZ:.2f}",
            f"{cost.differing:,}",
        ]
        for number, cost in enumerate(way.costs)
        if cost.cycles is not None
    ]
