"""Rays per cycle at the chip's area, with everything that the array contains."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from colonnade.common.errors import UserError
from colonnade.common.input_files import read_json
from colonnade.ppa.netlist.memories import CHIP_NODE


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
        report: Of `colonnade.ppa.measure.measure`.
        faster: Rays per cycle relative to the chip.
    """
    mm2, chip = report["levels"]["array"]["mm2_28nm"], report["chip"]["mm2"]
    return (
        f"everything included: {mm2:,.2f} mm² at {CHIP_NODE}, {mm2 / chip:.2f} times the chip's {chip}; "
        f"{faster:.1f} times its rays per cycle, which is {faster * chip / mm2:.2f} times at equal area"
    )
