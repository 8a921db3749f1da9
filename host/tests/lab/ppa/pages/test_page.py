"""The page of costs: only tables change, missing data is reported; area by unit, and rays per cycle at equal area."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from colonnade.common.errors import UserError
from colonnade.lab.ppa.pages.area import equal_area, gates
from colonnade.lab.ppa.pages.equal_area import at_clock, at_equal_area, rates_of
from colonnade.lab.ppa.pages.page import page


def report() -> dict[str, Any]:
    """Two columns of three render units: 4 mm² of logic; each unit has 0.5 mm² of logic and 0.1 mm² of memories."""
    return {
        "chip": {"kge_per_unit": 100.0, "mm2": 2.0},
        "units": {
            "Small": {"level": "render_unit", "kge": 10.0},
            "Large": {"level": "render_unit", "kge": 30.0},
            "Other": {"level": "column", "kge": 99.0},
        },
        "memories": {"words": {"unit": "Small", "kge": 25.0}},
        "levels": {
            "render_unit": {
                "of_the_level_below": 0,
                "logic_kge": 40.0,
                "memory_kge": 25.0,
                "kge": 65.0,
                "logic_mm2_28nm": 0.5,
                "mm2_28nm": 0.6,
            },
            "column": {"of_the_level_below": 3},
            "array": {"of_the_level_below": 2, "logic_mm2_28nm": 4.0, "mm2_28nm": 8.0},
        },
    }


def test_units_are_sorted_by_area_with_memories() -> None:
    lines = gates({"yosys": report()}).splitlines()
    assert lines[2:] == [
        "| Small | 10.0 | 25.0 | 35 % |",
        "| Large | 30.0 | 0.0 | 30 % |",
        "| **render unit** | 40.0 | 25.0 | 65 % |",
    ]


def test_rays_at_equal_area_scale_with_the_area(tmp_path: Path) -> None:
    assert equal_area({"yosys": report()}, tmp_path) == ""
    (tmp_path / "bench.json").write_text(json.dumps({"ratio_to_paper": 12.0}))
    rows = [line.split("|")[3:6] for line in equal_area({"yosys": report()}, tmp_path).splitlines()[2:]]
    figures = [[float(cell) for cell in row] for row in rows]
    assert figures == [pytest.approx(row) for row in ([4.0, 2.0, 6.0], [4.6, 2.3, 5.2], [8.0, 4.0, 3.0])]


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
    line = at_clock(report() | {"slowest_path": within, "render_unit_paths": across}, 10.0)
    assert "50.0 FO4 of 14 ps, takes 0.70 ns, so at most 1,429 MHz" in line
    assert "2,971 in-box MRay/s" in line
    slower = {"register_to_register": {"fo4": 60.0}}
    assert "60.0 FO4" in at_clock(report() | {"slowest_path": within, "render_unit_paths": slower}, 10.0)
    assert "--liberty" in at_clock(report() | {"slowest_path": {"unit": None}, "render_unit_paths": None}, 10.0)


def test_the_page_keeps_its_text_and_reports_missing_data(tmp_path: Path) -> None:
    text = "# Cost\n<!-- units_32b32s64d -->\nold\n<!-- end -->\nprose\n<!-- ecp5 -->\n<!-- end -->\n"
    missing = "Not measured: run `tools/ppa`."
    written = (
        f"# Cost\n<!-- units_32b32s64d -->\n{missing}\n<!-- end -->\nprose\n<!-- ecp5 -->\n{missing}\n<!-- end -->\n"
    )
    assert page(text, tmp_path) == written
