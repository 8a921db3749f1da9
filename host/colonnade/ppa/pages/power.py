"""The tables of power in ``docs/ppa.md``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from colonnade.common.markdown import markdown
from colonnade.ppa.pages.power_text import KINDS
from colonnade.ppa.pages.text import LIBRARIES

Data = Mapping[str, Any]

#: The chip: mW of all, in nJ a ray, by the paper.
PAPER_MILLIWATTS, PAPER_RAYS_PER_SECOND, PAPER_UNITS = 69.5, 41.6e6, 80


def power_table(reports: Mapping[str, Data]) -> str:
    """A render unit by each library, with and without glitches, and scaled to the chip's node."""
    rows: list[list[str]] = []
    heads = []
    for library, report in _measured(reports).items():
        power = report["power"]
        for kind, title in KINDS.items():
            figures = power[kind]
            row = [f"{LIBRARIES[library]}, {power['volts']:g} V", title]
            row += [f"{figures[f'{part}_mw']:.3f}" for part in ("dynamic", "clock", "leakage", "memory", "total")]
            row += [f"{figures['energy_per_ray_nj']:.3f}", f"{figures['energy_per_any_ray_nj']:.3f}"]
            scaled = figures["at_28nm"]
            rows.append([*row, f"{scaled['total_mw']:.1f}", f"{scaled['energy_per_ray_nj']:.2f}"])
        window, scene = power["window"], power["scene"]
        size = "×".join(map(str, scene["size"]))
        heads.append(
            f"{LIBRARIES[library]}: {power['clock_mhz']:g} MHz; {scene['mesh']} at {size}, "
            f"{window['cycles']:,} cycles with {window['rays']:,} rays, {window['rays_in_box']:,} of them in box, "
            f"{window['hits']:,} hits; × {power['scale_to_28nm']:.3f} to 28 nm."
        )
    if not rows:
        return ""
    each = PAPER_MILLIWATTS / PAPER_UNITS
    energy = f"{PAPER_MILLIWATTS * 1e6 / PAPER_RAYS_PER_SECOND:.2f}"
    rows.append(["the chip ÷ 80, whole", *[""] * 8, f"{each:.2f}", energy])
    titles = ["library", "", "dynamic, mW", "of it clock pins", "leakage", "memories", "total, mW", "nJ a ray in box"]
    table = markdown([*titles, "nJ a ray", "at 28 nm, mW", "nJ a ray in box, 28 nm"], rows)
    return "\n".join(heads) + f"\n\n{table}"


def unit_power_table(reports: Mapping[str, Data]) -> str:
    """mW of each unit of a render unit, with glitches, and its share."""
    found = _measured(reports)
    if not found:
        return ""
    names = [name for name, unit in next(iter(found.values()))["units"].items() if "power_mw" in unit]
    rows = []
    for name in names:
        row = [name]
        for report in found.values():
            unit, total = report["units"][name], sum(report["units"][other]["power_mw"] for other in names)
            row += [f"{unit['power_mw']:.3f}", f"{unit['clock_mw']:.3f}", f"{100 * unit['power_mw'] / total:.0f} %"]
        rows.append(row)
    titles = [
        f"{title}, {LIBRARIES[library]}" for library in found for title in ("with glitches, mW", "of it clock", "share")
    ]
    return markdown(["unit", *titles], rows)


def _measured(reports: Mapping[str, Data]) -> dict[str, Data]:
    return {library: report for library, report in reports.items() if report.get("power")}
