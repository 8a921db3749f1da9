"""The power of a report as text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from colonnade.ppa.netlist.memories import CHIP_NODE
from colonnade.ppa.power.report import VOLTAGE_28NM

#: Keys of the two figures, and what they are called.
KINDS = {"zero_delay": "without glitches", "glitch_aware": "with glitches"}


def power_lines(report: Mapping[str, Any]) -> Iterator[str]:
    """Power of a render unit and of its units, energy of a ray, and how they were obtained."""
    power = report["power"]
    window, scene = power["window"], power["scene"]
    yield ""
    width, height = scene["size"]
    yield (
        f"power of a render unit at {power['clock_mhz']:g} MHz and {power['volts']:g} V: {scene['mesh']}, "
        f"{width}×{height}, {window['cycles']:,} cycles, {window['pixels']:,} pixels, {window['rays']:,} rays, "
        f"{window['rays_in_box']:,} of them in box, {window['hits']:,} hits"
    )
    for kind, title in KINDS.items():
        figures = power[kind]
        yield (
            f"  {title}: {figures['total_mw']:.3f} mW ({figures['dynamic_mw']:.3f} dynamic, "
            f"{figures['clock_mw']:.3f} of it clock pins; {figures['leakage_mw']:.4f} leakage; "
            f"{figures['memory_mw']:.3f} memories), {figures['energy_per_ray_nj']:.3f} nJ a ray in box, "
            f"{figures['energy_per_any_ray_nj']:.3f} nJ a ray"
        )
        scaled = figures["at_28nm"]
        yield (
            f"    dynamic × {power['scale_to_28nm']:.3f} (C·V², to {CHIP_NODE} and {VOLTAGE_28NM} V), with memories: "
            f"{scaled['total_mw']:.3f} mW, {scaled['energy_per_ray_nj']:.3f} nJ a ray in box"
        )
    memories = power["memories_mw"]
    yield (
        f"  memories, at {power['memory_pj_per_bit']} pJ a bit: {memories['own']:.4f} mW the unit's own, "
        f"{memories['records']:.4f} its share of the column's records"
    )
    units = {name: unit for name, unit in report["units"].items() if "power_mw" in unit}
    parts = ", ".join(f"{name} {unit['power_mw']:.3f}" for name, unit in units.items())
    yield f"  of it, with glitches, mW: {parts}"
    yield (
        "  By a replay on the gates, held against the RTL in every cycle; no wires, no clock tree; leakage is the mean "
        "of a cell's states. The column's and the array's own units are not in it."
    )
    if power["opensta_mw"] is not None:
        gates = power["glitch_aware"]["dynamic_mw"] + power["glitch_aware"]["leakage_mw"]
        yield f"  OpenSTA, on PATH, with the same activities: {power['opensta_mw']:.3f} mW of gates; ours {gates:.3f}"
    elif power["opensta_is_there"]:
        yield "  OpenSTA, on PATH, reads no SAIF: no second opinion on power."
