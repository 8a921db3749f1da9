"""Tables of ``docs/ppa.md``: power of a render unit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from colonnade.lab.common.markdown import markdown
from colonnade.lab.ppa.pages.power_text import KINDS
from colonnade.lab.ppa.pages.text import LIBRARIES

Data = Mapping[str, Any]

#: The paper's chip: power, ray rate and number of render units.
PAPER_MILLIWATTS, PAPER_RAYS_PER_SECOND, PAPER_UNITS = 69.5, 41.6e6, 80


def power_table(reports: Mapping[str, Data]) -> str:
    """Power of a render unit by library, with and without glitches, and scaled to the chip's node."""
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
            f"{window['cycles']:,} cycles with {window['rays']:,} rays, {window['rays_in_box']:,} in-box rays, "
            f"{window['hits']:,} hits; scaling to 28 nm: × {power['scale_to_28nm']:.3f}."
        )
    if not rows:
        return ""
    each = PAPER_MILLIWATTS / PAPER_UNITS
    energy = f"{PAPER_MILLIWATTS * 1e6 / PAPER_RAYS_PER_SECOND:.2f}"
    rows.append(["chip ÷ 80, total", *[""] * 8, f"{each:.2f}", energy])
    titles = ["library", "glitches", "dynamic, mW", "clock pins, mW", "leakage, mW", "memories, mW", "total, mW"]
    titles += ["nJ per in-box ray", "nJ per ray"]
    table = markdown([*titles, "total at 28 nm, mW", "nJ per in-box ray at 28 nm"], rows)
    return "\n".join(heads) + f"\n\n{table}"


def unit_power_table(reports: Mapping[str, Data]) -> str:
    """Power of each unit of a render unit with glitches, and its share."""
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
        f"{title}, {LIBRARIES[library]}" for library in found for title in ("total, mW", "clock pins, mW", "share")
    ]
    return markdown(["unit", *titles], rows)


def _measured(reports: Mapping[str, Data]) -> dict[str, Data]:
    return {library: report for library, report in reports.items() if report.get("power")}
