"""The counted part of a recording: its cycles and rays."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from colonnade.common.errors import UserError

from colonnade_lab.ppa.netlist.hierarchy import LEVELS, TRIANGLES
from colonnade_lab.ppa.power.recording import Recording

#: The port of the traversal unit that counts in-box rays.
_IN_BOX = "io_events_intersector_raysInBox"


@dataclass(frozen=True)
class Window:
    """The counted part of a recording.

    Attributes:
        begin: First counted cycle.
        end: The cycle after the last one.
        counts: Numbers of rays, in-box rays and hits of the column, and others of the workload.
        traced: In-box rays of the traversal unit.
        shares: The row's part of the power of each replayed module.
        records_share: The row's part of the reads of records.
    """

    begin: int
    end: int
    counts: Mapping[str, int]
    traced: int
    shares: Mapping[str, float]
    records_share: float

    @property
    def cycles(self) -> int:
        """Number of counted cycles."""
        return self.end - self.begin

    @property
    def rays(self) -> float:
        """The row's part of the rays."""
        return self.counts["rays"] * self.traced / (self.counts["rays_in_box"] or 1)


def window_of(recordings: Mapping[str, Recording], begin: int, end: int, counts: Mapping[str, int]) -> Window:
    """A window of recordings, and the row's shares in it.

    Args:
        recordings: Recordings of all modules that are replayed.
        begin: First counted cycle.
        end: The cycle after the last one.
        counts: See `Window`.

    Raises:
        UserError: The traversal unit traces no ray.
    """
    unit = LEVELS[0].top
    traced = sum(recordings[unit].of(_IN_BOX)[begin:end])
    if not traced:
        raise UserError("the recorded traversal unit traces no ray: use more --cycles, or a larger --size")
    in_box = counts["rays_in_box"]
    names = (port.name for port in recordings[TRIANGLES].inputs)
    served = sum(re.fullmatch(r"io_rows_\d+_candidate_valid", name) is not None for name in names)
    of_group = sum(sum(recordings["RayBus"].of(f"io_units_{row}_valid")[begin:end]) for row in range(served))
    shares = dict.fromkeys(recordings, traced / in_box) | {unit: 1.0, TRIANGLES: traced / of_group}
    return Window(begin, end, counts, traced, shares, traced / in_box)
