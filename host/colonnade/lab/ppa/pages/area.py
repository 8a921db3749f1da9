"""Tables of ``docs/ppa.md``: area by unit, and rays per cycle at the chip's area."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from colonnade.lab.common.markdown import markdown
from colonnade.lab.ppa.pages.text import LIBRARIES

Data = Mapping[str, Any]


def gates(reports: Mapping[str, Data]) -> str:
    """Area of a render unit by unit, largest first, with memories, relative to the chip's area per render unit."""
    first = next(iter(reports.values()))
    chip = first["chip"]["kge_per_unit"]
    own = [name for name, unit in first["units"].items() if unit["level"] == "render_unit"]
    memory = {name: _memory(first, name) for name in own}
    own.sort(key=lambda name: -first["units"][name]["kge"] - memory[name])
    rows = []
    for name in own:
        logic = [report["units"][name]["kge"] for report in reports.values()]
        shares = (f"{100 * (kge + memory[name]) / chip:.0f} %" for kge in logic)
        rows.append([name, *(f"{kge:.1f}" for kge in logic), f"{memory[name]:.1f}", *shares])
    whole = [report["levels"]["render_unit"] for report in reports.values()]
    logic = [level["logic_kge"] for level in whole]
    row = ["**render unit**", *(f"{kge:.1f}" for kge in logic), f"{whole[0]['memory_kge']:.1f}"]
    rows.append([*row, *(f"{100 * level['kge'] / chip:.0f} %" for level in whole)])
    titles = ["unit", *(f"logic kGE, {LIBRARIES[name]}" for name in reports), "memory kGE at 28 nm"]
    titles += [f"share of {chip:.0f} kGE, {LIBRARIES[name]}" for name in reports]
    return markdown(titles, rows)


def _memory(report: Data, unit: str) -> float:
    """Area of a unit's memories in kGE."""
    return float(sum(memory["kge"] for memory in report["memories"].values() if memory["unit"] == unit))


def equal_area(reports: Mapping[str, Data], data: Path) -> str:
    """Rays per cycle of the array relative to the chip at equal area, for several scopes of the array's area."""
    file = data / "bench.json"
    if not file.is_file():
        return ""
    faster = json.loads(file.read_text())["ratio_to_paper"]
    rows = []
    for library, report in reports.items():
        chip, levels = report["chip"], report["levels"]
        array, rows_of_units = levels["array"], levels["column"]["of_the_level_below"]
        units = rows_of_units * array["of_the_level_below"]
        local = array["logic_mm2_28nm"] + units * (
            levels["render_unit"]["mm2_28nm"] - levels["render_unit"]["logic_mm2_28nm"]
        )
        scopes = {
            "logic": array["logic_mm2_28nm"],
            "logic and memories of render units": local,
            "logic and all memories": array["mm2_28nm"],
        }
        for title, mm2 in scopes.items():
            times = mm2 / chip["mm2"]
            rows.append([LIBRARIES[library], title, f"{mm2:.2f}", f"{times:.2f}", f"{faster / times:.1f}"])
    chip_mm2 = next(iter(reports.values()))["chip"]["mm2"]
    titles = ["library", "scope", "area, mm² at 28 nm", f"relative to the chip's {chip_mm2:g} mm²"]
    return markdown([*titles, f"rays per cycle at equal area (of {faster:.1f}×)"], rows)
