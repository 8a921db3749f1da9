"""What a render unit takes while it renders a real frame: gates, activity and memories in one report."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from colonnade.common.errors import UserError
from colonnade.common.progress import QUIET, Progress
from colonnade.design.generator import GeneratedDesign
from colonnade.ppa.library import energies
from colonnade.ppa.netlist import memories
from colonnade.ppa.netlist.hierarchy import LEVELS, Hierarchy
from colonnade.ppa.netlist.mapped import Netlist
from colonnade.ppa.netlist.synthesis import Technology
from colonnade.ppa.power.activity import Power, power_of
from colonnade.ppa.power.recording import Recording, Stimulus, record
from colonnade.ppa.power.replay import Activity, replay
from colonnade.ppa.timing import opensta
from colonnade.ppa.timing.delays import net_timing
from colonnade.ppa.timing.static import Analysis

#: The module that is replayed, and its level.
TOP = "RenderUnit"
LEVEL = LEVELS[0]

#: Voltage of the chip's node.
VOLTAGE_28NM = 0.9

#: Ports that tell what a render unit did.
_POSITIONS, _PIXELS = "io_positions", "io_pixels"
_IN_BOX, _SHADOW, _HITS = "io_events_raysInBox", "io_events_raysShadow", "io_events_hits"


@dataclass(frozen=True)
class Operation:
    """How a render unit is run.

    Attributes:
        megahertz: the clock.
        stimulus: the frame.
    """

    megahertz: float
    stimulus: Stimulus


def measure_power(
    design: GeneratedDesign,
    config: str,
    overrides: Sequence[str],
    hierarchy: Hierarchy,
    netlists: Mapping[str, Any],
    into: Technology,
    operation: Operation,
    progress: Progress = QUIET,
) -> dict[str, Any]:
    """The ``power`` of a report, with the power of each unit in ``units``.

    Args:
        design: the configuration's, with black boxes.
        config: name of the configuration, with `overrides` applied.
        overrides: ``key.path=value`` changes.
        hierarchy: of the design.
        netlists: every module of a render unit in Yosys's JSON.
        into: the library.
        operation: clock and frame.
        progress: shows the steps.
    """
    assert into.library is not None
    ports = netlists[TOP]["ports"]
    recording, begin = _between_pixels(record(config, overrides, TOP, ports, operation.stimulus, progress))
    with progress.step("joining the gates of a render unit"):
        netlist = Netlist(netlists, TOP, into.library)
        analysis = Analysis(netlist, into.library)
        timing = net_timing(analysis, netlist.size)
        cells = energies.load(into.sources, {instance.cell.name for instance in netlist.instances})
    activity = replay(netlist, hierarchy, timing.delays, recording, begin, progress)
    with progress.step("adding up the power"):
        megahertz = operation.megahertz
        of_unit, kinds = _memories(netlist, hierarchy, recording, activity, begin, design, megahertz)
        rays = _rays(recording, begin)
        scale = node_scale(into.library.nand2.area, cells.voltage)
        totals, units = dict[str, dict[str, Any]](), dict[str, dict[str, float]]()
        for name, changes in (("zero_delay", activity.settled), ("glitch_aware", activity.changes)):
            found = by_unit(power_of(netlist, cells, timing, changes, activity.cycles, megahertz))
            total = _total(found.values(), sum(kinds.values()))
            totals[name] = {
                **total,
                **_energies(total["total_mw"], rays, activity.cycles, megahertz),
                "at_28nm": _scaled(total, scale, rays, activity.cycles, megahertz),
            }
            units = {unit: _of_unit(power, of_unit.get(unit, 0.0)) for unit, power in found.items()}
        second = None
        if opensta.reads_activities():
            second = opensta.power(netlist, into.sources, activity, analysis.slew, megahertz)
    return {
        "of": LEVEL.name,
        "clock_mhz": megahertz,
        "volts": cells.voltage,
        "scene": recording.scene,
        "window": {"cycles": activity.cycles, **rays},
        "memories_mw": kinds,
        "memory_pj_per_bit": memories.SRAM[memories.CHIP_NODE].pj_per_bit,
        "scale_to_28nm": scale,
        **totals,
        "units": units,
        "opensta_mw": second,
        "opensta_is_there": opensta.is_available(),
    }


def node_scale(gate_um2: float, volts: float) -> float:
    """Factor of dynamic energy from a library to the chip's node and 0.9 V: C·V².

    Capacitances go as lengths do, and these as the square root of the area of a gate.
    """
    return float((memories.CHIP_GATE_UM2 / gate_um2) ** 0.5 * (VOLTAGE_28NM / volts) ** 2)


def _between_pixels(recording: Recording) -> tuple[Recording, int]:
    """The recording up to the last pixel that leaves, and the cycle in which the first position comes."""
    enter, leave = recording.fires(_POSITIONS), recording.fires(_PIXELS)
    if True not in enter or True not in leave:
        raise UserError("no pixel went through the recorded render unit: give it more --cycles, or a larger --size")
    last = len(leave) - 1 - leave[::-1].index(True)
    return replace(recording, cycles=recording.cycles[: last + 1]), enter.index(True)


def _rays(recording: Recording, begin: int) -> dict[str, int]:
    """Rays of the window: those that enter the object's box, and all: pixels and shadow rays."""
    shadow = sum(recording.of(_SHADOW)[begin:])
    return {
        "pixels": sum(recording.fires(_PIXELS)[begin:]),
        "rays": sum(recording.fires(_POSITIONS)[begin:]) + shadow,
        "rays_in_box": sum(recording.of(_IN_BOX)[begin:]),
        "hits": sum(recording.of(_HITS)[begin:]),
    }


def _memories(
    netlist: Netlist,
    hierarchy: Hierarchy,
    recording: Recording,
    activity: Activity,
    begin: int,
    design: GeneratedDesign,
    megahertz: float,
) -> tuple[dict[str, float], dict[str, float]]:
    """mW by unit, and by kind: memories of the render unit, and its share of the column's records."""
    each = memories.SRAM[memories.CHIP_NODE].pj_per_bit * megahertz / activity.cycles / 1e3
    by_unit: dict[str, float] = defaultdict(float)
    for box, (reads, writes) in zip(netlist.boxes, activity.accesses, strict=True):
        by_unit[_unit(box.owner)] += (reads + writes) * hierarchy.shape(box.kind)[1] * each
    valid = [port.name for port in recording.inputs if re.fullmatch(r"io_broadcasts(_\d+)?_valid", port.name)]
    reads = sum(sum(recording.of(name)[begin:]) for name in valid)
    rows = int(design.manifest.config["array"]["rows"])
    records = reads * design.manifest.record_bits * each / rows
    return by_unit, {"own": sum(by_unit.values()), "records": records}


def _unit(owner: str) -> str:
    """The innermost unit; a unit may hold another."""
    return next((module for module in reversed(owner.split("/")) if module in LEVEL.units), LEVEL.rest)


def by_unit(powers: Mapping[str, Power]) -> dict[str, Power]:
    """The power of each unit from that of each owner of gates: parts belong to their units."""
    found: dict[str, Power] = {}
    for owner, power in powers.items():
        other = found.get(_unit(owner), Power(0.0, 0.0, 0.0))
        found[_unit(owner)] = Power(
            other.clock + power.clock, other.dynamic + power.dynamic, other.leakage + power.leakage
        )
    return found


def _of_unit(power: Power, memory: float) -> dict[str, float]:
    facts = {"clock_mw": power.clock, "dynamic_mw": power.dynamic, "leakage_mw": power.leakage, "memory_mw": memory}
    return facts | {"power_mw": power.dynamic + power.leakage + memory}


def _total(powers: Any, memory: float) -> dict[str, float]:
    found = list(powers)
    facts = {
        "clock_mw": sum(power.clock for power in found),
        "dynamic_mw": sum(power.dynamic for power in found),
        "leakage_mw": sum(power.leakage for power in found),
        "memory_mw": memory,
    }
    return facts | {"total_mw": facts["dynamic_mw"] + facts["leakage_mw"] + memory}


def _scaled(
    total: Mapping[str, float], scale: float, rays: Mapping[str, int], cycles: int, megahertz: float
) -> dict[str, float | None]:
    """Dynamic power at the chip's node; leakage is left out, for it does not scale so; memories are of that node."""
    dynamic = total["dynamic_mw"] * scale
    both = dynamic + total["memory_mw"]
    facts = {"dynamic_mw": dynamic, "memory_mw": total["memory_mw"], "total_mw": both}
    return {**facts, **_energies(both, rays, cycles, megahertz)}


def _energies(milliwatts: float, rays: Mapping[str, int], cycles: int, megahertz: float) -> dict[str, float | None]:
    """nJ for each ray that entered the object's box, and for each ray."""
    # mW times µs are nJ
    nanojoules = milliwatts * cycles / megahertz
    return {
        "energy_per_ray_nj": nanojoules / rays["rays_in_box"] if rays["rays_in_box"] else None,
        "energy_per_any_ray_nj": nanojoules / rays["rays"] if rays["rays"] else None,
    }
