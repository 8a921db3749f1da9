"""Generates the tables of ``docs/performance.md`` from the data of `tools/performance`.

A table replaces the text between ``<!-- NAME -->`` and ``<!-- end -->``; the rest of the page stays as it is.
Run as ``python -m colonnade.lab.report.performance_page DOCS``.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from colonnade.common.atomic_files import replacing
from colonnade.lab.common.markdown import markdown
from colonnade.lab.evaluation.bench import PAPER_RAYS_PER_CYCLE, geometric_mean
from colonnade.lab.report.fields import LABELS, base_of, rate_of, varied_points

Data = Mapping[str, Any]

_TABLE = re.compile(r"(<!-- (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def page(text: str, docs: Path) -> str:
    """The page with new tables.

    Args:
        text: The text of the page.
        docs: The folder of the page and of ``data``.
    """

    def replaced(match: re.Match[str]) -> str:
        part, table = TABLES[match[2]]
        file = docs / "data" / f"{part}.json"
        body = table(json.loads(file.read_text()), docs) if file.is_file() else f"Run `tools/performance {part}`."
        return f"{match[1]}{body}\n{match[3]}"

    return _TABLE.sub(replaced, text)


def rates(bench: Data, _: Path) -> str:
    """Rays per cycle, their bounds, and the bottleneck."""
    width, height = bench["size"]
    array, memory = bench["config"]["array"], bench["config"]["columnBvhMemory"]
    hardware = f"{array['rows']}×{array['columns']} render units with {array['contexts']} contexts each"
    kind = "snooping" if memory["snooping"] else "round-robin"
    latency = f"read latency {memory['readLatency']}"
    conditions = f"{hardware}, {memory['banks']} banks per column, {kind}, {latency}; {width}×{height} pixels."
    rows: list[tuple[str, ...]] = [
        (
            name,
            f"{mesh['triangles']:,}",
            f"{mesh['cycles']:,}",
            f"{mesh['rays']['in_box']:,}",
            f"**{mesh['rays_per_cycle_in_box']:.2f}**",
            f"{mesh['rays_per_cycle']:.2f}",
            _number(mesh["bounds"]["perfect_memory"]),
            _number(mesh["bounds"]["perfect_units"]),
            f"{mesh['bottleneck']}, {_percent(mesh['utilisation'][mesh['bottleneck']])}",
        )
        for name, mesh in bench["meshes"].items()
    ]
    bounds = bench["geomean_bounds"]
    means = (bench["geomean_rays_per_cycle"], bounds["perfect_memory"], bounds["perfect_units"])
    in_box = f"**{bench['geomean_rays_per_cycle_in_box']:.2f}**"
    rows.append(("geometric mean", "", "", "", in_box, *(_number(mean) for mean in means), ""))
    titles = ["mesh", "triangles", "cycles", "in-box rays", "in-box rays per cycle", "all rays per cycle"]
    titles += ["bound: perfect memory", "bound: perfect units", "bottleneck, utilisation"]
    ratio = f"**{bench['ratio_to_paper']:.1f} times** the chip's {PAPER_RAYS_PER_CYCLE}."
    return f"{conditions} The geometric mean is {ratio}\n\n{markdown(titles, rows)}"


def mirror(bench: Data, _: Path) -> str:
    """Rays per cycle of the same meshes as mirrors."""
    reflected = bench.get("mirror")
    if reflected is None:
        return "Run `tools/performance bench`."
    rows: list[tuple[str, ...]] = [
        (
            name,
            f"{mesh['cycles']:,}",
            f"{mesh['rays']['reflection']:,}",
            f"{mesh['rays']['shadow']:,}",
            f"{mesh['rays']['in_box']:,}",
            f"**{mesh['rays_per_cycle_in_box']:.2f}**",
            f"{mesh['rays_per_cycle']:.2f}",
            f"{mesh['bottleneck']}, {_percent(mesh['utilisation'][mesh['bottleneck']])}",
        )
        for name, mesh in reflected["meshes"].items()
    ]
    in_box = f"**{reflected['geomean_rays_per_cycle_in_box']:.2f}**"
    rows.append(("geometric mean", "", "", "", "", in_box, _number(reflected["geomean_rays_per_cycle"]), ""))
    titles = ["mesh", "cycles", "reflections", "shadow rays", "in-box rays", "in-box rays per cycle"]
    titles += ["all rays per cycle", "bottleneck, utilisation"]
    ratio = f"**{reflected['ratio_to_paper']:.1f} times** the chip's {PAPER_RAYS_PER_CYCLE}."
    return f"The geometric mean is {ratio}\n\n{markdown(titles, rows)}"


def limits(bench: Data, _: Path) -> str:
    """In-box rays per cycle at full utilisation of each unit or port."""
    meshes = bench["meshes"]
    resources = list(next(iter(meshes.values()))["limits"])
    rows = [(name, *(_number(mesh["limits"][resource]) for resource in resources)) for name, mesh in meshes.items()]
    means = (geometric_mean(mesh["limits"][resource] or 0.0 for mesh in meshes.values()) for resource in resources)
    rows.append(("geometric mean", *(f"**{mean:.2f}**" for mean in means)))
    return markdown(["mesh", *resources], rows)


def work(bench: Data, _: Path) -> str:
    """Work per in-box ray."""
    titles = ["mesh", "nodes", "box tests", "triangle records", "triangle tests", "records taken", "bank reads"]
    titles += ["snooped"]
    rows: list[tuple[str, ...]] = [
        (name, *(f"{value:.2f}" for value in mesh["per_ray"].values()), _percent(mesh["snoop_share"]))
        for name, mesh in bench["meshes"].items()
    ]
    return markdown(titles, rows)


def stages(bench: Data, _: Path) -> str:
    """Context cycles by state."""
    return _shares(bench, "stalls")


def utilisation(bench: Data, _: Path) -> str:
    """Utilisation of units and ports."""
    return _shares(bench, "utilisation")


def speed(bench: Data, _: Path) -> str:
    """Simulation speed."""
    titles = ["mesh", "simulated cycles", "cycles per second", "seconds with loading"]
    rows: list[tuple[str, ...]] = [
        (name, f"{mesh['cycles']:,}", f"{mesh['cycles_per_second']:,.0f}", f"{mesh['seconds']['run']:.1f}")
        for name, mesh in bench["meshes"].items()
    ]
    return markdown(titles, rows)


def scaling(study: Data, _: Path) -> str:
    """Rays per cycle of the study of each field, as picture and as table."""
    base = base_of(study)
    titles = ["field", "value", *(f"{name}: in-box rays per cycle" for name in base["workloads"])]
    titles += ["per render unit", "relative to base"]

    def row(name: str, value: str, point: Data) -> tuple[str, ...]:
        rates = (f"{rate_of(point, workload):.3f}" for workload in point["workloads"])
        array, mean = point["config_values"]["array"], point["figures"]["rays_per_cycle"]
        per_unit, relative = mean / (array["rows"] * array["columns"]), mean / base["figures"]["rays_per_cycle"]
        return name, value, *rates, f"{per_unit:.4f}", f"{relative:.2f}"

    rows = [row("base", "", base)]
    for point in varied_points(study):
        ((key, value),) = point["values"].items()
        rows.append(row(LABELS.get(key, key), str(value), point))
    picture = "![In-box rays per cycle over each field](pictures/scaling.png)"
    return f"{picture}\n\n{markdown(titles, rows)}"


def ablation(study: Data, docs: Path) -> str:
    """In-box rays per cycle and column, of the RTL and of the cycle model, by mesh and number of contexts."""
    keys = ("array.contexts", "columnBvhMemory.snooping", "columnBvhMemory.banks")
    points = {tuple(point["values"][key] for key in keys): point for point in varied_points(study)}
    modelled = json.loads((docs / "data" / "cycle-model.json").read_text())
    model = {
        (p["mesh"], p["lanes"], p["contexts"], p["snooping"], p["banks"]): p["in_box"] / modelled["columns"]
        for p in modelled["points"]
    }
    base = base_of(study)
    columns = base["config_values"]["array"]["columns"]
    variants = list(dict.fromkeys((snooping, banks) for _, snooping, banks in points))
    names = [
        f"{'snooping' if snooping else 'round-robin'}, {banks} bank{'s' * (banks > 1)}" for snooping, banks in variants
    ]
    rows = []
    for mesh in base["workloads"]:
        for contexts in dict.fromkeys(contexts for contexts, _, _ in points):
            keys_of_row = [(contexts, *variant) for variant in variants]
            measured = (f"**{rate_of(points[key], mesh) / columns:.3f}**" for key in keys_of_row)
            rows.append((mesh, str(contexts), "RTL", *measured))
            for lanes in ("6/2", "12/4"):
                figures = [model.get((mesh, lanes, *key)) for key in keys_of_row]
                if any(figure is not None for figure in figures):
                    rows.append(("", "", f"cycle model, {lanes} lanes", *(_number(figure, 3) for figure in figures)))
    return markdown(["mesh", "contexts", "source", *names], rows)


def _shares(bench: Data, key: str) -> str:
    first = next(iter(bench["meshes"].values()))
    rows = [(name, *(_percent(share) for share in mesh[key].values())) for name, mesh in bench["meshes"].items()]
    return markdown(["mesh", *first[key]], rows)


def _number(value: float | None, digits: int = 2) -> str:
    return "–" if value is None else f"{value:.{digits}f}"


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


#: For each table of the page: the part of `tools/performance` that measures its data, and its generator.
TABLES: dict[str, tuple[str, Callable[[Data, Path], str]]] = {
    "rates": ("bench", rates),
    "mirror": ("bench", mirror),
    "limits": ("bench", limits),
    "work": ("bench", work),
    "stages": ("bench", stages),
    "utilisation": ("bench", utilisation),
    "speed": ("bench", speed),
    "scaling": ("scaling", scaling),
    "ablation": ("ablation", ablation),
}


def main(docs: Path) -> None:
    """Update the tables of ``performance.md`` in the folder `docs`."""
    file = docs / "performance.md"
    text = page(file.read_text(), docs)
    with replacing(file) as stream:
        stream.write(text.encode())


if __name__ == "__main__":
    main(Path(sys.argv[1]))
