"""Rays per cycle at the chip's area, with everything that the array contains, and rays per second at its node."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from colonnade.common.errors import UserError
from colonnade.common.input_files import read_json

from colonnade_lab.common import paper
from colonnade_lab.ppa.netlist.memories import CHIP_NODE

#: FO4 at the chip's node, ps: 500 ps per µm of drawn gate length, at low voltage and high temperature
#: (Ho, Mai and Horowitz, The Future of Wires, Proceedings of the IEEE 89, 2001).
CHIP_FO4_PS = 14.0


def rates_of(file: Path, config_hash: str) -> float:
    """Rays per cycle relative to the chip, from a report of ``colonnade bench --json``.

    Args:
        file: The report.
        config_hash: The configuration that it must be of.

    Raises:
        UserError: The file is no such report, or of another configuration.
    """
    report = read_json(file, "rates")
    try:
        measured, ratio = report["config_hash"], float(report["ratio_to_paper"])
    except (KeyError, TypeError, ValueError):
        raise UserError(f"rates {file} is not a report of colonnade bench: write one with its --json") from None
    if measured != config_hash:
        raise UserError(
            f"rates {file} is of another configuration: run colonnade bench with the same --config and --set"
        )
    return ratio


def at_equal_area(report: Mapping[str, Any], faster: float) -> str:
    """One line: the area of the array with all memories, relative to the chip, and the rate at the chip's area.

    Args:
        report: Of `colonnade_lab.ppa.measure.measure`.
        faster: Rays per cycle relative to the chip.
    """
    mm2, chip = report["levels"]["array"]["mm2_28nm"], report["chip"]["mm2"]
    return (
        f"everything included: {mm2:,.2f} mm² at {CHIP_NODE}, {mm2 / chip:.2f} times the chip's {chip}; "
        f"{faster:.1f} times its rays per cycle, which is {faster * chip / mm2:.2f} times at equal area"
    )


@dataclass(frozen=True)
class Clock:
    """The clock that the slowest path allows at the chip's node, without wires, skew and margin."""

    fo4: float

    @property
    def nanoseconds(self) -> float:
        """The delay of the path."""
        return self.fo4 * CHIP_FO4_PS / 1e3

    @property
    def megahertz(self) -> float:
        """The frequency."""
        return 1e3 / self.nanoseconds


def fastest_clock(report: Mapping[str, Any]) -> Clock | None:
    """The clock by the slowest path within a unit or across the units of a traversal unit; None without a liberty.

    Args:
        report: Of `colonnade_lab.ppa.measure.measure`.
    """
    path, across = report["slowest_path"], report["traversal_unit_paths"]
    paths = [path["fo4"]] if path["unit"] else []
    if across and across["register_to_register"]:
        paths.append(across["register_to_register"]["fo4"])
    return Clock(max(paths)) if paths else None


def at_clock(report: Mapping[str, Any], faster: float) -> str:
    """One line: the clock that the slowest path allows at the chip's node, and the in-box rays per second at it.

    Args:
        report: Of `colonnade_lab.ppa.measure.measure`, with a liberty.
        faster: In-box rays per cycle relative to the chip.
    """
    clock = fastest_clock(report)
    if clock is None:
        return "clock: needs --liberty, since a path has no delay without"
    return (
        f"clock at {CHIP_NODE}: the slowest path, {clock.fo4:.1f} FO4 of {CHIP_FO4_PS:g} ps, takes "
        f"{clock.nanoseconds:.2f} ns, so at most {clock.megahertz:,.0f} MHz without wires, skew and margin; "
        f"{faster * paper.RAYS_PER_CYCLE * clock.megahertz:,.0f} in-box MRay/s at it"
    )
