"""The power section of the text report."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from colonnade_lab.ppa.netlist.memories import CHIP_NODE
from colonnade_lab.ppa.power.report import VOLTAGE_28NM

#: Titles of the two power figures, by key.
KINDS = {"zero_delay": "without glitches", "glitch_aware": "with glitches"}

#: What the figures leave out.
OUTSIDE = (
    "Units of the column that work for several rows count with this row's share of the in-box rays; other units of "
    "column and array are not included."
)


def power_lines(power: Mapping[str, Any], units: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Power of a row and of its units, energy per ray, and the method, of a workload."""
    window, scene = power["window"], power["scene"]
    yield ""
    size = scene.get("size")
    what = f"{size[0]}×{size[1]}, {window['pixels']:,} pixels" if size else f"batch of {scene['kind']}"
    yield (
        f"power of a row at {power['clock_mhz']:g} MHz and {power['volts']:g} V: {scene['mesh']}, "
        f"{what}, {window['cycles']:,} cycles, {window['rays']:,} rays, "
        f"{window['rays_in_box']:,} in-box rays, {window['hits']:,} hits in the column, "
        f"whose row 0 traces {window['rays_traced']:,} of them"
    )
    for kind, title in KINDS.items():
        figures = power[kind]
        yield (
            f"  {title}: {figures['total_mw']:.3f} mW ({figures['dynamic_mw']:.3f} dynamic, "
            f"including {figures['clock_mw']:.3f} at clock pins; {figures['leakage_mw']:.4f} leakage; "
            f"{figures['memory_mw']:.3f} memories), {figures['energy_per_ray_nj']:.3f} nJ per in-box ray, "
            f"{figures['energy_per_any_ray_nj']:.3f} nJ per ray"
        )
        scaled = figures["at_28nm"]
        yield (
            f"    dynamic × {power['scale_to_28nm']:.3f} (C·V², to {CHIP_NODE} and {VOLTAGE_28NM} V), with memories: "
            f"{scaled['total_mw']:.3f} mW, {scaled['energy_per_ray_nj']:.3f} nJ per in-box ray"
        )
    memories = power["memories_mw"]
    yield (
        f"  memories, at {power['memory_pj_per_bit']} pJ per bit: {memories['own']:.4f} mW in the row, "
        f"{memories['records']:.4f} mW for its share of the column memory"
    )
    yield f"  by unit, with glitches, and energy per in-box ray at {CHIP_NODE} without and with glitches:"
    for name, unit in units.items():
        if "power_mw" in unit:
            energies = (unit["energy_per_ray_nj_at_28nm"][kind] for kind in KINDS)
            without, glitches = (f"{1e3 * energy:.1f}" for energy in energies)
            yield f"    {name:22}{unit['power_mw']:8.3f} mW {without:>8} {glitches:>8} pJ"
    yield "  memories by energy per in-box ray:"
    for memory in power["memories"]:
        if memory["energy_per_ray_nj"]:
            yield f"    {memory['memory']} in {memory['unit']}: {1e3 * memory['energy_per_ray_nj']:.1f} pJ"
    yield (
        "  Method: replay on the gate netlist, checked against the RTL in every cycle; no wires, no clock tree; mean "
        f"leakage over the states of a cell. {OUTSIDE}"
    )
    if power["opensta_mw"] is not None:
        ours, other = (power["opensta_mw"][name] for name in ("ours", "opensta"))
        yield f"  gates of the traversal unit by OpenSTA with the same activity: {other:.3f} mW; ours: {ours:.3f} mW"
    elif power["opensta_is_there"]:
        yield "  The OpenSTA on PATH cannot read SAIF: power is not cross-checked."
