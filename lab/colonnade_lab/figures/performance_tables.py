"""The tables of ``docs/performance.md``: rays per cycle, utilisation, scaling, snooping."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from colonnade_lab.common.markdown import markdown
from colonnade_lab.evaluation.throughput import PATH_UNIT
from colonnade_lab.figures.data import Data
from colonnade_lab.report.fields import base_of, rate_of, varied_points


def rates(data: Data) -> str:
    """Rays per cycle of `edge` by mesh, with the bottleneck, and as mirrors."""
    bench = data.result("bench-edge")
    mirrors = bench["mirror"]["meshes"]
    rows = [
        [
            name,
            f"{mesh['triangles']:,}",
            f"{mesh['cycles']:,}",
            f"{mesh['rays']['in_box']:,}",
            f"**{mesh['rays_per_cycle_in_box']:.2f}**",
            f"{mesh['bottleneck']}, {_percent(mesh['utilisation'][mesh['bottleneck']])}",
            f"{mesh['per_ray']['dram_bytes']:.1f}",
            f"{mirrors[name]['cycles']:,}",
            f"**{mirrors[name]['rays_per_cycle_in_box']:.2f}**",
        ]
        for name, mesh in bench["meshes"].items()
    ]
    means = (f"**{each['geomean_rays_per_cycle_in_box']:.2f}**" for each in (bench, bench["mirror"]))
    rows.append(["geometric mean", "", "", "", next(means), "", "", "", next(means)])
    titles = ["mesh", "triangles", "cycles", "in-box rays", "rays per cycle", "bottleneck, %", "bytes of DRAM a ray"]
    return markdown([*titles, "cycles as a mirror", "rays per cycle"], rows)


def large(data: Data) -> str:
    """Rays per cycle of `edge` for meshes that no cache holds, on DRAM of one latency and on DRAM with rows."""
    found = data.result("bench-large")
    latency, banks = (found[part]["meshes"] for part in ("latency", "banks"))
    size = "×".join(str(each) for each in found["latency"]["size"])
    rows = [
        [
            name,
            f"{mesh['triangles']:,}",
            f"{mesh['rays_per_cycle_in_box']:.2f}",
            f"{mesh['per_ray']['dram_bytes']:.0f}",
            f"{banks[name]['rays_per_cycle_in_box']:.2f}",
        ]
        for name, mesh in latency.items()
    ]
    titles = ["mesh", "triangles", f"in-box rays per cycle, {size}", "bytes of DRAM a ray", "with rows, rays per cycle"]
    return markdown(titles, rows)


def utilisation(data: Data) -> str:
    """Utilisation of units and ports of `edge`, and what each would allow alone."""
    meshes = data.result("bench-edge")["meshes"]
    shares = next(iter(meshes.values()))["utilisation"]
    rows = [[name, *(_percent(share) for share in mesh["utilisation"].values())] for name, mesh in meshes.items()]
    limits = {name: [mesh["limits"].get(name) for mesh in meshes.values()] for name in shares if name != PATH_UNIT}
    means = ["" if name == PATH_UNIT else _least(limits[name]) for name in shares]
    return markdown(["%", *shares], [*rows, ["lowest limit", *means]])


def _least(limits: list[float | None]) -> str:
    known = [limit for limit in limits if limit is not None]
    return f"{min(known):.2f}" if known else "–"


def scaling(data: Data) -> str:
    """Rays per cycle over each field, relative to the base."""
    study = data.result("scaling")
    base = base_of(study)
    titles = ["field", "value", *base["workloads"], "to the base"]

    def row(name: str, value: str, point: Mapping[str, Any]) -> list[str]:
        each = (f"{rate_of(point, workload):.2f}" for workload in point["workloads"])
        return [name, value, *each, f"{point['figures']['rays_per_cycle'] / base['figures']['rays_per_cycle']:.2f}"]

    rows = [row("base", "", base)]
    for point in varied_points(study):
        ((key, value),) = point["values"].items()
        rows.append(row(f"`{key}`", str(value), point))
    return markdown(titles, rows)


def ablation(data: Data) -> str:
    """In-box rays per cycle of a column with and without snooping, by mesh, contexts and banks."""
    study = data.result("ablation")
    keys = ("array.contexts", "columnBvhMemory.snooping", "columnBvhMemory.banks")
    points = {tuple(point["values"][key] for key in keys): point for point in varied_points(study)}
    variants = list(dict.fromkeys((snooping, banks) for _, snooping, banks in points))
    names = [
        f"{'snooping' if snooping else 'round-robin'}, {banks} bank{'s' * (banks > 1)}" for snooping, banks in variants
    ]
    rows = [
        [mesh, str(contexts), *(f"{rate_of(points[(contexts, *variant)], mesh):.3f}" for variant in variants)]
        for mesh in base_of(study)["workloads"]
        for contexts in dict.fromkeys(contexts for contexts, _, _ in points)
    ]
    return markdown(["mesh", "contexts", *names], rows)


def _percent(share: float) -> str:
    return f"{100 * share:.0f}"


def simulators(data: Data) -> str:
    """Simulated cycles by a CPU second: of `small` by what drives it and by the simulator; of `edge`."""
    found = data.result("simulators")
    rows = [
        [row["by"], row["simulator"], f"{row['cycles']:,}", f"{row['cycles_per_second']:,.0f}"]
        for row in found["simulators"]
    ]
    sleep, simulator = found["sleep"], found["simulators"][0]["simulator"]
    rows += [
        [f"`edge`, bunny, {name}", simulator, f"{sleep['cycles']:,}", f"{sleep[key]:,.0f}"]
        for key, name in (("asleep", "idle units sleep"), ("awake", "none sleeps"))
    ]
    return markdown(["by", "simulator", "cycles", "cycles by a CPU second"], rows)


def view(data: Data) -> str:
    """Rates and waits of `colonnade view`, by scene."""
    found = data.result("view")
    head = ["scene", "frames a second", "processor time a frame", "that is, on one core", "saved file", "start"]
    rows = [
        [
            f"`{row['scene']}`",
            f"{row['rate']:.1f}",
            f"{1e3 * row['processor']:.0f} ms",
            f"{1 / row['processor']:.1f}",
            *(f"{row[wait]:.1f} s" for wait in ("reload", "start", "rest")),
        ]
        for row in found["scenes"]
    ]
    return markdown([*head, f"{found['samples']} samples"], rows)


TABLES: Mapping[str, Callable[[Data], str]] = {
    "rates": rates,
    "utilisation": utilisation,
    "large": large,
    "scaling": scaling,
    "ablation": ablation,
    "simulators": simulators,
    "view": view,
}
