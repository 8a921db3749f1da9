"""Plot of the benchmark: context cycles by state, and the utilisation of units and ports, per mesh."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from colonnade_lab.evaluation.throughput import COMPLETION, CONTEXT_CYCLES
from colonnade_lab.report.style import array_name, figure

#: Segments of a bar from the bottom, with their colours: work, stalls, idle.
STAGES = {
    "ray set-up": "#5B9BD5",
    "box unit and stack": "#009E73",
    "triangle unit": "#A9D8EE",
    "shader": "#CC79A7",
    COMPLETION: "#B9A0D6",
    "unit stall": "#F2C14E",
    "record stall": "#D55E00",
    "idle": "#DDDDDD",
}

#: Smallest share with room for a number in its segment.
MIN_LABELLED = 0.035

#: Longest mesh name, in characters, that fits below a bar without rotation.
MAX_NAME = 13


def plot_stages(report: Mapping[str, Any], path: Path) -> None:
    """Plot a report of `colonnade_lab.explore.bench.bench` as PNG."""
    assert set(STAGES) == {*CONTEXT_CYCLES, COMPLETION}
    width = max(7.0, 3.3 + 0.86 * len(report["meshes"]))
    with figure(path, width, 6.4, 2, 1, sharex=True, gridspec_kw={"height_ratios": [1.25, 1.0]}) as axes:
        _bars(axes[0][0], report)
        _grid(axes[1][0], report)


def _bars(axis: Any, report: Mapping[str, Any]) -> None:
    meshes = report["meshes"]
    positions = range(len(meshes))
    bottoms = [0.0] * len(meshes)
    for stage, colour in STAGES.items():
        shares = [mesh["stalls"][stage] for mesh in meshes.values()]
        axis.bar(positions, shares, 0.72, bottoms, color=colour, label=stage, edgecolor="white", linewidth=0.5)
        for position, bottom, share in zip(positions, bottoms, shares, strict=True):
            if share >= MIN_LABELLED:
                axis.text(position, bottom + share / 2, f"{100 * share:.0f}", ha="center", va="center", fontsize=8)
        bottoms = [bottom + share for bottom, share in zip(bottoms, shares, strict=True)]
    width, height = report["size"]
    axis.set_title(f"Context cycles by state, %  ({array_name(report['config'])}; {width}×{height})")
    axis.tick_params(bottom=False)
    axis.set_ylim(0, 1)
    axis.yaxis.set_major_formatter(lambda share, _: f"{100 * share:.0f}")
    handles, labels = axis.get_legend_handles_labels()
    axis.legend(handles[::-1], labels[::-1], loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8.5)


def _grid(axis: Any, report: Mapping[str, Any]) -> None:
    meshes = report["meshes"]
    resources = list(next(iter(meshes.values()))["utilisation"])
    shares = [[mesh["utilisation"][name] for mesh in meshes.values()] for name in resources]
    axis.imshow(shares, cmap="Blues", vmin=0, vmax=1.15, aspect="auto")
    for row, name in enumerate(resources):
        for position, mesh in enumerate(meshes.values()):
            share = shares[row][position]
            weight = "bold" if name == mesh["bottleneck"] else "normal"
            colour = "white" if share > 0.6 else "black"
            axis.text(position, row, f"{100 * share:.0f}", ha="center", va="center", color=colour, weight=weight)
    names = [Path(name).name for name in meshes]
    rates = [f"{mesh['rays_per_cycle_in_box']:.2f}" for mesh in meshes.values()]
    tilt = {"rotation": 20, "ha": "right", "rotation_mode": "anchor"} if max(map(len, names)) > MAX_NAME else {}
    labels = (f"{name}\n{rate}" for name, rate in zip(names, rates, strict=True))
    axis.set_title("Utilisation of units and ports, % of cycles  (bold: the bottleneck)")
    axis.set_xticks(range(len(meshes)), list(labels), **tilt)
    axis.set_xlabel("in-box rays per cycle below the meshes")
    axis.set_yticks(range(len(resources)), resources)
    axis.tick_params(length=0)
    for side in ("left", "bottom"):
        axis.spines[side].set_visible(False)
