"""The values at the ports of modules while the RTL works, cycle by cycle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

#: Ports with a special role in a recording or its replay.
CLOCK, RESET, START = "clock", "reset", "io_start"


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
        scene: What the hardware does, for reports.
    """

    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    cycles: tuple[tuple[int, int], ...]
    idle_cycles: int
    scene: Mapping[str, Any]

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
