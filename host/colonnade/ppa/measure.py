"""A configuration's area and timing: units one by one, then render unit, column and array by multiplication."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from colonnade.common.progress import QUIET, Progress
from colonnade.design.generator import black_boxed_design_for
from colonnade.ppa.netlist import memories
from colonnade.ppa.netlist.hierarchy import LEVELS, Hierarchy, Level, Memory
from colonnade.ppa.netlist.mapped import Netlist
from colonnade.ppa.netlist.synthesis import Technology, count_gates, require_yosys, synthesise, technology
from colonnade.ppa.power.recording import require_recordable
from colonnade.ppa.power.report import Operation, measure_power
from colonnade.ppa.timing import opensta
from colonnade.ppa.timing.static import Analysis, Timing, TimingPath, gates_by_name

#: Called with the level, the name and the report of each unit as soon as it is known.
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
    """Synthesise every unit of a configuration and add them up.

    Args:
        config: name of the configuration, see `colonnade.design.config_name`.
        overrides: ``key.path=value`` changes.
        liberties: files or folders; Yosys's own gates without any.
        delay: target for abc in ns.
        operation: clock and frame for power, which takes liberties; no power without.
        progress: shows the steps.
        finished: see `Finished`.

    Returns:
        The report as ``--json`` writes it.
    """
    require_yosys()
    into = technology(tuple(liberties), delay)
    design = black_boxed_design_for(config, overrides, progress)
    hierarchy = Hierarchy(design.dir)
    if into.library and operation:
        require_recordable(operation.stimulus, design.manifest)
    netlists: dict[str, Any] = {}
    units: dict[str, dict[str, Any]] = {}
    for level in LEVELS:
        for module in (*hierarchy.units(level), level.top):
            name = level.rest if module == level.top else module
            with progress.step(f"synthesising {name}"):
                for each in (*hierarchy.parts(module), module):
                    netlists[each] = synthesise(hierarchy, each, into, progress)
                units[name] = _unit(level, module, netlists, hierarchy.parts(module), into)
            finished(level.name, name, units[name])
    with progress.step("timing a render unit as a whole"):
        whole = _timing(Netlist(netlists, "RenderUnit", into.library), into) if into.library else None
    power = None
    if into.library and operation:
        power = measure_power(design, config, overrides, hierarchy, netlists, into, operation, progress)
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
        "technology": _described(into),
        "units": units,
        "memories": {memory.name: memories.described(memory) for memory in boxes},
        "flop_tables": [{**asdict(table), "bits": table.bits} for table in hierarchy.tables()],
        "levels": levels,
        "render_unit_kge": levels["render_unit"]["kge"],
        "slowest_path": slowest,
        "render_unit_paths": whole,
        "opensta": _second_opinion(units),
        "chip": {
            "mm2": memories.CHIP_MM2,
            "units": memories.CHIP_UNITS,
            "kge_per_unit": memories.chip_unit_kge(),
            "um2_per_gate": memories.CHIP_GATE_UM2,
        },
        "power": power,
        "power_mw": power["glitch_aware"]["total_mw"] if power else None,
        "energy_per_ray_nj": power["glitch_aware"]["energy_per_ray_nj"] if power else None,
    }


def _unit(
    level: Level, module: str, netlists: Mapping[str, Any], parts: Mapping[str, int], into: Technology
) -> dict[str, Any]:
    own = count_gates(netlists[module], into)
    of_parts = {part: count_gates(netlists[part], into) for part in parts}
    counts = [(own, 1), *((of_parts[part], number) for part, number in parts.items())]
    registers = sum(gates.registers * number for gates, number in counts)
    combinational = sum(gates.combinational * number for gates, number in counts)
    area = into.gate_area
    paths = None
    if into.library:
        joined = {name: netlists[name] for name in (module, *parts)}
        netlist = Netlist(joined, module, into.library)
        paths = _timing(netlist, into)
        if paths["register_to_register"] and opensta.is_available():
            edges = Analysis.edges(into.library)
            paths["register_to_register"]["opensta_ns"] = opensta.register_to_register(netlist, into.library, *edges)
    return {
        "level": level.name,
        "module": module,
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
            for part, number in parts.items()
        },
    }


def _timing(netlist: Netlist, into: Technology) -> dict[str, Any]:
    assert into.library is not None
    return _paths(Analysis(netlist, into.library).timing(), into)


def _paths(timing: Timing, into: Technology) -> dict[str, Any]:
    fo4 = into.library.fo4 if into.library else 1.0

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


def _second_opinion(units: Mapping[str, Mapping[str, Any]]) -> dict[str, Any] | None:
    """How far OpenSTA's slowest paths are from ours, where it is there."""
    found = [unit["paths"]["register_to_register"] for unit in units.values() if _is_timed(unit)]
    shares = [path["ns"] / path["opensta_ns"] - 1 for path in found if path.get("opensta_ns")]
    return {"units": len(shares), "least": min(shares), "most": max(shares)} if shares else None


def _is_timed(unit: Mapping[str, Any]) -> bool:
    return bool(unit["paths"] and unit["paths"]["register_to_register"])


def _levels(units: Mapping[str, Mapping[str, Any]], rows: int, columns: int, boxes: Sequence[Memory]) -> dict[str, Any]:
    """Gates and memory bits of one render unit, one column, the array; each holds those below it."""
    levels: dict[str, Any] = {}
    below, bits_below, area_below, memory_below = 0.0, 0, 0.0, 0.0
    for level, copies in zip(LEVELS, (0, rows, columns), strict=True):
        own = [unit for unit in units.values() if unit["level"] == level.name]
        logic = sum(unit["kge"] for unit in own) + copies * below
        held = [memory for memory in boxes if memory.level == level.name]
        bits = sum(memory.bits * memory.count for memory in held) + copies * bits_below
        memory_um2 = sum(memories.area_um2(memory) for memory in held) + copies * memory_below
        um2 = sum(unit["um2"] or 0.0 for unit in own) + copies * area_below
        levels[level.name] = {
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


def _described(into: Technology) -> dict[str, Any]:
    """How the figures were obtained."""
    library = into.library
    if library is None:
        return {"liberty": None, "gates": "transistors of static CMOS by Yosys's table ÷ 4; no delays, no µm²"}
    nand, inverter = library.nand2, library.inverter
    return {
        "liberty": [file.name.rsplit("-", 1)[0] for file in library.files],
        "gates": f"cell area ÷ {nand.area:g} µm² of {nand.name}, the smallest NAND of two inputs",
        "um2_per_gate": nand.area,
        "fo4_ns": library.fo4,
        "fo4": f"from the tables of {inverter.name}, which drives four of its like in a chain of such",
        "delay_target_ns": into.delay,
        "timing": "our own analysis by the liberty's tables, no wires, ideal clock; clock to set-up",
    }
