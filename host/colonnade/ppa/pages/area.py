"""The tables in ``docs/ppa.md`` of where the gates are, and of what the array's rays are worth at the chip's area."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from colonnade.common.markdown import markdown
from colonnade.ppa.pages.text import LIBRARIES

Data = Mapping[str, Any]


def gates(reports: Mapping[str, Data]) -> str:
    """Units of a render unit, the largest first, with their memories, against all the chip has for one."""
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
    titles = ["unit", *(f"kGE, {LIBRARIES[name]}" for name in reports), "memories, kGE at 28 nm"]
    titles += [f"of {chip:.0f} kGE, {LIBRARIES[name]}" for name in reports]
    return markdown(titles, rows)


def _memory(report: Data, unit: str) -> float:
    """Thousands of gates, as area, of a unit's memories."""
    return float(sum(memory["kge"] for memory in report["memories"].values() if memory["unit"] == unit))


def equal_area(reports: Mapping[str, Data], data: Path) -> str:
    """Rays per cycle of the array over the chip's, at equal area, by what is counted of the array."""
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
        counted = {
            "logic": array["logic_mm2_28nm"],
            "and the render units' memories": local,
            "and the columns' memories": array["mm2_28nm"],
        }
        for title, mm2 in counted.items():
            times = mm2 / chip["mm2"]
            rows.append([LIBRARIES[library], title, f"{mm2:.2f}", f"{times:.2f}", f"{faster / times:.1f}"])
    chip_mm2 = next(iter(reports.values()))["chip"]["mm2"]
    titles = ["library", "counted", "mm² at 28 nm", f"of the chip's {chip_mm2:g} mm²"]
    return markdown([*titles, f"what remains of {faster:.1f} times its rays per cycle"], rows)
