"""A single delay and slew per net from the liberty's tables, for the simulation with glitches."""

from __future__ import annotations

from dataclasses import dataclass

from colonnade_lab.ppa.library.cells import Arc
from colonnade_lab.ppa.timing.static import Analysis


@dataclass(frozen=True)
class NetTiming:
    """Delay of the driver (ps, at least 1), slew (ns) and load (pF) of each net."""

    delays: list[int]
    slews: list[float]
    loads: list[float]


def net_timing(analysis: Analysis, size: int) -> NetTiming:
    """The timing of each net: means over both edges and all arcs to the driving pin, with ideal wires."""
    delays, slews = [1] * size, [analysis.slew] * size
    for instance in (*analysis.registers, *analysis.order):
        for pin, arcs in analysis.outputs(instance.cell):
            net = instance.nets.get(pin.name)
            # Gated clocks are ideal
            if net is None or not arcs or instance.cell.clock_gate:
                continue
            load, found = analysis.loads[net], []
            for arc in arcs:
                slew = analysis.slew if instance.cell.is_register else slews[instance.nets.get(arc.related, net)]
                found.append((_mean(arc, "cell", slew, load), _mean(arc, "transition", slew, load)))
            delays[net] = max(1, round(1e3 * sum(delay for delay, _ in found) / len(found)))
            slews[net] = sum(slew for _, slew in found) / len(found)
    return NetTiming(delays, slews, analysis.loads)


def _mean(arc: Arc, kind: str, slew: float, load: float) -> float:
    names = ("cell_rise", "cell_fall") if kind == "cell" else ("rise_transition", "fall_transition")
    values = [arc.tables[name].at(slew, load) for name in names if name in arc.tables]
    return sum(values) / len(values)
