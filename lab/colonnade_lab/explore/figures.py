"""The figures of a study: what each is, and how it follows from the results of the jobs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

from colonnade_lab.evaluation.bench import geometric_mean

#: The scratchpad that holds the scene. Areas are without it: its depth is a choice, and dwarfs all else. The memories
#: of caches are included.
SCENE_MEMORY = "records"

Better = Literal["higher", "lower"]


@dataclass(frozen=True)
class Column:
    """A figure of a point.

    Attributes:
        key: Its key; a figure of a library ends with ``.LIBRARY``.
        label: Its heading.
        unit: Its unit; empty for ratios.
        better: Which values are better; None for neither.
        format: Python's format.
        what: One sentence: what it is.
    """

    key: str
    label: str
    unit: str
    better: Better | None
    format: str
    what: str


QUALITY = (
    Column("psnr_min", "PSNR, lowest", "dB", "higher", ".1f", "lowest PSNR of a frame against Embree"),
    Column("psnr_mean", "PSNR, mean", "dB", "higher", ".1f", "mean PSNR of the frames against Embree"),
    Column("dists", "DISTS", "", "lower", ".4f", "mean DISTS of the frames against Embree"),
    Column("flip", "FLIP", "", "lower", ".4f", "mean FLIP of the frames against Embree"),
)
LOSS = (
    Column("dists_loss", "DISTS loss", "%", "lower", ".3f", "mean DISTS against the baseline's frames, times 100"),
    Column("dists_loss_max", "DISTS loss, largest", "%", "lower", ".3f", "largest DISTS loss of a frame"),
    Column("psnr_baseline_min", "PSNR to baseline", "dB", "higher", ".1f", "lowest PSNR against the baseline's frames"),
)
TESTS = (
    Column("box_tests", "box tests", "per ray", "lower", ".2f", "box tests per in-box ray, geometric mean"),
    Column("triangle_tests", "triangle tests", "per ray", "lower", ",.2f", "the same of triangle tests"),
    Column("records", "records", "", "lower", ",.0f", "records of the scene, geometric mean"),
)
CYCLES = (
    Column(
        "rays_per_cycle", "rays per cycle", "", "higher", ".3f", "in-box rays per cycle of the array, geometric mean"
    ),
)
AREA = (
    Column("unit_kge", "traversal unit", "kGE", "lower", ".1f", "logic and memories of a traversal unit"),
    Column("array_kge", "array", "kGE", "lower", ",.0f", "logic and memories of the array, without the scene memory"),
    Column("array_mm2", "array at 28 nm", "mm²", "lower", ".2f", "the same at 28 nm"),
    Column("fo4", "slowest path", "FO4", "lower", ".0f", "slowest path between registers, without wires"),
)
POWER = (
    Column("mw", "power", "mW", "lower", ".2f", "a row with glitches and memories, mean over the meshes"),
    Column("nj", "energy", "nJ/ray", "lower", ".3f", "energy of a row per in-box ray, mean over the meshes"),
    Column("nj_28nm", "energy at 28 nm", "nJ/ray", "lower", ".3f", "dynamic energy per in-box ray, scaled to 28 nm"),
)
PER_RATE = (
    Column(
        "area_per_rate",
        "area ÷ rate",
        "kGE·cycle/ray",
        "lower",
        ",.0f",
        "area of the array divided by its in-box rays per cycle",
    ),
)
ENERGY_AREA = (
    Column(
        "energy_area",
        "energy × area ÷ rate",
        "nJ·kGE·cycle/ray²",
        "lower",
        ",.0f",
        "energy per in-box ray × area of the array ÷ in-box rays per cycle",
    ),
)
RENDER_INDEX = (
    Column("render_index", "RenderIndex", "", "lower", ".3f", "Norm(DISTS loss) × Norm(energy per ray) × Norm(area)"),
)


#: A column of studies with a point that has some.
IDLE = Column(
    "idle_contexts",
    "idle contexts",
    "",
    None,
    ",d",
    "contexts of a column that are idle at any time: units.pathContexts",
)


def columns(has: Mapping[str, bool], libraries: Sequence[str]) -> list[Column]:
    """The figures of a study.

    Args:
        has: Which of ``quality``, ``tests``, ``baseline``, ``cycles``, ``area`` and ``power`` it measures.
        libraries: Names of its libraries.
    """
    found = list(QUALITY) if has["quality"] else []
    found += LOSS if has["quality"] and has["baseline"] else ()
    found += TESTS if has["tests"] else ()
    found += CYCLES if has["cycles"] else ()
    for library in libraries:
        of_library = list(AREA) if has["area"] else []
        of_library += POWER if has["power"] else ()
        of_library += PER_RATE if has["area"] and has["cycles"] else ()
        of_library += ENERGY_AREA if has["area"] and has["cycles"] and has["power"] else ()
        of_library += RENDER_INDEX if all(has[name] for name in ("quality", "baseline", "area", "power")) else ()
        title = f", {library}" if len(libraries) > 1 or library != "yosys" else ""
        found += [
            Column(f"{c.key}.{library}", f"{c.label}{title}", c.unit, c.better, c.format, f"{c.what}; {library}")
            for c in of_library
        ]
    return found


def described(found: Iterable[Column]) -> list[dict[str, Any]]:
    """Columns as values that JSON can hold."""
    return [asdict(column) for column in found]


def area_figures(report: Mapping[str, Any]) -> dict[str, Any]:
    """A library's figures of area, from a report of `colonnade_lab.ppa.measure`."""
    level, config = report["levels"]["array"], report["config"]
    scene = 0.0
    if config["columnBvhMemory"]["cache"] is None:
        scene = sum(memory["kge"] for name, memory in report["memories"].items() if name == SCENE_MEMORY)
    kge = level["kge"] - scene * config["array"]["columns"]
    slowest = report["slowest_path"]
    return {
        "units": {name: {"level": unit["level"], "kge": unit["kge"]} for name, unit in report["units"].items()},
        "traversal_unit_kge": report["levels"]["traversal_unit"]["kge"],
        "logic_kge": level["logic_kge"],
        "array_kge": kge,
        "mm2_28nm": kge * report["chip"]["um2_per_gate"] / 1e3,
        "slowest_path_ns": slowest["ns"],
        "slowest_path_fo4": slowest["fo4"],
        "slowest_path_unit": slowest["unit"],
    }


def power_figures(report: Mapping[str, Any]) -> dict[str, Any]:
    """A mesh's figures of power, from the section ``power`` of a report of `colonnade_lab.ppa.measure`."""
    total, window = report["glitch_aware"], report["window"]
    return {
        "mw": total["total_mw"],
        "mw_28nm": total["at_28nm"]["total_mw"],
        "nj_per_ray": total["energy_per_ray_nj"],
        "nj_per_ray_28nm": total["at_28nm"]["energy_per_ray_nj"],
        "nj_per_ray_zero_delay": report["zero_delay"]["energy_per_ray_nj"],
        "cycles": window["cycles"],
        "rays_in_box": window["rays_in_box"],
        "clock_mhz": report["clock_mhz"],
    }


def point_figures(point: Mapping[str, Any], has: Mapping[str, bool], libraries: Sequence[str]) -> dict[str, Any]:
    """The figures of a point; None where one of their measurements is missing.

    Args:
        point: A point of ``study.json``, without its figures.
        has: See `columns`.
        libraries: Names of the libraries.
    """
    frames = list(point["workloads"].values())
    found: dict[str, Any] = {}
    if has["quality"]:
        found["psnr_min"] = _of(min, (frame["psnr"] for frame in frames))
        found["psnr_mean"] = _of(_mean, (frame["psnr"] for frame in frames))
        found["dists"] = _of(_mean, (frame["dists"] for frame in frames))
        found["flip"] = _of(_mean, (frame["flip"] for frame in frames))
    if has["quality"] and has["baseline"]:
        found["dists_loss"] = _of(lambda values: 100 * _mean(values), (frame["dists_baseline"] for frame in frames))
        found["dists_loss_max"] = _of(lambda values: 100 * max(values), (frame["dists_baseline"] for frame in frames))
        found["psnr_baseline_min"] = _of(min, (frame["psnr_baseline"] for frame in frames))
    if has["tests"]:
        for key, counter in (("box_tests", "boxTests"), ("triangle_tests", "triangleTests")):
            found[key] = _of(geometric_mean, (per_ray(frame, counter) for frame in frames))
        found["records"] = _of(geometric_mean, (frame["records"] and frame["records"]["records"] for frame in frames))
    if has["cycles"]:
        rates = [frame["rays_per_cycle_in_box"] for frame in frames if frame["is_timed"]]
        found["rays_per_cycle"] = _of(geometric_mean, rates)
    for library in libraries:
        area = point["area"].get(library)
        if has["area"]:
            found[f"unit_kge.{library}"] = area and area["traversal_unit_kge"]
            found[f"array_kge.{library}"] = area and area["array_kge"]
            found[f"array_mm2.{library}"] = area and area["mm2_28nm"]
            found[f"fo4.{library}"] = area and area["slowest_path_fo4"]
        if has["power"]:
            runs = list(point["power"].get(library, {}).values())
            for key, source in (("mw", "mw"), ("nj", "nj_per_ray"), ("nj_28nm", "nj_per_ray_28nm")):
                found[f"{key}.{library}"] = _of(_mean, (run and run[source] for run in runs))
        if has["area"] and has["cycles"]:
            pair = (found[f"array_kge.{library}"], found["rays_per_cycle"])
            found[f"area_per_rate.{library}"] = _of(lambda values: values[0] / values[1], pair)
        if has["area"] and has["cycles"] and has["power"]:
            pair = (found[f"area_per_rate.{library}"], found[f"nj.{library}"])
            found[f"energy_area.{library}"] = _of(math.prod, pair)
    return found


def per_ray(frame: Mapping[str, Any], counter: str) -> float | None:
    """A counter of a frame per in-box ray; None if it is not measured."""
    counters = frame["counters"]
    return None if counters is None else float(counters[counter] / max(counters["raysInBox"], 1))


def _of(function: Any, values: Iterable[float | None]) -> float | None:
    """A function of values; None if there are none or one is missing."""
    known = list(values)
    return None if not known or any(value is None for value in known) else float(function(known))


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)


def front(points: Sequence[Mapping[str, Any]], objectives: Sequence[str], found: Sequence[Column]) -> list[str]:
    """Names of the points that no other point equals or surpasses in all objectives and surpasses in one."""
    signs = {column.key: -1.0 if column.better == "higher" else 1.0 for column in found}
    costs = {
        point["name"]: [signs[key] * point["figures"][key] for key in objectives]
        for point in points
        if all(point["figures"].get(key) is not None for key in objectives)
    }

    def is_dominated(name: str) -> bool:
        own = costs[name]
        return any(all(a <= b for a, b in zip(other, own, strict=True)) and other != own for other in costs.values())

    return [name for name in costs if not is_dominated(name)]
