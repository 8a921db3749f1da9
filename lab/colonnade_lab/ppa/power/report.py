"""The power report of a row that renders a frame or answers a batch of rays: gates, activity and memories.

It is the power of a traversal unit and its share of the modules that work for it: its in-box rays over the ones of the
column.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from colonnade.common.progress import QUIET, Progress
from colonnade.design.generator import GeneratedDesign

from colonnade_lab.ppa.library import energies
from colonnade_lab.ppa.netlist import memories
from colonnade_lab.ppa.netlist.activity import Activity
from colonnade_lab.ppa.netlist.hierarchy import LEVELS, Hierarchy
from colonnade_lab.ppa.netlist.mapped import Netlist
from colonnade_lab.ppa.netlist.synthesis import Technology
from colonnade_lab.ppa.power.activity import NO_POWER, power_of
from colonnade_lab.ppa.power.record import record
from colonnade_lab.ppa.power.recording import Recording
from colonnade_lab.ppa.power.replay import replay
from colonnade_lab.ppa.power.sums import KINDS, Sum
from colonnade_lab.ppa.power.window import Window
from colonnade_lab.ppa.power.workload import Workload
from colonnade_lab.ppa.timing import opensta
from colonnade_lab.ppa.timing.delays import net_timing
from colonnade_lab.ppa.timing.static import Analysis

#: Supply voltage at the chip's node, V.
VOLTAGE_28NM = 0.9


@dataclass(frozen=True)
class Operation:
    """The operating point for power.

    Attributes:
        megahertz: Clock frequency, MHz.
        workloads: A frame, or batches of rays.
    """

    megahertz: float
    workloads: Sequence[Workload]


def measure_power(
    design: GeneratedDesign,
    config: str,
    overrides: Sequence[str],
    hierarchy: Hierarchy,
    netlists: Mapping[str, Any],
    tech: Technology,
    workload: Workload,
    megahertz: float,
    progress: Progress = QUIET,
) -> dict[str, Any]:
    """The power of a workload in a report, with each unit's in ``units``.

    Args:
        design: The design with black-box memories.
        config: Configuration, before `overrides`.
        overrides: Changes to the configuration, ``key.path=value``.
        hierarchy: The hierarchy of the design.
        netlists: All modules in Yosys's JSON.
        tech: The technology, with a library.
        workload: What the hardware does.
        megahertz: Clock frequency, MHz.
        progress: Shows the steps.
    """
    assert tech.library is not None
    ports = {module: netlists[module]["ports"] for module in workload.modules}
    recordings = record(config, overrides, ports, workload, progress)
    window = workload.window(recordings)
    with progress.step("reading the gate netlists"):
        gates = {module: Netlist(netlists, module, tech.library) for module in workload.modules}
        used = {instance.cell.name for netlist in gates.values() for instance in netlist.instances}
        cells = energies.load(tech.sources, used)
    scale = node_scale(tech.library.nand2.area, cells.voltage)
    found = Sum(window, megahertz, scale)
    found.records = _record_power(recordings[LEVELS[0].top], window, design.manifest.record_bits, megahertz)
    second: dict[str, float] | None = None
    for module, netlist in gates.items():
        with progress.step(f"measuring {module}"):
            analysis = Analysis(netlist, tech.library)
            timing = net_timing(analysis, netlist.size)
            recording = replace(recordings[module], cycles=recordings[module].cycles[: window.end])
            activity = replay(netlist, hierarchy, timing.delays, recording, window.begin, progress)
            powers = {
                kind: power_of(netlist, cells, timing, changes, activity.cycles, megahertz)
                for kind, changes in zip(KINDS, (activity.settled, activity.changes), strict=True)
            }
            found.add(module, powers, memory_power(netlist, hierarchy, activity, megahertz))
            if opensta.reads_activities() and module == LEVELS[0].top:
                own = sum(powers["glitch_aware"].values(), NO_POWER)
                other = opensta.power(netlist, tech.sources, activity, analysis.slew, megahertz)
                second = None if other is None else {"ours": own.dynamic + own.leakage, "opensta": other}
    return {
        "of": LEVELS[0].name,
        "clock_mhz": megahertz,
        "volts": cells.voltage,
        "scene": recordings[LEVELS[0].top].scene,
        "window": {"cycles": window.cycles, **window.counts, "rays_traced": window.traced},
        "memories_mw": found.kinds(),
        "memory_pj_per_bit": memories.SRAM[memories.CHIP_NODE].pj_per_bit,
        "scale_to_28nm": scale,
        **found.totals(),
        "units": found.units(),
        "memories": found.memories(),
        "opensta_mw": second,
        "opensta_is_there": opensta.is_available(),
    }


def node_scale(gate_um2: float, volts: float) -> float:
    """The factor that scales dynamic energy (C·V²) of a library to the chip's node and 0.9 V.

    Capacitance scales with length, and length with the square root of a gate's area.
    """
    return float((memories.CHIP_GATE_UM2 / gate_um2) ** 0.5 * (VOLTAGE_28NM / volts) ** 2)


def memory_power(
    netlist: Netlist, hierarchy: Hierarchy, activity: Activity, megahertz: float
) -> dict[tuple[str, str], float]:
    """Power of the memories of a netlist by owner and by the memory's module, mW."""
    found: dict[tuple[str, str], float] = defaultdict(float)
    for box, (reads, writes) in zip(netlist.boxes, activity.accesses, strict=True):
        bits = (reads + writes) * hierarchy.shape(box.kind)[1]
        found[box.owner, box.kind] += _memory_milliwatts(bits, activity.cycles, megahertz)
    return found


def _record_power(recording: Recording, window: Window, record_bits: int, megahertz: float) -> float:
    """Power of the records that the column reads for a row, mW."""
    valid = [port.name for port in recording.inputs if re.fullmatch(r"io_broadcasts(_\d+)?_valid", port.name)]
    reads = sum(sum(recording.of(name)[window.begin : window.end]) for name in valid)
    return _memory_milliwatts(reads * record_bits * window.records_share, window.cycles, megahertz)


def _memory_milliwatts(bits: float, cycles: int, megahertz: float) -> float:
    """The power of `bits` read or written in a number of cycles."""
    # pJ per cycle × MHz = µW
    return bits * memories.SRAM[memories.CHIP_NODE].pj_per_bit * megahertz / cycles / 1e3
