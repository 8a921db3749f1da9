"""Generates the tables of ``docs/ppa.md`` from the data of `tools/ppa`.

A table replaces the text between ``<!-- NAME -->`` and ``<!-- end -->``; the rest of the page stays as it is.
Run as ``python -m colonnade.lab.ppa.pages.page DOCS``.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from colonnade.common.atomic_files import replacing
from colonnade.lab.common.markdown import markdown
from colonnade.lab.ppa.netlist.hierarchy import LEVEL_NAMES
from colonnade.lab.ppa.pages.area import equal_area, gates
from colonnade.lab.ppa.pages.power import power_table, unit_power_table
from colonnade.lab.ppa.pages.text import LIBRARIES, MAX_FO4, TITLES, format_opensta
from colonnade.lab.ppa.pages.tree import bvh, gain, nodes

Data = Mapping[str, Any]

#: Smallest flip-flop table on the page.
MIN_BITS = 100

_TABLE = re.compile(r"(<!-- (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def page(text: str, data: Path) -> str:
    """The page with new tables from the folder `data`."""

    def replaced(match: re.Match[str]) -> str:
        kind, _, precision = match[2].partition("_")
        if precision:
            reports = _reports(data, precision)
            of_precision = {"units": units, "totals": totals, "tables": tables, "paths": paths}
            of_precision |= {"power": power_table, "unitpower": unit_power_table, "gates": gates}
            of_precision |= {"equal": lambda reports: equal_area(reports, data)}
            body = of_precision[kind](reports) if reports else ""
        else:
            of_all = {"bvh": bvh, "nodes": nodes, "gain": gain, "ecp5": ecp5, "libraries": libraries}
            body = of_all[kind](data)
        return f"{match[1]}{body or 'Not measured: run `tools/ppa`.'}\n{match[3]}"

    return _TABLE.sub(replaced, text)


def units(reports: Mapping[str, Data]) -> str:
    """Area, share and slowest path of each unit, by library."""
    first = next(iter(reports.values()))
    timed = [name for name, report in reports.items() if report["technology"]["liberty"]]
    titles = ["unit", *(f"kGE, {LIBRARIES[name]}" for name in reports), "share", "flip-flops"]
    titles += [f"µm², {LIBRARIES[name]}" for name in timed] + [f"FO4, {LIBRARIES[name]}" for name in timed]
    rows: list[list[str]] = []
    for level in LEVEL_NAMES:
        rows.append([f"**{TITLES[level]}**", *[""] * (len(titles) - 1)])
        for name, unit in first["units"].items():
            if unit["level"] == level:
                same = [report["units"][name] for report in reports.values()]
                of_timed = [reports[library]["units"][name] for library in timed]
                row = [name, *(f"{each['kge']:.1f}" for each in same), f"{100 * unit['share']:.1f} %"]
                row += [f"{unit['flops']:,}", *(f"{each['um2']:,.0f}" for each in of_timed)]
                rows.append([*row, *(_fo4(each["paths"]["register_to_register"]) for each in of_timed)])
                rows += _parts(unit, same, of_timed)
    return markdown(titles, rows)


def _parts(unit: Data, same: Sequence[Data], of_timed: Sequence[Data]) -> list[list[str]]:
    """Rows of a unit's parts: dividers and square roots, summed by module."""
    rows = []
    for part, facts in unit.get("parts", {}).items():
        kge = (_of_part(each, part, "kge", ".1f") for each in same)
        um2 = (_of_part(each, part, "um2", ",.0f") for each in of_timed)
        row = [f"– {facts['count']} × {part}", *kge, "", f"{facts['flops']:,}", *um2, *[""] * len(of_timed)]
        rows.append(row)
    return rows


def _of_part(unit: Data, part: str, key: str, form: str) -> str:
    """A figure of a part; a dash if the report of this library lacks it."""
    facts = unit.get("parts", {}).get(part)
    return f"{facts[key]:{form}}" if facts else "–"


def totals(reports: Mapping[str, Data]) -> str:
    """Area of render unit, column and array."""
    rows = []
    for level in LEVEL_NAMES:
        for library, report in reports.items():
            total = report["levels"][level]
            um2 = "–" if total["logic_um2"] is None else f"{total['logic_um2'] / 1e6:.4f}"
            row = [TITLES[level], LIBRARIES[library], f"{total['logic_kge']:,.1f}", um2]
            row += [f"{total['memory_bits'] / 1000:,.0f}", f"{total['kge']:,.1f}"]
            rows.append([*row, f"{total['logic_mm2_28nm']:.3f}", f"{total['mm2_28nm']:.3f}"])
    chip = next(iter(reports.values()))["chip"]
    row = [
        "chip ÷ 80",
        "–",
        "–",
        "–",
        "–",
        f"{chip['kge_per_unit']:.0f}",
        "–",
        f"{chip['mm2'] / chip['units']:.3f}",
    ]
    rows += [row, ["chip", "–", "–", "–", "–", f"{chip['kge_per_unit'] * 80:,.0f}", "–", f"{chip['mm2']:.2f}"]]
    titles = ["level", "library", "logic, kGE", "logic, mm²", "memory, kbit", "logic and memory, kGE"]
    return markdown([*titles, "logic at 28 nm, mm²", "logic and memory at 28 nm, mm²"], rows)


def tables(reports: Mapping[str, Data]) -> str:
    """The flip-flop tables of a render unit."""
    report = next(iter(reports.values()))
    rows = [
        [f"`{table['name']}`", table["unit"], str(table["count"]), f"{table['bits']:,}"]
        for table in report["flop_tables"]
        if table["level"] == "render_unit" and table["bits"] >= MIN_BITS
    ]
    return markdown(["table (depth × width)", "unit", "instances", "bits"], rows)


def paths(reports: Mapping[str, Data]) -> str:
    """The slowest paths, and the units above `MAX_FO4`."""
    rows, above = [], []
    for library, report in reports.items():
        if not report["technology"]["liberty"]:
            continue
        slowest, whole = report["slowest_path"], (report["render_unit_paths"] or {}).get("register_to_register")
        found = [(f"within one unit: {slowest['unit']}", slowest), ("across units of a render unit", whole)]
        for title, path in found:
            if path:
                row = [title, LIBRARIES[library], f"{path['ns']:.3f}", f"{path['fo4']:.1f}"]
                rows.append([*row, f"`{path['from']}`", f"`{path['to']}`", str(path["gates"])])
        for name, unit in report["units"].items():
            path = (unit["paths"] or {}).get("register_to_register")
            if path and path["fo4"] > MAX_FO4:
                above.append(f"{name} ({path['fo4']:.0f} with {LIBRARIES[library]})")
    if not rows:
        return ""
    comparisons = [
        f"with {LIBRARIES[library]} {format_opensta(report['opensta'])}"
        for library, report in reports.items()
        if report["opensta"]
    ]
    head = f"Compared with OpenSTA: {'; '.join(comparisons)}. " if comparisons else ""
    head += f"Units above {MAX_FO4} FO4: {', '.join(above) or 'none'}."
    titles = ["slowest path", "library", "ns", "FO4", "from", "to", "gates"]
    return f"{head}\n\n{markdown(titles, rows)}"


def ecp5(data: Path) -> str:
    """Utilisation of the FPGA."""
    file = data / "ppa-ecp5.json"
    if not file.is_file():
        return ""
    report = json.loads(file.read_text())
    rows = [
        [title.replace("_", " "), f"{report[title]:,}", f"{number:,}"] for title, number in report["available"].items()
    ]
    depth = report["config"]["columnBvhMemory"]["depth"]
    clock = "–" if report["fmax_mhz"] is None else f"{report['fmax_mhz']:.1f} MHz"
    return f"{depth:,} records; fmax {clock}.\n\n{markdown([report['target'], 'used', 'available'], rows)}"


def libraries(data: Path) -> str:
    """The libraries: gate equivalent, FO4 and target delay."""
    rows = []
    for library, report in _reports(data, "32b32s64d").items():
        used = report["technology"]
        if used["liberty"]:
            row = [LIBRARIES[library], ", ".join(used["liberty"]), f"{used['um2_per_gate']:g}"]
            rows.append([*row, f"{used['fo4_ns'] * 1e3:.1f}", used["fo4"], f"{used['delay_target_ns']:.3f}"])
    titles = ["library", "files", "µm² per GE", "FO4, ps", "definition of FO4", "target delay of abc, ns"]
    return markdown(titles, rows) if rows else ""


def _reports(data: Path, precision: str) -> dict[str, Data]:
    files = {library: data / f"ppa-{precision}-{library}.json" for library in LIBRARIES}
    return {library: json.loads(file.read_text()) for library, file in files.items() if file.is_file()}


def _fo4(path: Data | None) -> str:
    if path is None:
        return "–"
    return f"**{path['fo4']:.0f}**" if path["fo4"] > MAX_FO4 else f"{path['fo4']:.0f}"


def main(docs: Path) -> None:
    """Update the tables of ``ppa.md`` in the folder `docs`."""
    file = docs / "ppa.md"
    text = page(file.read_text(), docs / "data")
    with replacing(file) as stream:
        stream.write(text.encode())


if __name__ == "__main__":
    main(Path(sys.argv[1]))
