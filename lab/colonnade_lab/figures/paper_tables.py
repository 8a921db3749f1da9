"""The tables and single figures of ``docs/paper.md`` that stand in no other page."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from colonnade_lab.common import paper
from colonnade_lab.common.markdown import markdown
from colonnade_lab.evaluation.bench import geometric_mean
from colonnade_lab.figures.data import Data, Missing
from colonnade_lab.figures.facts import MEGAHERTZ, facts, text
from colonnade_lab.figures.map_tables import room_bytes
from colonnade_lab.figures.precision_tables import lowest_psnr, printed_index, saved
from colonnade_lab.figures.tree_tables import (
    laptop,
    less_energy,
    megabytes,
    more_area,
    more_power,
    more_records,
    speed_ups,
)
from colonnade_lab.ppa.netlist.memories import chip_unit_kge

#: Presets of 10×8 arrays, which table 1 has.
ARRAYS = ("edge", "lean")

#: The entries that the page's commands measure.
PARTS = (
    *("bvh-tests", "bvh-costs", "bvh-cycles", "mixed-precision", "paper-maps", "paper-unit", "ablation"),
    *("environments", "bench-edge", "area-edge-asap7", "bvh-power", "room-mesh", "cpu-baseline"),
)


def table_1(data: Data) -> str:
    """The paper's table of designs with ours."""
    rows = [[each if each != "-" else "–" for each in design] for design in paper.DESIGNS]
    rates = {design.name: ("–", "–") for design in paper.DESIGNS}
    rates[paper.DESIGNS[-1].name] = (f"{paper.MRAYS:g}", f"{paper.MILLIWATTS / paper.MRAYS:.2f}")
    for preset in ARRAYS:
        if data.get(f"area-{preset}-asap7") is None:
            continue
        own = facts(data, preset)
        widths = data.file(f"area-{preset}-asap7")["config"]["precision"]
        design = [f"`{preset}`", "28, scaled", text(own, "mm2"), "synthesis", f"{MEGAHERTZ:g}"]
        rows.append([*design, "{mac}b{sqrt}s{div}d".format(**widths), text(own, "watts"), text(own, "framesPerJoule")])
        rates[design[0]] = (text(own, "mrays"), text(own, "njGlitches"))
    titles = ["design", "process, nm", "mm²", "architecture", "clock, MHz", "precision", "power, W", "frames/s/W"]
    return markdown([*titles, "MRay/s", "nJ a ray"], [[*row, *rates[row[0]]] for row in rows])


def unit(data: Data) -> str:
    """A unit that does all by itself, beside a row of `edge`."""
    alone = data.result("paper-unit")
    meshes = alone["bench"]["meshes"]
    edge = {"bench": data.result("bench-edge"), "area": data.result("area-edge-asap7")}
    rows = []
    for name, found in (("1×1: one unit", alone), ("a row of `edge`", edge)):
        column, array = (found["area"]["levels"][level] for level in ("column", "array"))
        count = column["of_the_level_below"]
        logic, area = (column[key] / count for key in ("logic_kge", "kge"))
        rates = (found["bench"]["meshes"][mesh]["rays_per_cycle_in_box"] for mesh in meshes)
        rate = geometric_mean(rates) / count / array["of_the_level_below"]
        rows.append([name, f"{logic:,.0f}", f"{area:,.0f}", f"{rate:.4f}", f"{1e3 * rate / area:.3f}"])
    titles = ["its part of a column", "logic, kGE", "with memories, kGE", f"in-box rays per cycle, {', '.join(meshes)}"]
    return markdown([*titles, "rays per cycle and MGE"], rows)


def minutes(data: Data) -> str:
    """The minutes of each command of `tools/figures` that the page names."""
    found = {name: content["seconds"] / 60 for name in PARTS if (content := data.get(name)) is not None}
    return markdown(["`tools/figures …`", "minutes"], [[f"`{name}`", f"{found[name]:.1f}"] for name in found])


def fact(data: Data, name: str) -> str:
    """A single figure of the page, as text; a dash without its data."""
    try:
        return FACTS[name](data)
    except Missing:
        return "–"


def _map(data: Data, key: str) -> float:
    """Bytes of an environment's albedo, or how much smaller than its source it is."""
    return float(data.result("environments")["living"][key]["albedo"])


def _relit(data: Data, encoding: str) -> str:
    return f"{data.result('paper-maps')[f'{encoding}, relit']['dists']:.4f}"


def _marched(data: Data) -> str:
    """Mirror rays that find the right place of a room, %: the lowest and the highest of the rooms."""
    found = [100 * each["mirror"]["ok"] for each in _marches(data)]
    return " to ".join(f"{share:.1f}" for share in sorted({min(found), max(found)}))


def _marches(data: Data) -> list[Mapping[str, Any]]:
    """The device's marches in each room."""
    accuracy = data.result("environments")["accuracy"]
    return [each for name, each in accuracy.items() if name.endswith(", device")]


def _against_rivals(_: Data) -> str:
    """The paper's efficiency relative to the other designs of table 1, without the graphics card."""
    own = [float(design.frames_per_joule) for design in paper.DESIGNS]
    ratios = sorted(paper.FRAMES_PER_JOULE / each for each in own[:-1] if each > 1)
    return f"{ratios[0]:.0f} to {ratios[-1]:.0f}"


def _place(data: Data) -> str:
    """The place of the paper's precision by its own formula."""
    ordinals = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth")
    return ordinals[list(printed_index(data)).index(paper.PRECISION)]


#: Single figures of the page by name, as text.
FACTS: Mapping[str, Callable[[Data], str]] = {
    "mapBytes": lambda data: f"{_map(data, 'bytes'):,.0f}",
    "mapRatio": lambda data: f"{_map(data, 'ratio'):.1f}",
    "slicDists": lambda data: _relit(data, "slic"),
    "twoLevelDists": lambda data: _relit(data, "twoLevel"),
    "marched": _marched,
    "roomBytes": room_bytes,
    "nj": lambda _: f"{paper.MILLIWATTS / paper.MRAYS:.2f}",
    "raysAFrame": lambda _: f"{round(paper.RAYS_A_FRAME, -3):,.0f}",
    "againstRivals": _against_rivals,
    "unitKge": lambda data: f"{data.result('paper-unit')['area']['levels']['column']['logic_kge']:,.0f}",
    "chipRate": lambda _: f"{paper.RAYS_PER_CYCLE / paper.UNITS:.4f}",
    "chipKge": lambda _: f"{chip_unit_kge():.0f}",
    "sceneMegabytes": megabytes,
    "moreRecords": more_records,
    "moreArea": more_area,
    "speedUps": speed_ups,
    "morePower": more_power,
    "lessEnergy": less_energy,
    "cpuMinutes": laptop,
    "powerSaved": lambda data: saved(data, paper.PRECISION, "mw"),
    "areaSaved": lambda data: saved(data, paper.PRECISION, "array_kge"),
    "printedIndex": lambda data: f"{printed_index(data)[paper.PRECISION]:.3f}",
    "printedPlace": _place,
    "printedBest": lambda data: next(iter(printed_index(data))),
    "printedLowest": lambda data: f"{min(printed_index(data).values()):.3f}",
    "roughPsnr": lambda data: lowest_psnr(data, "24b24s24d"),
    "finePsnr": lambda data: lowest_psnr(data, paper.PRECISION),
}

TABLES: Mapping[str, Callable[[Data], str]] = {"table-1": table_1, "paper-unit": unit, "paper-minutes": minutes}
