"""The counted part of a recorded frame: its cycles and rays."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from colonnade.common.errors import UserError

from colonnade_lab.ppa.netlist.hierarchy import REPLAYED, TRIANGLES
from colonnade_lab.ppa.power.recording import Recording

#: Ports that count positions, pixels, shadow rays and hits, of the module that follows paths.
_POSITIONS, _PIXELS, _SHADOW, _HITS = "io_positions", "io_pixels", "io_events_raysShadow", "io_events_hits"

#: Ports that count in-box rays: of the module that traces rays, and of a column.
_IN_BOX, _COLUMN_RAYS = "io_events_intersector_raysInBox", "io_rays"


@dataclass(frozen=True)
class Frame:
    """The counted part of a recorded frame.

    Attributes:
        begin: First counted cycle.
        end: The cycle after the last one.
        counts: Numbers of pixels, rays (primary and shadow), in-box rays and hits of the column.
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


def frame_of(recordings: Mapping[str, Recording]) -> Frame:
    """The cycles from the first input position to the last output pixel, and the rays in them.

    Args:
        recordings: The recordings of all modules of `REPLAYED`.

    Raises:
        UserError: No pixel has left, or no in-box ray is traced.
    """
    unit, paths = (recordings[module] for module in REPLAYED[:2])
    positions, pixels = paths.fires(_POSITIONS), paths.fires(_PIXELS)
    if True not in positions or True not in pixels:
        raise UserError("the recorded frame has no pixel: use more --cycles, or a larger --size")
    begin, end = positions.index(True), len(pixels) - pixels[::-1].index(True)
    traced = sum(unit.of(_IN_BOX)[begin:end])
    if not traced:
        raise UserError("the recorded traversal unit traces no ray: use more --cycles, or a larger --size")
    in_box = sum(recordings["PathHits"].fires(_COLUMN_RAYS)[begin:end])
    shadow = sum(paths.of(_SHADOW)[begin:end])
    counts = {
        "pixels": sum(pixels[begin:end]),
        "rays": sum(positions[begin:end]) + shadow,
        "rays_in_box": in_box,
        "hits": sum(paths.of(_HITS)[begin:end]),
    }
    names = (port.name for port in recordings[TRIANGLES].inputs)
    served = sum(re.fullmatch(r"io_rows_\d+_candidate_valid", name) is not None for name in names)
    of_group = sum(sum(recordings["RayBus"].of(f"io_units_{row}_valid")[begin:end]) for row in range(served))
    shares = dict.fromkeys(REPLAYED, traced / in_box) | {REPLAYED[0]: 1.0, TRIANGLES: traced / of_group}
    return Frame(begin, end, counts, traced, shares, traced / in_box)
