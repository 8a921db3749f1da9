"""Rays per cycle at the chip's area, and the clock that the slowest path allows."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from colonnade.common.errors import UserError

from colonnade_lab.ppa.equal_area import at_clock, at_equal_area, rates_of


def report() -> dict[str, Any]:
    """An array of 8 mm², four times the chip."""
    return {"chip": {"mm2": 2.0}, "levels": {"array": {"mm2_28nm": 8.0}}}


def test_the_rate_at_the_area_of_everything_is_of_the_same_configuration(tmp_path: Path) -> None:
    file = tmp_path / "rates.json"
    file.write_text(json.dumps({"ratio_to_paper": 12.0, "config_hash": "same"}))
    line = at_equal_area(report(), rates_of(file, "same"))
    assert "8.00 mm²" in line
    assert "4.00 times the chip's 2.0" in line
    assert "3.00 times at equal area" in line
    with pytest.raises(UserError, match="another configuration"):
        rates_of(file, "other")
    for wrong in ("[]", "{}", '{"ratio_to_paper": "much", "config_hash": "same"}'):
        file.write_text(wrong)
        with pytest.raises(UserError, match="not a report"):
            rates_of(file, "same")


def test_the_clock_is_that_of_the_slowest_path_within_or_across_units() -> None:
    within, across = {"unit": "Small", "fo4": 50.0}, {"register_to_register": {"fo4": 40.0}}
    line = at_clock(report() | {"slowest_path": within, "traversal_unit_paths": across}, 10.0)
    assert "50.0 FO4 of 14 ps, takes 0.70 ns, so at most 1,429 MHz" in line
    assert "2,971 in-box MRay/s" in line
    slower = {"register_to_register": {"fo4": 60.0}}
    assert "60.0 FO4" in at_clock(report() | {"slowest_path": within, "traversal_unit_paths": slower}, 10.0)
    assert "--liberty" in at_clock(report() | {"slowest_path": {"unit": None}, "traversal_unit_paths": None}, 10.0)
