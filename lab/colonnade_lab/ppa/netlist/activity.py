"""The activity of a gate netlist, by which its power is computed."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Activity:
    """Activity of the gate netlist in the counted cycles.

    Attributes:
        cycles: Number of cycles.
        changes: Transitions of each net, including glitches.
        settled: Transitions of each net without glitches: cycles with a changed final value.
        high: Share of the cycles that end with the net at 1.
        accesses: Reads and writes of each memory, in the order of the netlist's boxes.
    """

    cycles: int
    changes: tuple[int, ...]
    settled: tuple[int, ...]
    high: tuple[float, ...]
    accesses: tuple[tuple[int, int], ...]
