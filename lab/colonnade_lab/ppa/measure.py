"""Area, timing and power of a configuration: each unit is synthesised, and larger levels are sums over units."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from colonnade.common.progress import QUIET, Progress
from colonnade.design.generator import black_boxed_design_for

from colonnade_lab.common import paper
from colonnade_lab.common.yosys import require_yosys
from colonnade_lab.ppa.netlist import memories
from colonnade_lab.ppa.netlist.hierarchy import LEVEL_NAMES, LEVELS, Hierarchy, Level, Memory
from colonnade_lab.ppa.netlist.mapped import Netlist
from colonnade_lab.ppa.netlist.synthesis import Technology, count_gates, synthesise, technology
from colonnade_lab.ppa.power.record import require_recordable
from colonnade_lab.ppa.power.report import Operation, measure_power
from colonnade_lab.ppa.timing import opensta
from colonnade_lab.ppa.timing.static import Analysis, Timing, TimingPath, gates_by_name

#: Called after each unit with its level, name and report.
Finished = Callable[[str, str, Mapping[str, Any]], None]


def measure(
    config: str,
    overrides: Sequence[str] = (),
    liberties: Sequence[str] = (),
    delay: float | None = None,
    operation: Operation | None = None,
    progress: Progress = QUIET,
    finished: Finished = lambda level, name, unit: None,
) -> dict[str, Any]:
    """Synthesise each unit of a configuration and sum up.

    Args:
        config: Configuration, see `colonnade.design.config_name`.
        overrides: Changes to the configuration, ``key.path=value``.
        liberties: Liberty files or folders; empty: Yosys's generic gates.
        delay: Target delay of abc, ns.
        operation: Clock and workloads for power, which needs liberties; None: no power.
        progress: Shows the steps.
        finished: See `Finished`.

    Returns:
        The report that ``--json`` writes.
    """
    require_yosys()
    tech = technology(tuple(liberties), delay)
    design = black_boxed_design_for(config, overrides, progress)
    hierarchy = Hierarchy(design.dir)
    if tech.library and operation:
        for workload in operation.workloads:
            require_recordable(workload, design.manifest)
    netlists, units = _synthesised(hierarchy, hierarchy.levels, tech, progress, finished)
    with progress.step("timing the whole traversal unit"):
        whole = _timing(Netlist(netlists, LEVELS[0].top, tech.library), tech) if tech.library else None
    power, batches = None, list[dict[str, Any]]()
    for workload in operation.workloads if tech.library and operation else ():
        assert operation is not None
        found = measure_power(
            design, config, overrides, hierarchy, netlists, tech, workload, operation.megahertz, progress
        )
        if design.manifest.has_queries:
            batches.append(found)
            continue
        power = found
        for name, of_unit in power.pop("units").items():
            units[name] |= of_unit
    array = design.manifest.config["array"]
    boxes = hierarchy.memories()
    levels = _levels(units, int(array["rows"]), int(array["columns"]), boxes)
    for unit in units.values():
        unit["share"] = unit["kge"] / sum(other["kge"] for other in units.values() if other["level"] == unit["level"])
    slowest = max(
        ({**unit["paths"]["register_to_register"], "unit": name} for name, unit in units.items() if _is_timed(unit)),
        key=lambda path: path["ns"],
        default={"ns": None, "fo4": None, "unit": None},
    )
    return {
        "config": design.manifest.config,
        "config_hash": design.manifest.config_hash,
        "technology": _describe(tech) | {"files": cells_of_files(tech, netlists)},
        "units": units,
        "memories": {memory.name: memories.describe(memory) for memory in boxes},
        "flop_tables": [{**asdict(table), "bits": table.bits} for table in hierarchy.tables()],
        "levels": levels,
        "traversal_unit_kge": levels["traversal_unit"]["kge"],
        "slowest_path": slowest,
        "traversal_unit_paths": whole,
        "opensta": _opensta_comparison(units),
        "chip": {
            "mm2": paper.MM2,
            "units": paper.UNITS,
            "kge_per_unit": memories.chip_unit_kge(),
            "um2_per_gate": memories.CHIP_GATE_UM2,
        },
        "power": power,
        "batches": batches,
        "power_mw": power["glitch_aware"]["total_mw"] if power else None,
        "energy_per_ray_nj": power["glitch_aware"]["energy_per_ray_nj"] if power else None,
    }


def traversal_unit(
    config: str, overrides: Sequence[str], liberties: Sequence[str], progress: Progress = QUIET
) -> dict[str, float]:
    """Area of the units of a traversal unit, kGE, and of all of it with its memories, "all"; arguments as `measure`."""
    require_yosys()
    tech = technology(tuple(liberties), None)
    hierarchy = Hierarchy(black_boxed_design_for(config, overrides, progress).dir)
    units = _synthesised(hierarchy, hierarchy.levels[:1], tech, progress)[1]
    whole = _levels(units, 1, 1, hierarchy.memories())[LEVEL_NAMES[0]]
    return {name: float(unit["kge"]) for name, unit in units.items()} | {"all": float(whole["kge"])}


def _synthesised(
    hierarchy: Hierarchy,
    levels: Iterable[Level],
    tech: Technology,
    progress: Progress,
    finished: Finished = lambda level, name, unit: None,
) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """The netlists of levels, and their units."""
    netlists: dict[str, Any] = {}
    units: dict[str, dict[str, Any]] = {}
    for level in levels:
        for module in (*hierarchy.units(level), level.top):
            name = level.rest if module == level.top else module
            with progress.step(f"synthesising {name}"):
                for each in (*hierarchy.parts(module), module):
                    netlists[each] = synthesise(hierarchy, each, tech, progress)
                count = hierarchy.instances(module, level)
                units[name] = _unit(level, module, count, netlists, hierarchy.parts(module), tech)
            finished(level.name, name, units[name])
    return netlists, units


def _unit(
    level: Level, module: str, count: int, netlists: Mapping[str, Any], parts: Mapping[str, int], tech: Technology
) -> dict[str, Any]:
    """The area of all `count` instances of a unit in its level, and its paths."""
    own = count_gates(netlists[module], tech)
    of_parts = {part: count_gates(netlists[part], tech) for part in parts}
    all_parts = {part: number * count for part, number in parts.items()}
    counts = [(own, count), *((of_parts[part], number) for part, number in all_parts.items())]
    registers = sum(gates.registers * number for gates, number in counts)
    combinational = sum(gates.combinational * number for gates, number in counts)
    area = tech.gate_area
    paths = None
    if tech.library:
        joined = {name: netlists[name] for name in (module, *parts)}
        netlist = Netlist(joined, module, tech.library)
        paths = _timing(netlist, tech)
        if paths["register_to_register"] and opensta.is_available():
            edges = Analysis.edges(tech.library)
            paths["register_to_register"]["opensta_ns"] = opensta.register_to_register(netlist, tech.library, *edges)
    return {
        "level": level.name,
        "module": module,
        "count": count,
        "kge": (registers + combinational) / 1e3,
        "flops": sum(gates.flops * number for gates, number in counts),
        "flops_kge": registers / 1e3,
        "combinational_kge": combinational / 1e3,
        "um2": None if area is None else (registers + combinational) * area,
        "paths": paths,
        "parts": {
            part: {
                "count": number,
                "kge": of_parts[part].total * number / 1e3,
                "flops": of_parts[part].flops * number,
                "um2": None if area is None else of_parts[part].total * number * area,
            }
            for part, number in all_parts.items()
        },
    }


def _timing(netlist: Netlist, tech: Technology) -> dict[str, Any]:
    assert tech.library is not None
    return _paths(Analysis(netlist, tech.library).timing(), tech)


def _paths(timing: Timing, tech: Technology) -> dict[str, Any]:
    fo4 = tech.library.fo4 if tech.library else 1.0

    def path(found: TimingPath | None) -> dict[str, Any] | None:
        if found is None:
            return None
        facts = {"ns": found.ns, "fo4": found.ns / fo4, "from": found.begin, "to": found.end}
        return {**facts, "gates": len(found.cells), "cells": gates_by_name(found.cells)}

    return {
        "register_to_register": path(timing.register_to_register),
        "input_to_register": path(timing.input_to_register),
        "register_to_output": path(timing.register_to_output),
        "input_to_output": path(timing.input_to_output),
    }


def _opensta_comparison(units: Mapping[str, Mapping[str, Any]]) -> dict[str, Any] | None:
    """Deviation of our slowest paths from OpenSTA's; None without OpenSTA."""
    found = [unit["paths"]["register_to_register"] for unit in units.values() if _is_timed(unit)]
    shares = [path["ns"] / path["opensta_ns"] - 1 for path in found if path.get("opensta_ns")]
    return {"units": len(shares), "min": min(shares), "max": max(shares)} if shares else None


def _is_timed(unit: Mapping[str, Any]) -> bool:
    return bool(unit["paths"] and unit["paths"]["register_to_register"])


def _levels(units: Mapping[str, Mapping[str, Any]], rows: int, columns: int, boxes: Sequence[Memory]) -> dict[str, Any]:
    """Gates and memory bits of a traversal unit, a column and the array; each includes the level below."""
    levels: dict[str, Any] = {}
    below, bits_below, area_below, memory_below = 0.0, 0, 0.0, 0.0
    for level, copies in zip(LEVEL_NAMES, (0, rows, columns), strict=True):
        own = [unit for unit in units.values() if unit["level"] == level]
        logic = sum(unit["kge"] for unit in own) + copies * below
        own_memories = [memory for memory in boxes if memory.level == level]
        bits = sum(memory.bits * memory.count for memory in own_memories) + copies * bits_below
        memory_um2 = sum(memories.area_um2(memory) for memory in own_memories) + copies * memory_below
        um2 = sum(unit["um2"] or 0.0 for unit in own) + copies * area_below
        levels[level] = {
            "of_the_level_below": copies,
            "logic_kge": logic,
            "memory_bits": bits,
            "memory_kge": memories.equivalent_kge(memory_um2),
            "kge": logic + memories.equivalent_kge(memory_um2),
            "logic_um2": um2 or None,
            "mm2_28nm": memories.area_mm2(logic, memory_um2),
            "logic_mm2_28nm": memories.area_mm2(logic, 0),
        }
        below, bits_below, area_below, memory_below = logic, bits, um2, memory_um2
    return levels


def cells_of_files(tech: Technology, netlists: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The liberty files: usable cells, how many of them the units use, and how often; each unit counts once."""
    if tech.library is None:
        return []
    kinds = Counter(cell["type"] for netlist in netlists.values() for cell in netlist["cells"].values())
    found = []
    for file, source in zip(tech.library.files, tech.sources, strict=True):
        own = [cell for cell, origin in tech.library.origins.items() if origin == file]
        used = [kinds[cell] for cell in own if cell in kinds]
        found.append({"file": source.name, "cells": len(own), "used": len(used), "instances": sum(used)})
    return found


def _describe(tech: Technology) -> dict[str, Any]:
    """The technology in a report."""
    library = tech.library
    if library is None:
        return {"liberty": None, "gates": "static-CMOS transistors by Yosys's table ÷ 4; no delays, no µm²"}
    nand, inverter = library.nand2, library.inverter
    return {
        "liberty": [file.name.rsplit("-", 1)[0] for file in library.files],
        "gates": f"cell area ÷ {nand.area:g} µm² of {nand.name}, the smallest two-input NAND",
        "um2_per_gate": nand.area,
        "fo4_ns": library.fo4,
        "fo4": f"{inverter.name} driving four copies of itself, by the liberty's tables",
        "delay_target_ns": tech.delay,
        "timing": "built-in analysis by the liberty's tables, from clock to set-up; no wires, ideal clock",
    }
