"""The counted part of a recorded frame: its cycles and rays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from colonnade.common.errors import UserError
from colonnade.ppa.power.recording import Recording

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
        share: The render unit's part of the power of the modules that follow its paths.
        records_share: The render unit's part of the reads of records.
    """

    begin: int
    end: int
    counts: Mapping[str, int]
    traced: int
    share: float
    records_share: float

    @property
    def cycles(self) -> int:
        """Number of counted cycles."""
        return self.end - self.begin


def frame_of(recordings: Mapping[str, Recording], modules: Sequence[str], rows: int) -> Frame:
    """The cycles from the first input position to the last output pixel, and the rays in them.

    Args:
        recordings: The recordings of all `modules`.
        modules: The render unit, and with a path unit the modules that follow its paths, `PATH_MODULES`.
        rows: Render units of a column.

    Raises:
        UserError: No pixel has left, or no in-box ray is traced.
    """
    unit, *others = (recordings[module] for module in modules)
    paths, column = (others[0], others[1]) if others else (unit, unit)
    positions, pixels = paths.fires(_POSITIONS), paths.fires(_PIXELS)
    if True not in positions or True not in pixels:
        raise UserError("the recorded frame has no pixel: use more --cycles, or a larger --size")
    begin, end = positions.index(True), len(pixels) - pixels[::-1].index(True)
    traced = sum(unit.of(_IN_BOX)[begin:end])
    if others and not traced:
        raise UserError("the recorded render unit traces no ray: use more --cycles, or a larger --size")
    in_box = sum(column.fires(_COLUMN_RAYS)[begin:end]) if others else traced
    shadow = sum(paths.of(_SHADOW)[begin:end])
    counts = {
        "pixels": sum(pixels[begin:end]),
        "rays": sum(positions[begin:end]) + shadow,
        "rays_in_box": in_box,
        "hits": sum(paths.of(_HITS)[begin:end]),
    }
    share = traced / in_box if others else 1.0
    return Frame(begin, end, counts, traced, share, share if others else 1 / rows)
