"""The paper's figures as plots of the data of ``docs/paper.md``; dotted lines are the paper's own values."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from colonnade_lab.common import paper
from colonnade_lab.evaluation.bench import geometric_mean
from colonnade_lab.figures.data import Data, Missing
from colonnade_lab.figures.facts import MEGAHERTZ, facts
from colonnade_lab.figures.measure import age
from colonnade_lab.figures.pages import Read
from colonnade_lab.figures.paper_tables import ARRAYS
from colonnade_lab.figures.precision_tables import printed_index, relative
from colonnade_lab.figures.tree_tables import overheads
from colonnade_lab.report.speed_up import NONE, reductions
from colonnade_lab.report.style import COLOURS, GREY, figure

_PAPER = {"color": "#D55E00", "linestyle": ":", "linewidth": 1.5}
_WIDTH, _HEIGHT = 6.4, 3.2


def _bars(axis: Any, names: Sequence[str], series: Mapping[str, Sequence[float]], form: str = "") -> None:
    """Bars of several series beside each other, with values above them if `form` is given."""
    width = 0.8 / len(series)
    for index, (label, values) in enumerate(series.items()):
        places = [place + (index - (len(series) - 1) / 2) * width for place in range(len(names))]
        drawn = axis.bar(places, values, width * 0.95, color=COLOURS[index], label=label)
        if form:
            axis.bar_label(drawn, [format(value, form) for value in values], fontsize=7, padding=1)
    is_long = len(names) > 4
    axis.set_xticks(range(len(names)), names, rotation=25 if is_long else 0, ha="right" if is_long else "center")
    if len(series) > 1:
        _legend(axis)


def _legend(axis: Any) -> None:
    """A legend above the axes, which hides nothing."""
    axis.legend(fontsize=7, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))


def _points(study: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    return {point["name"]: point for point in study["points"]}


def _relative_power(data: Data, axes: Any) -> None:
    ours = {
        title: relative(data, key)
        for title, key in (("power of a row", "mw"), ("energy a ray", "nj"), ("area of the array", "array_kge"))
    }
    names = list(ours["power of a row"])
    _bars(axes[0][0], names, {title: [100 * found[name] for name in names] for title, found in ours.items()})
    axes[0][0].axhline(100 * (1 - paper.POWER_SAVED), **_PAPER, label=f"the paper's power of {paper.PRECISION}")
    axes[0][0].set_ylabel("% of 64b64s64d")
    _legend(axes[0][0])


def _speed_up_by_object(data: Data, axes: Any) -> None:
    study = data.result("bvh-cycles")
    points = _points(study)
    frames: dict[str, list[str]] = {}
    for workload in study["workloads"]:
        mesh, _, maximum = workload["name"].rpartition(", ")
        frames.setdefault(maximum, []).append(mesh)
    first = next(iter(points))
    meshes = next(iter(frames.values()))

    def speed_up(mesh: str, maximum: str) -> float:
        cycles = {name: point["workloads"][f"{mesh}, {maximum}"]["cycles"] for name, point in points.items()}
        return float(cycles[NONE] / cycles[first])

    series = {f"at most {int(m):,} triangles": [speed_up(mesh, m) for mesh in meshes] for m in frames}
    _bars(axes[0][0], meshes, series, ".0f")
    axes[0][0].axhline(paper.TREE_SPEED_UP, **_PAPER, label=f"the paper's mean, {paper.TREE_SPEED_UP:g}")
    axes[0][0].set_yscale("log")
    axes[0][0].set_ylabel("times faster with a tree")
    _legend(axes[0][0])


def _overhead(data: Data, axes: Any) -> None:
    found = overheads(data)
    published = {"records": paper.TREE_MEMORY, "area": paper.TREE_AREA}
    series = {"here": [found[kind] for kind in found], "the paper": [100 * published[kind] for kind in found]}
    _bars(axes[0][0], ["memory of the scene", "area of the array"], series, ".1f")
    axes[0][0].set_ylabel("more with a tree, %")


def _loss(data: Data, axes: Any) -> None:
    study = data.result("mixed-precision")
    (library,) = study["libraries"]
    points, base = _points(study), study["baseline"]
    for index, (name, point) in enumerate(points.items()):
        losses = [max(100 * frame["dists_baseline"], 1e-4) for frame in point["workloads"].values()]
        power = 100 * point["figures"][f"mw.{library}"] / points[base]["figures"][f"mw.{library}"]
        axes[0][0].scatter([power] * len(losses), losses, s=14, color=COLOURS[index], label=name)
    for loss in paper.LOSS:
        axes[0][0].axhline(100 * loss, **_PAPER)
    axes[0][0].axvline(100 * (1 - paper.POWER_SAVED), **_PAPER)
    axes[0][0].set_yscale("log")
    axes[0][0].set_xlabel("power, % of 64b64s64d")
    axes[0][0].set_ylabel("DISTS loss, %: eight objects")
    _legend(axes[0][0])


def _render_index(data: Data, axes: Any) -> None:
    printed = printed_index(data)
    ours = {row["name"]: row["index"] for row in data.result("mixed-precision")["render_index"]["rows"]}
    names = sorted(printed)
    by = {"as printed, with power": printed, "with energy a ray": ours}
    _bars(axes[0][0], names, {title: [found[name] for name in names] for title, found in by.items()}, ".2f")
    axes[0][0].set_ylabel("RenderIndex, lower is better")


def _savings(data: Data, axes: Any) -> None:
    kinds = {"power": "mw", "area": "array_kge", "energy a ray": "nj"}
    series = {
        f"here, {name}": [100 * (1 - relative(data, key)[name]) for key in kinds.values()]
        for name in (paper.PRECISION, "24b24s64d")
    }
    _bars(axes[0][0], list(kinds), series, ".1f")
    for place, saved in enumerate((paper.POWER_SAVED, paper.AREA_SAVED)):
        axes[0][0].plot(
            [place - 0.45, place + 0.45],
            [100 * saved] * 2,
            **_PAPER,
            label=f"the paper, {paper.PRECISION}" if not place else None,
        )
    axes[0][0].set_ylabel("saved against 64b64s64d, %")
    _legend(axes[0][0])


def _rates(data: Data, axes: Any) -> None:
    study = data.result("bvh-cycles")
    triangles = {each.maximum: each.triangles for each in reductions(study)}
    for colour, point in zip(COLOURS, study["points"], strict=False):
        rates: dict[int, list[float]] = {}
        for frame, found in point["workloads"].items():
            rates.setdefault(int(frame.rpartition(", ")[2]), []).append(MEGAHERTZ * found["rays_per_cycle_in_box"])
        means = [geometric_mean(rates[maximum]) for maximum in triangles]
        axes[0][0].plot(list(triangles.values()), means, color=colour, marker="o", label=point["name"])
    axes[0][0].axhline(paper.MRAYS / paper.UNITS, **_PAPER, label="the paper's chip ÷ 80")
    axes[0][0].set_xscale("log")
    axes[0][0].set_yscale("log")
    axes[0][0].set_xlabel("triangles of a mesh, geometric mean")
    axes[0][0].set_ylabel("in-box MRay/s at 200 MHz")
    _legend(axes[0][0])


def _efficiency(data: Data, axes: Any) -> None:
    points = _points(data.result("bvh-power"))
    names = list(points)
    _bars(axes[0][0], names, {"": [points[name]["figures"]["mw.asap7"] for name in names]}, ".2f")
    _bars(axes[0][1], names, {"": [1 / points[name]["figures"]["nj.asap7"] for name in names]}, ".3f")
    with_tree = points[names[0]]["figures"]["mw.asap7"] / points[NONE]["figures"]["mw.asap7"]
    axes[0][0].set_title(f"{100 * (with_tree - 1):+.0f} % power; the paper: +5 %", fontsize=8)
    axes[0][0].set_ylabel("power of a row, mW")
    axes[0][1].set_ylabel("in-box rays in 1 nJ")


def _table_1(data: Data, axes: Any) -> None:
    designs = {design.name: float(design.frames_per_joule) for design in paper.DESIGNS}
    for preset in ARRAYS:
        data.file(f"area-{preset}-asap7")
        designs[preset] = facts(data, preset)["framesPerJoule"]
    drawn = axes[0][0].barh(
        list(designs), list(designs.values()), color=[*[GREY] * 4, COLOURS[1], *[COLOURS[0]] * len(ARRAYS)]
    )
    axes[0][0].bar_label(drawn, [f"{value:,.4g}" for value in designs.values()], fontsize=8, padding=2)
    axes[0][0].set_xscale("log")
    axes[0][0].invert_yaxis()
    axes[0][0].set_xlabel("frames/s/W")


@dataclass(frozen=True)
class Plot:
    """A figure of the paper, drawn from data.

    Attributes:
        name: The paper's.
        title: What it shows.
        note: What a reader must know to compare.
        draw: Draws it into axes.
        columns: How many axes it has.
    """

    name: str
    title: str
    note: str
    draw: Callable[[Data, Any], None]
    columns: int = 1


@dataclass(frozen=True)
class Drawn:
    """A plot, its file, None if its data are not measured, and the age of the data."""

    plot: Plot
    file: Path | None
    sources: tuple[str, ...]


_GATES = "Power is of replayed gates, without wires, clock tree and DRAM."

PLOTS = (
    Plot(
        "Fig. 6(a)",
        "Power, energy and area of eight precisions",
        f"The paper's text names two of its eight precisions; the others are a guess by the same rule. {_GATES}",
        _relative_power,
    ),
    Plot(
        "Fig. 7(a)",
        "Time with and without a tree, by object",
        "The paper does not name its seven objects, nor their triangles; those here are reduced to so many.",
        _speed_up_by_object,
    ),
    Plot(
        "Fig. 7(b)",
        "What the tree costs",
        "Here rows share triangle and path units, so the tree is more of the area. A node has four boxes.",
        _overhead,
    ),
    Plot(
        "Fig. 8(a)",
        "Loss of eight objects over power",
        f"A loss below 0.0001 % is drawn there. Dotted: the range of the paper's loss, and its power. {_GATES}",
        _loss,
    ),
    Plot("Fig. 8(b)", "RenderIndex of eight precisions", "The paper does not define its Norm.", _render_index),
    Plot("Fig. 8(c)", "What mixed precision saves", _GATES, _savings),
    Plot("Fig. 9(b)", "Rate of one unit with and without a tree", "Cycles of the Verilog of one unit.", _rates),
    Plot(
        "Fig. 9(c)",
        "Power and efficiency of one unit with and without a tree",
        f"On a mesh of 56 triangles. {_GATES}",
        _efficiency,
        2,
    ),
    Plot(
        "Table 1",
        "Efficiency, at equal rays a frame",
        f"Rivals rendered other scenes; the chip's power has all. {_GATES}",
        _table_1,
    ),
)


def draw(data: Data, folder: Path) -> Iterator[Drawn]:
    """Draw all plots into a folder."""
    for plot in PLOTS:
        file, read = folder / f"{re.sub(r'[^a-z0-9]', '', plot.name.lower())}.png", Read(data)
        try:
            with figure(file, _WIDTH, _HEIGHT, 1, plot.columns) as axes:
                plot.draw(read, axes)
        except Missing:
            yield Drawn(plot, None, ())
            continue
        contents = {name: content for name in sorted(read.names) if (content := data.get(name)) is not None}
        yield Drawn(plot, file, tuple(f"{name}: {age(content)}" for name, content in contents.items()))
