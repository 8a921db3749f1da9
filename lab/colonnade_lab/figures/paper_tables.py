"""The tables and single figures of ``docs/paper.md`` that stand in no other page."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from colonnade_lab.common import paper
from colonnade_lab.common.markdown import markdown
from colonnade_lab.evaluation.bench import geometric_mean
from colonnade_lab.figures.data import Data
from colonnade_lab.figures.facts import MEGAHERTZ, facts, text

#: Presets of 10×8 arrays, which table 1 has.
ARRAYS = ("edge", "lean")

#: The entries that the page's commands measure.
PARTS = (
    *("bvh-tests", "bvh-costs", "bvh-cycles", "mixed-precision", "paper-maps", "paper-unit", "ablation"),
    *("environments", "bench-edge", "area-edge-asap7"),
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


def paper_facts(data: Data) -> dict[str, str]:
    """Single figures of the page, as text.

    Returns:
        ``mapBytes``, ``mapRatio``: of an environment's albedo, and how much smaller than its source it is. ``nj``:
        energy of a ray of the chip. ``raysAFrame``: rays of a frame of the paper. ``againstRivals``: its efficiency
        relative to the other designs of table 1, without the graphics card.
    """
    maps = data.optional("environments")
    own = [float(design.frames_per_joule) for design in paper.DESIGNS]
    ratios = sorted(paper.FRAMES_PER_JOULE / each for each in own[:-1] if each > 1)
    found = {
        "nj": f"{paper.MILLIWATTS / paper.MRAYS:.2f}",
        "raysAFrame": f"{round(paper.RAYS_A_FRAME, -3):,.0f}",
        "againstRivals": f"{ratios[0]:.0f} to {ratios[-1]:.0f}",
    }
    if maps is not None:
        living: Mapping[str, Any] = maps["living"]
        found |= {"mapBytes": f"{living['bytes']['albedo']:,}", "mapRatio": f"{living['ratio']['albedo']:.1f}"}
    return found


TABLES: Mapping[str, Callable[[Data], str]] = {"table-1": table_1, "paper-unit": unit, "paper-minutes": minutes}
