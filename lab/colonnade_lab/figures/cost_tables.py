"""The tables of ``docs/ppa.md``: area, memories, paths and power."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from colonnade_lab.common import paper
from colonnade_lab.common.markdown import markdown
from colonnade_lab.figures.data import Data
from colonnade_lab.figures.facts import AREA, MEGAHERTZ, PRESETS, facts, text
from colonnade_lab.ppa.netlist.hierarchy import LEVEL_NAMES
from colonnade_lab.ppa.power.text import KINDS
from colonnade_lab.ppa.summary import LIBRARIES, MAX_FO4, TITLES

Report = Mapping[str, Any]

#: Smallest memory of the table, kbit in the array.
MIN_KBIT = 100

#: Smallest unit of the table, kGE.
MIN_KGE = 1.0


def units(data: Data) -> str:
    """Area, slowest path and energy of each unit of `edge`."""
    reports = _edge(data)
    first, *others = reports.values()
    titles = ["unit", "instances", "kGE of all"]
    titles += [f"FO4, {', '.join(LIBRARIES[library] for library in reports)}", "pJ a ray, without glitches", "with"]
    rows: list[list[str]] = []
    for level in LEVEL_NAMES:
        rows.append([f"**{TITLES[level]}**", *[""] * (len(titles) - 1)])
        for name, unit in first["units"].items():
            if unit["level"] == level and unit["kge"] >= MIN_KGE:
                row = [name, str(unit["count"]), f"{unit['kge']:.1f}"]
                row.append(", ".join(_fo4(report["units"].get(name)) for report in (first, *others)))
                rows.append([*row, *_energies(unit)])
    return markdown(titles, rows)


def _fo4(unit: Report | None) -> str:
    path = unit and unit["paths"] and unit["paths"]["register_to_register"]
    if not path:
        return "–"
    return f"**{path['fo4']:.0f}**" if path["fo4"] > MAX_FO4 else f"{path['fo4']:.0f}"


def _energies(unit: Report) -> list[str]:
    energies = unit.get("energy_per_ray_nj_at_28nm")
    return [f"{1e3 * energies[kind]:.0f}" if energies else "" for kind in KINDS]


def totals(data: Data) -> str:
    """Area of traversal unit, column and array of `edge`, and of the chip."""
    rows = []
    for level in LEVEL_NAMES:
        for library, report in _edge(data).items():
            total = report["levels"][level]
            row = [TITLES[level], LIBRARIES[library], f"{total['logic_kge']:,.1f}", f"{total['logic_um2'] / 1e6:.4f}"]
            row += [f"{total['memory_bits'] / 1000:,.0f}", f"{total['logic_mm2_28nm']:.3f}", f"{total['mm2_28nm']:.3f}"]
            rows.append(row)
    rows.append(["chip ÷ 80", *[""] * 5, f"{paper.MM2 / paper.UNITS:.3f}"])
    rows.append(["chip", *[""] * 5, f"{paper.MM2:.2f}"])
    titles = ["level", "library", "logic, kGE", "logic, mm²", "memory, kbit", "logic at 28 nm, mm²"]
    return markdown([*titles, "with memories, mm²"], rows)


def memories(data: Data) -> str:
    """The memories of `edge`, the largest in the array first."""
    report = data.result(AREA.format("edge"))
    levels = report["levels"]
    columns = levels["array"]["of_the_level_below"]
    copies = {"array": 1, "column": columns, "traversal_unit": columns * levels["column"]["of_the_level_below"]}
    kbits = {name: memory["bits"] * copies[memory["level"]] / 1e3 for name, memory in report["memories"].items()}
    rows = [
        [
            f"`{name}`",
            memory["unit"],
            TITLES[memory["level"]],
            f"{memory['count']} × {memory['depth']:,} × {memory['width']}",
            f"{kbits[name]:,.0f}",
            f"{memory['um2']['28 nm'] * copies[memory['level']] / 1e6:.3f}",
        ]
        for name, memory in sorted(report["memories"].items(), key=lambda item: -kbits[item[0]])
        if kbits[name] >= MIN_KBIT
    ]
    return markdown(["memory", "unit", "of each", "number × words × bits", "kbit in the array", "mm² at 28 nm"], rows)


def paths(data: Data) -> str:
    """The slowest paths of `edge`."""
    rows = []
    for library, report in _edge(data).items():
        slowest, whole = report["slowest_path"], (report["traversal_unit_paths"] or {}).get("register_to_register")
        found = [(f"within one unit: {slowest['unit']}", slowest), ("across units of a traversal unit", whole)]
        for title, path in found:
            if path:
                row = [title, LIBRARIES[library], f"{path['ns']:.3f}", f"{path['fo4']:.1f}"]
                rows.append([*row, f"`{path['from']}`", f"`{path['to']}`", str(path["gates"])])
    return markdown(["slowest path", "library", "ns", "FO4", "from", "to", "gates"], rows)


def power(data: Data) -> str:
    """Power of a row of `edge`, and energy of a ray."""
    rows: list[list[str]] = []
    heads: list[str] = []
    scales: list[str] = []
    for library, report in _edge(data).items():
        found = report["power"]
        for kind, title in KINDS.items():
            own = found[kind]
            row = [f"{LIBRARIES[library]}, {found['volts']:g} V", title]
            row += [f"{own[f'{part}_mw']:.3f}" for part in ("dynamic", "clock", "leakage", "memory", "total")]
            row += [f"{own['energy_per_ray_nj']:.3f}", f"{own['at_28nm']['energy_per_ray_nj']:.3f}"]
            rows.append(row)
        window, scene = found["window"], found["scene"]
        size = "×".join(map(str, scene["size"]))
        heads.append(
            f"{LIBRARIES[library]}: {scene['mesh']} at {size}, {found['clock_mhz']:g} MHz, {window['cycles']:,} "
            f"cycles, {window['rays_in_box']:,} in-box rays of the column, {window['rays_traced']:,} of row 0."
        )
        scales.append(f"{found['scale_to_28nm']:.3f} for {LIBRARIES[library]}")
    rows.append(
        ["chip ÷ 80", *[""] * 5, f"{paper.MILLIWATTS / paper.UNITS:.2f}", "", f"{paper.MILLIWATTS / paper.MRAYS:.2f}"]
    )
    titles = ["library", "glitches", "dynamic, mW", "clock pins", "leakage", "memories", "total"]
    table = markdown([*titles, "nJ per in-box ray", "at 28 nm"], rows)
    return "\n".join(heads) + f" To 28 nm: × {', × '.join(scales)}.\n\n{table}"


def presets_cost(data: Data) -> str:
    """Area, clock and energy of every preset, with ASAP7."""
    keys = ("kge", "mm2", "fo4", "mhz", "nj", "njGlitches", "equalArea")
    rows = [[f"`{preset}`", *(text(facts(data, preset), key) for key in keys)] for preset in PRESETS]
    titles = ["preset", "logic, kGE", "mm²", "FO4", "MHz"]
    titles += ["nJ a ray, without glitches", "with glitches"]
    return markdown([*titles, "rate against the chip, at equal area"], rows)


def designs(data: Data) -> str:
    """Rays per second and area of the 10×8 arrays, beside published designs."""
    rows = [["the paper's chip, 200 MHz", f"{paper.MRAYS:g}", f"{paper.MM2:g}", f"{paper.MRAYS / paper.MM2:.1f}"]]
    own = facts(data, "edge")
    rows.append([f"`edge`, {MEGAHERTZ:g} MHz", *(text(own, key) for key in ("mrays", "mm2", "mraysPerMm2"))])
    at_clock = (text(own, key) for key in ("mraysAtClock", "mm2", "mraysPerMm2AtClock"))
    rows.append([f"`edge`, {text(own, 'mhz')} MHz, by its paths", *at_clock])
    rays = data.result("ray-device")["kinds"][0]["in_box"] * MEGAHERTZ
    area = data.result(AREA.format("traversal"))["levels"]["array"]["mm2_28nm"]
    title = f"`traversal`, rays of a sensor, {MEGAHERTZ:g} MHz"
    rows.append([title, f"{rays:.0f}", f"{area:.2f}", f"{rays / area:.0f}"])
    rows.append(
        ["MMsRT ([2023](https://doi.org/10.1142/s021812662350192x)), by simulator", "82.9", "0.856, as published", "97"]
    )
    return markdown(["design", "in-box MRay/s", "mm² at 28 nm", "MRay/s/mm²"], rows)


def libraries(data: Data) -> str:
    """The libraries: gate equivalent, FO4 and target delay."""
    rows = []
    for library, report in _edge(data).items():
        used = report["technology"]
        row = [LIBRARIES[library], ", ".join(used["liberty"]), f"{used['um2_per_gate']:g}"]
        rows.append(
            [*row, f"{used['fo4_ns'] * 1e3:.1f}", used["fo4"].split(" driving ")[0], f"{used['delay_target_ns']:.3f}"]
        )
    titles = ["library", "files", "µm² per GE", "FO4, ps", "of", "target delay, ns"]
    return markdown(titles, rows)


def _edge(data: Data) -> dict[str, Report]:
    """The reports of `edge` by library, ASAP7's first."""
    found = {"asap7": data.result("area-edge-asap7")}
    other = data.optional("area-edge-sky130")
    return found | ({"sky130": other} if other else {})


TABLES: Mapping[str, Callable[[Data], str]] = {
    "units": units,
    "totals": totals,
    "memories": memories,
    "paths": paths,
    "power": power,
    "presets-cost": presets_cost,
    "designs": designs,
    "libraries": libraries,
}
