"""The tables of what a tree saves and costs: tests, cycles, records and area."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from colonnade_lab.common import paper
from colonnade_lab.common.markdown import markdown
from colonnade_lab.evaluation.bench import geometric_mean
from colonnade_lab.explore.figures import per_ray
from colonnade_lab.figures.data import Data
from colonnade_lab.figures.facts import MEGAHERTZ
from colonnade_lab.report.speed_up import NONE, reductions

Point = Mapping[str, Any]


def _points(study: Mapping[str, Any]) -> dict[str, Point]:
    return {point["name"]: point for point in study["points"]}


def tests(data: Data) -> str:
    """Tests of an in-box ray with and without a tree, by mesh, and of a frame without one by arithmetic."""
    study, costs = data.result("bvh-tests"), data.result("bvh-costs")
    points, alone = _points(study), _points(costs)[NONE]
    rows: list[list[str]] = []
    savings: dict[str, list[float]] = {name: [] for name in points}
    for workload in study["workloads"]:
        frame = workload["name"]
        every = per_ray(alone["workloads"][frame], "triangleTests") or 0.0
        base = points[study["baseline"]]["workloads"][frame]
        row = [frame, f"{workload['triangles']:,}", f"{base['records']['bytes'] / 1e6:.2f}"]
        for name, point in points.items():
            boxes, triangles = (
                per_ray(point["workloads"][frame], f"{kind}Tests") or 0.0 for kind in ("box", "triangle")
            )
            savings[name].append(every / (boxes + triangles))
            row.append(f"{boxes:.1f}, {triangles:.1f}")
        factors = (f"{each[-1]:,.0f}" for each in savings.values())
        rows.append([*row, f"{every:,.0f}", *factors, f"{base['counters']['raysInBox'] * every / 1e9:.1f}"])
    means = (f"{geometric_mean(each):,.0f}" for each in savings.values())
    rows.append(["geometric mean", *[""] * (3 + len(points)), *means, ""])
    titles = [f"{name}: box, triangle tests" for name in points]
    ratios = [f"none ÷ {name}" for name in points]
    head = ["mesh", "triangles", "scene, MB", *titles, "none: triangle tests", *ratios]
    return markdown([*head, "none: a frame's, billions"], rows)


def cycles(data: Data) -> str:
    """Cycles of reduced meshes with and without a tree, and the speed-up, beside the paper's."""
    study = data.result("bvh-cycles")
    names = [point["name"] for point in study["points"]]
    rows = [
        [
            f"{each.maximum:,}",
            f"{each.triangles:,.0f}",
            *(f"{each.cycles[name]:,.0f}" for name in names),
            *(f"{each.speed_up(name):.1f}" for name in names if name != NONE),
        ]
        for each in reductions(study)
    ]
    rows.append(["source paper", *["–"] * (1 + len(names)), f"{paper.TREE_SPEED_UP:g}", "–"])
    head = ["triangles, at most", "triangles, mean", *(f"cycles, {name}" for name in names)]
    return markdown([*head, *(f"speed-up, {name}" for name in names if name != NONE)], rows)


def costs(data: Data) -> str:
    """Records and area with and without a tree, beside the paper's."""
    study = data.result("bvh-costs")
    (library,) = study["libraries"]
    points = _points(study)

    def row(title: str, value: Callable[[Point], float], form: str, published: float | None = None) -> list[str]:
        values = {name: value(point) for name, point in points.items()}
        shares = [_more(own, values[NONE]) for name, own in values.items() if name != NONE]
        claim = "–" if published is None else f"+{100 * published:.1f}"
        return [title, *(format(own, form) for own in values.values()), *shares, claim]

    rows = [
        row("leaves", lambda point: _records(point, "triangles"), ",.0f"),
        row("**all records**, with nodes", lambda point: _records(point, "records"), ",.0f", paper.TREE_MEMORY),
        row("traversal unit, kGE", lambda point: point["area"][library]["traversal_unit_kge"], ".1f"),
        row("**array**, MGE", lambda point: point["area"][library]["array_kge"] / 1e3, ".2f", paper.TREE_AREA),
    ]
    names = list(points)
    overheads = [f"{name}, %" for name in names if name != NONE]
    return markdown(["", *names, *overheads, "the paper, %"], rows)


def power(data: Data) -> str:
    """Area, power and energy of one unit with and without a tree, beside the paper's power."""
    points = _points(data.result("bvh-power"))
    (library,) = data.result("bvh-power")["libraries"]
    rows = []
    for title, key, form, published in (
        ("array, kGE", "array_kge", ",.0f", "–"),
        ("power of a row at 200 MHz, mW", "mw", ".2f", f"+{100 * paper.TREE_POWER:g}"),
        ("energy of an in-box ray, nJ", "nj", ".3f", "–"),
    ):
        values = [point["figures"][f"{key}.{library}"] for point in points.values()]
        rows.append([title, *(format(value, form) for value in values), _more(*values), published])
    return markdown(["", *points, "BVH4, %", "the paper, %"], rows)


def more_power(data: Data) -> str:
    """The power of a row of `tiny` with its tree against that without one, %."""
    points = _points(data.result("bvh-power"))
    return _more(*(point["figures"]["mw.asap7"] for point in points.values()))


def less_energy(data: Data) -> str:
    """How many times less energy a ray takes with the tree of `tiny`."""
    tree, none = (point["figures"]["nj.asap7"] for point in _points(data.result("bvh-power")).values())
    return f"{none / tree:.1f}"


def cpu(data: Data) -> str:
    """A frame of the bunny on a core without a tree and in Embree, beside the paper's laptop and `edge`."""
    (found,) = data.result("cpu-baseline").values()
    edge = data.result("bench-edge")["meshes"]["bunny"]
    primary = f"{found['rays']:,}"
    rows = [
        ["the paper's laptop, i7-8665U", "none", "–", f"{paper.LAPTOP_HOURS:g} h", "–"],
        [
            f"plain C++, a core of {found['processor']}",
            "none",
            primary,
            f"{found['plain_seconds'] / 60:.1f} min",
            f"{found['rays'] / found['plain_seconds'] / 1e6:.4f}",
        ],
        [
            "Embree 4, the same core",
            "its own",
            primary,
            f"{1e3 * found['embree_seconds']:.0f} ms",
            f"{found['rays'] / found['embree_seconds'] / 1e6:.1f}",
        ],
    ]
    rays = round(edge["rays_per_cycle"] * edge["cycles"])
    seconds = edge["cycles"] / (MEGAHERTZ * 1e6)
    rows.append(
        [
            "`edge` at 200 MHz",
            "BVH4",
            f"{rays:,}, with shadows",
            f"{1e3 * seconds:.2f} ms",
            f"{rays / seconds / 1e6:,.0f}",
        ]
    )
    return markdown(["", "tree", "rays", "time", "MRay/s"], rows)


def laptop(data: Data) -> str:
    """Minutes of the frame in plain C++ on one core."""
    (found,) = data.result("cpu-baseline").values()
    return f"{found['plain_seconds'] / 60:.1f}"


def more_records(data: Data) -> str:
    """The records of the tree of `edge` against none, %."""
    return f"{overheads(data)['records']:+.1f}"


def more_area(data: Data) -> str:
    """The array of `edge` with its tree against that without one, %."""
    return f"{overheads(data)['area']:+.1f}"


def overheads(data: Data) -> dict[str, float]:
    """How much more records and area `edge` has with its tree than without one, %."""
    study = data.result("bvh-costs")
    (library,) = study["libraries"]
    tree, none = _tree_and_none(study)
    areas = (point["area"][library]["array_kge"] for point in (tree, none))
    records = (_records(point, "records") for point in (tree, none))
    return {kind: 100 * (own / other - 1) for kind, (own, other) in {"records": records, "area": areas}.items()}


def speed_ups(data: Data) -> str:
    """The lowest and the highest speed-up by the tree of `edge`, over sizes of meshes."""
    study = data.result("bvh-cycles")
    found = [each.speed_up(study["points"][0]["name"]) for each in reductions(study)]
    return f"{min(found):.1f} to {max(found):.1f}"


def megabytes(data: Data) -> str:
    """The smallest and the largest scene of the meshes, MB."""
    frames = data.result("bvh-tests")["points"][0]["workloads"].values()
    sizes = [frame["records"]["bytes"] / 1e6 for frame in frames]
    return f"{min(sizes):.2f} to {max(sizes):.2f}"


def _tree_and_none(study: Mapping[str, Any]) -> tuple[Point, Point]:
    """The points of the tree of `edge`, which is the first, and of none."""
    return study["points"][0], _points(study)[NONE]


def _records(point: Point, kind: str) -> float:
    return geometric_mean(frame["records"][kind] for frame in point["workloads"].values())


def _more(own: float, other: float) -> str:
    """How much more than another one it is, %."""
    return f"{100 * (own / other - 1):+.1f}"


TABLES: Mapping[str, Callable[[Data], str]] = {
    "bvh-tests": tests,
    "bvh-cycles": cycles,
    "bvh-costs": costs,
    "bvh-power": power,
    "cpu-baseline": cpu,
}
