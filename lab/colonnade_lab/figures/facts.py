"""The figures of a preset that several tables show, from its data files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from colonnade_lab.common import paper
from colonnade_lab.evaluation.bench import geometric_mean
from colonnade_lab.figures.data import Data
from colonnade_lab.ppa.equal_area import fastest_clock

#: What each preset is for. The largest comes first.
PRESETS = {
    "edge": "AR: rooms, their light, mirrors, glass, textures",
    "lean": "as `edge`, narrower arithmetic, finer vertices",
    "small": "the simulator: what `edge` does, 2×2, smaller units, the scene on chip",
    "traversal": "rays of applications",
    "tiny": "tests, the smallest array",
    "fpga": "an ECP5 board",
}

#: The clock at which rates are given, MHz.
MEGAHERTZ = paper.MEGAHERTZ

#: The area of the array without wires and gaps, its rate and its energy come from these two files.
BENCH, AREA = "bench-{}", "area-{}-asap7"


def facts(data: Data, preset: str) -> dict[str, float]:
    """The figures of a preset that its data files give.

    Returns:
        ``raysPerCycle``, ``fewest`` and ``most``: in-box rays per cycle, geometric mean, lowest and highest of the
        meshes. ``mirrorRaysPerCycle``: as mirrors. ``timesChip``: relative to the chip. ``mm2``: at 28 nm, with all
        memories. ``kge``: logic. ``fo4``, ``mhz``: the slowest path, and the clock that it allows. ``nj``,
        ``njGlitches``: energy of an in-box ray at 28 nm. ``equalArea``: rays per cycle relative to the chip at equal
        area. ``mrays``, ``mraysPerMm2``: at `MEGAHERTZ`. ``mraysAtClock``, ``mraysPerMm2AtClock``: at ``mhz``.
        ``framesPerSecond``: of the benchmark at `MEGAHERTZ`. ``framesPerJoule``: of as many in-box rays as a frame of
        the paper has rays, by ``njGlitches``. ``watts``: of the array at ``mrays``, by ``njGlitches``.
    """
    found: dict[str, float] = {}
    bench, area = data.optional(BENCH.format(preset)), data.optional(AREA.format(preset))
    if bench is not None:
        rates = [mesh["rays_per_cycle_in_box"] for mesh in bench["meshes"].values()]
        found |= {"raysPerCycle": bench["geomean_rays_per_cycle_in_box"], "fewest": min(rates), "most": max(rates)}
        found["timesChip"] = found["raysPerCycle"] / paper.RAYS_PER_CYCLE
        found["mrays"] = found["raysPerCycle"] * MEGAHERTZ
        found["framesPerSecond"] = MEGAHERTZ * 1e6 / geometric_mean(mesh["cycles"] for mesh in bench["meshes"].values())
        if bench.get("mirror"):
            found["mirrorRaysPerCycle"] = bench["mirror"]["geomean_rays_per_cycle_in_box"]
    if area is not None:
        array, clock = area["levels"]["array"], fastest_clock(area)
        found |= {"mm2": array["mm2_28nm"], "kge": array["logic_kge"]}
        found |= {"fo4": clock.fo4, "mhz": clock.megahertz} if clock else {}
        found |= _energies(area)
    if "njGlitches" in found:
        found["framesPerJoule"] = 1e9 / (paper.RAYS_A_FRAME * found["njGlitches"])
    if bench is not None and area is not None:
        found["equalArea"] = found["timesChip"] * area["chip"]["mm2"] / found["mm2"]
        found["mraysPerMm2"] = found["mrays"] / found["mm2"]
        if "mhz" in found:
            found["mraysAtClock"] = found["raysPerCycle"] * found["mhz"]
            found["mraysPerMm2AtClock"] = found["mraysAtClock"] / found["mm2"]
        if "njGlitches" in found:
            found["watts"] = found["mrays"] * found["njGlitches"] / 1e3
    return found


def _energies(area: Mapping[str, Any]) -> dict[str, float]:
    power = area.get("power")
    if not power:
        return {}
    kinds = {"nj": "zero_delay", "njGlitches": "glitch_aware"}
    return {name: power[kind]["at_28nm"]["energy_per_ray_nj"] for name, kind in kinds.items()}


#: How a figure of `facts` is written in a text.
FORMATS = {
    **dict.fromkeys(("raysPerCycle", "fewest", "most", "mirrorRaysPerCycle"), ".2f"),
    **dict.fromkeys(("mm2", "nj", "njGlitches", "watts"), ".2f"),
    "timesChip": ".1f",
    "equalArea": ".2f",
    **dict.fromkeys(("kge", "mhz", "mrays", "mraysAtClock", "framesPerSecond", "framesPerJoule"), ",.0f"),
    **dict.fromkeys(("fo4", "mraysPerMm2", "mraysPerMm2AtClock"), ".0f"),
}


def text(found: Mapping[str, float], key: str) -> str:
    """A figure as text; a dash without it."""
    if key not in found:
        return "–"
    form = ".3f" if found[key] < 1 and FORMATS[key] == ".2f" else FORMATS[key]
    return format(found[key], form)
