"""The text report of ``colonnade ppa``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from colonnade_lab.common.text_table import Column, Table
from colonnade_lab.ppa.netlist.hierarchy import LEVEL_NAMES
from colonnade_lab.ppa.netlist.memories import CHIP_NODE, MIN_SRAM_WORDS, REGISTER_FILE, SRAM, Rate
from colonnade_lab.ppa.power.text import power_lines

#: Design rule: maximum delay between two registers, FO4.
MAX_FO4 = 100

#: Column titles of the libraries, by the name in the data files.
LIBRARIES = {"yosys": "Yosys's gates", "asap7": "ASAP7", "sky130": "sky130"}

TITLES = {"traversal_unit": "traversal unit", "column": "column", "array": "array"}


class UnitTable:
    """A table with one row per unit, printed as soon as the unit is synthesised."""

    def __init__(self, echo: Callable[[str], None]) -> None:
        path = "FO4 of the slowest path"
        self._table = Table(
            (
                Column("level", 11, is_text=True),
                Column("unit", 19, is_text=True),
                Column("kGE", 7, ".2f"),
                Column("flops", 7, ".2f", group="of which"),
                Column("gates", 7, ".2f", group="of which"),
                Column("flip-flops", 10, ","),
                Column("µm²", 9, ",.0f"),
                Column("ns", 6, ".3f"),
                Column("register", 8, ".1f", group=path),
                Column("from input", 10, ".1f", group=path),
                Column("to output", 9, ".1f", group=path),
                Column("through", 7, ".1f", group=path),
            ),
            echo,
        )

    def print(self, level: str, name: str, unit: Mapping[str, Any]) -> None:
        """Print the row of a unit, and one for each of its parts."""
        paths = unit["paths"] or {}
        fo4 = [(paths.get(kind) or {}).get("fo4") for kind in PATHS]
        self._table.print(
            TITLES[level],
            name if unit["count"] == 1 else f"{unit['count']} × {name}",
            unit["kge"],
            unit["flops_kge"],
            unit["combinational_kge"],
            unit["flops"],
            unit["um2"],
            (paths.get("register_to_register") or {}).get("ns"),
            *fo4,
        )
        for part, facts in unit["parts"].items():
            row = (facts["kge"], None, None, facts["flops"], facts["um2"], *[None] * 5)
            self._table.print("", f" {facts['count']} × {part}", *row)


PATHS = ("register_to_register", "input_to_register", "register_to_output", "input_to_output")


def summary(report: Mapping[str, Any]) -> Iterator[str]:
    """Totals, memories, slowest paths, power, and the method."""
    chip, used = report["chip"], report["technology"]
    yield ""
    for level in LEVEL_NAMES:
        total = report["levels"][level]
        copies = total["of_the_level_below"]
        yield (
            f"{TITLES[level]}{f' (its units and {copies} × the level above)' if copies else ''}: "
            f"{total['logic_kge']:,.1f} kGE of logic, {total['memory_bits']:,} bits of memory"
            f"{_um2(total['logic_um2'])}; at {CHIP_NODE} {total['logic_mm2_28nm']:,.3f} mm² of logic, "
            f"{total['mm2_28nm']:,.3f} mm² with memories"
        )
    yield (
        f"traversal unit with memories: {report['traversal_unit_kge']:,.1f} kGE; "
        f"the chip: {chip['kge_per_unit']:.0f} kGE ({chip['mm2']} mm² / {chip['units']} with everything, "
        f"at {chip['um2_per_gate']} µm² per GE)"
    )
    for name, memory in report["memories"].items():
        yield (
            f"memory {name}, in {memory['unit']}: {memory['count']} × {memory['depth']:,} × {memory['width']} bits, "
            f"{_per_node(memory, 'um2', ',.0f')} µm², {_per_node(memory, 'read_pj', '.1f')} pJ per read"
        )
    tables = [table for table in report["flop_tables"] if table["level"] == "traversal_unit"]
    largest = (f"{table['name']} in {table['unit']}" for table in tables[:3])
    yield (
        f"flip-flop tables of a traversal unit: {sum(table['bits'] for table in tables):,} bits; "
        f"the largest are {', '.join(largest)}"
    )
    slowest, whole = report["slowest_path"], report["traversal_unit_paths"]
    if slowest["unit"]:
        yield f"slowest path within one unit: {_path(slowest)}, in {slowest['unit']}"
    if whole and whole["register_to_register"]:
        yield f"slowest path across units of a traversal unit: {_path(whole['register_to_register'])}"
    if report["opensta"]:
        yield f"paths compared with OpenSTA: {format_opensta(report['opensta'])}"
    if report["power"]:
        yield from power_lines(report["power"], report["units"])
    for batch in report["batches"]:
        yield from power_lines(batch, batch["units"])
    yield ""
    yield f"kGE: {used['gates']}. Memories: {_rates()}; their kGE are area at {CHIP_NODE}."
    if used["liberty"]:
        yield f"Library: {', '.join(used['liberty'])}; FO4 is {used['fo4_ns'] * 1e3:.1f} ps: {used['fo4']}."
        for file in used.get("files", ()):
            cells, instances = f"{file['used']:,} of {file['cells']:,} cells", f"{file['instances']:,} times"
            yield f"The units use {cells} of {file['file']}, {instances}."
        yield f"Delays: {used['timing']}; target {used['delay_target_ns']:g} ns."
    yield f"At {CHIP_NODE}: gate count × {chip['um2_per_gate']} µm², without gaps; scaled, not synthesised."


def format_opensta(comparison: Mapping[str, Any]) -> str:
    """The deviation of our slowest paths from OpenSTA's."""
    low, high = comparison["min"], comparison["max"]
    return f"our slowest paths deviate by {low:+.1%} to {high:+.1%} over {comparison['units']} units"


def _path(path: Mapping[str, Any]) -> str:
    return f"{path['ns']:.3f} ns, {path['fo4']:.1f} FO4, {path['from']} → {path['to']} ({path['gates']} gates)"


def _um2(area: float | None) -> str:
    return "" if area is None else f", {area:,.0f} µm²"


def _per_node(memory: Mapping[str, Any], key: str, form: str) -> str:
    return ", ".join(f"{memory[key][node]:{form}} at {node}" for node in SRAM)


def _rates() -> str:
    def of(rates: Mapping[str, Rate]) -> str:
        each = (f"{rate.um2_per_bit} µm² and {rate.pj_per_bit} pJ per bit at {node}" for node, rate in rates.items())
        return "; ".join(each)

    return f"SRAM with {of(SRAM)}; below {MIN_SRAM_WORDS} words register files with {of(REGISTER_FILE)}"
