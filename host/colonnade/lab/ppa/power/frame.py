"""The counted part of a recorded frame: its cycles and rays."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from colonnade.common.errors import UserError
from colonnade.lab.ppa.netlist.hierarchy import SHARED_TRIANGLES
from colonnade.lab.ppa.power.recording import Recording

#: Ports that count positions, pixels, shadow rays and hits, of the module that follows paths.
_POSITIONS, _PIXELS, _SHADOW, _HITS = "io_positions", "io_pixels", "io_events_raysShadow", "io_events_hits"

#: Ports that count in-box rays: of the module that traces rays, and of a column.
_IN_BOX, _COLUMN_RAYS = "io_events_raysInBox", "io_rays"


@dataclass(frozen=True)
class Frame:
    """The counted part of a recorded frame.

    Attributes:
        begin: First counted cycle.
        end: The cycle after the last one.
        counts: Numbers of pixels, rays (primary and shadow), in-box rays and hits: of the render unit, or of the column
            if it has a path unit.
        traced: In-box rays of the render unit.
        shares: The render unit's part of the power of each replayed module.
        records_share: The render unit's part of the reads of records.
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
        """The render unit's part of the rays."""
        return self.counts["rays"] * self.traced / (self.counts["rays_in_box"] or 1)


def frame_of(recordings: Mapping[str, Recording], modules: Sequence[str], rows: int) -> Frame:
    """The cycles from the first input position to the last output pixel, and the rays in them.

    Args:
        recordings: The recordings of all `modules`.
        modules: The replayed modules, the render unit first; see `Hierarchy.replayed`.
        rows: Render units of a column.

    Raises:
        UserError: No pixel has left, or no in-box ray is traced.
    """
    unit, *others = (recordings[module] for module in modules)
    paths = others[0] if others else unit
    positions, pixels = paths.fires(_POSITIONS), paths.fires(_PIXELS)
    if True not in positions or True not in pixels:
        raise UserError("the recorded frame has no pixel: use more --cycles, or a larger --size")
    begin, end = positions.index(True), len(pixels) - pixels[::-1].index(True)
    traced = sum(unit.of(_IN_BOX)[begin:end])
    if others and not traced:
        raise UserError("the recorded render unit traces no ray: use more --cycles, or a larger --size")
    in_box = sum(recordings["PathHits"].fires(_COLUMN_RAYS)[begin:end]) if others else traced
    shadow = sum(paths.of(_SHADOW)[begin:end])
    counts = {
        "pixels": sum(pixels[begin:end]),
        "rays": sum(positions[begin:end]) + shadow,
        "rays_in_box": in_box,
        "hits": sum(paths.of(_HITS)[begin:end]),
    }
    shares = {modules[0]: 1.0} | {module: traced / in_box for module in modules[1:]}
    if SHARED_TRIANGLES in modules:
        names = (port.name for port in recordings[SHARED_TRIANGLES].inputs)
        served = sum(re.fullmatch(r"io_rows_\d+_candidate_valid", name) is not None for name in names)
        rays = (sum(recordings["RayBus"].of(f"io_units_{row}_valid")[begin:end]) for row in range(served))
        shares[SHARED_TRIANGLES] = traced / sum(rays)
    return Frame(begin, end, counts, traced, shares, traced / in_box if others else 1 / rows)
