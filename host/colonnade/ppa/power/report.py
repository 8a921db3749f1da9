"""The power report of a render unit that renders a frame: gates, activity and memories."""

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
from colonnade.ppa.netlist.hierarchy import SEPARATE, Hierarchy
from colonnade.ppa.netlist.mapped import Netlist
from colonnade.ppa.netlist.synthesis import Technology
from colonnade.ppa.power.activity import Power, power_of
from colonnade.ppa.power.recording import Recording, Stimulus, record
from colonnade.ppa.power.replay import Activity, replay
from colonnade.ppa.timing import opensta
from colonnade.ppa.timing.delays import net_timing
from colonnade.ppa.timing.static import Analysis

#: The replayed module and its level.
TOP = "RenderUnit"
LEVEL = SEPARATE[0]

#: Supply voltage at the chip's node, V.
VOLTAGE_28NM = 0.9

#: Ports that count positions, pixels, rays and hits.
_POSITIONS, _PIXELS = "io_positions", "io_pixels"
_IN_BOX, _SHADOW, _HITS = "io_events_raysInBox", "io_events_raysShadow", "io_events_hits"


@dataclass(frozen=True)
class Operation:
    """The operating point for power.

    Attributes:
        megahertz: Clock frequency, MHz.
        stimulus: The workload.
    """

    megahertz: float
    stimulus: Stimulus


def measure_power(
    design: GeneratedDesign,
    config: str,
    overrides: Sequence[str],
    hierarchy: Hierarchy,
    netlists: Mapping[str, Any],
    tech: Technology,
    operation: Operation,
    progress: Progress = QUIET,
) -> dict[str, Any]:
    """The ``power`` section of a report, with the power of each unit in ``units``.

    Args:
        design: The design with black-box memories.
        config: Configuration, before `overrides`.
        overrides: Changes to the configuration, ``key.path=value``.
        hierarchy: The hierarchy of the design.
        netlists: All modules of a render unit in Yosys's JSON.
        tech: The technology, with a library.
        operation: Clock and workload.
        progress: Shows the steps.
    """
    assert tech.library is not None
    ports = netlists[TOP]["ports"]
    recording, begin = _between_pixels(record(config, overrides, TOP, ports, operation.stimulus, progress))
    with progress.step("reading the gate netlist"):
        netlist = Netlist(netlists, TOP, tech.library)
        analysis = Analysis(netlist, tech.library)
        timing = net_timing(analysis, netlist.size)
        cells = energies.load(tech.sources, {instance.cell.name for instance in netlist.instances})
    activity = replay(netlist, hierarchy, timing.delays, recording, begin, progress)
    with progress.step("summing up the power"):
        megahertz = operation.megahertz
        of_unit, kinds = _memories(netlist, hierarchy, recording, activity, begin, design, megahertz)
        rays = _rays(recording, begin)
        scale = node_scale(tech.library.nand2.area, cells.voltage)
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
            second = opensta.power(netlist, tech.sources, activity, analysis.slew, megahertz)
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
    """The factor that scales dynamic energy (C·V²) of a library to the chip's node and 0.9 V.

    Capacitance scales with length, and length with the square root of a gate's area.
    """
    return float((memories.CHIP_GATE_UM2 / gate_um2) ** 0.5 * (VOLTAGE_28NM / volts) ** 2)


def _between_pixels(recording: Recording) -> tuple[Recording, int]:
    """The recording up to the last output pixel, and the cycle of the first input position."""
    inputs, outputs = recording.fires(_POSITIONS), recording.fires(_PIXELS)
    if True not in inputs or True not in outputs:
        raise UserError("the recorded render unit has no pixel: use more --cycles, or a larger --size")
    last = len(outputs) - 1 - outputs[::-1].index(True)
    return replace(recording, cycles=recording.cycles[: last + 1]), inputs.index(True)


def _rays(recording: Recording, begin: int) -> dict[str, int]:
    """Numbers of pixels, rays (primary and shadow), in-box rays and hits, from the cycle `begin` on."""
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
    """Memory power by unit, and by kind: memories of the render unit, and its share of the column memory, mW."""
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
    """The innermost unit of an instance's path."""
    return next((module for module in reversed(owner.split("/")) if module in LEVEL.units), LEVEL.rest)


def by_unit(powers: Mapping[str, Power]) -> dict[str, Power]:
    """The power of each unit, summed over the modules within it."""
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
    """Dynamic and memory power at the chip's node, without leakage, which scales differently."""
    dynamic = total["dynamic_mw"] * scale
    both = dynamic + total["memory_mw"]
    facts = {"dynamic_mw": dynamic, "memory_mw": total["memory_mw"], "total_mw": both}
    return {**facts, **_energies(both, rays, cycles, megahertz)}


def _energies(milliwatts: float, rays: Mapping[str, int], cycles: int, megahertz: float) -> dict[str, float | None]:
    """Energy per in-box ray and per ray, nJ."""
    # mW × µs = nJ
    nanojoules = milliwatts * cycles / megahertz
    return {
        "energy_per_ray_nj": nanojoules / rays["rays_in_box"] if rays["rays_in_box"] else None,
        "energy_per_any_ray_nj": nanojoules / rays["rays"] if rays["rays"] else None,
    }
