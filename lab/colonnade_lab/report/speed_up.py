"""Plot of the speed-up of designs with a tree over the triangles of a mesh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from colonnade_lab.common import paper
from colonnade_lab.evaluation.bench import geometric_mean
from colonnade_lab.report.style import COLOURS, GREY, figure

#: The point without a tree.
NONE = "none"


@dataclass(frozen=True)
class Reduction:
    """The frames of the meshes with at most some number of triangles. Numbers are geometric means over the meshes.

    Attributes:
        maximum: That number.
        triangles: Triangles that the meshes have.
        cycles: Cycles of a frame by point.
    """

    maximum: int
    triangles: float
    cycles: Mapping[str, float]

    def speed_up(self, point: str) -> float:
        """How much faster a point is than that without a tree."""
        return self.cycles[NONE] / self.cycles[point]


def reductions(study: Mapping[str, Any]) -> list[Reduction]:
    """The reductions of a study of cycles whose frames are named ``MESH, MAXIMUM``, in the order of the study."""
    found: dict[int, list[Mapping[str, Any]]] = {}
    for workload in study["workloads"]:
        found.setdefault(int(workload["name"].rpartition(", ")[2]), []).append(workload)
    return [
        Reduction(
            maximum,
            geometric_mean(each["triangles"] for each in frames),
            {
                point["name"]: geometric_mean(point["workloads"][each["name"]]["cycles"] for each in frames)
                for point in study["points"]
            },
        )
        for maximum, frames in found.items()
    ]


def plot_speed_up(study: Mapping[str, Any], path: Path) -> None:
    """Plot the speed-up of each point against that without a tree as PNG, beside the paper's.

    Args:
        study: The content of ``study.json``.
        path: Output file.
    """
    found = reductions(study)
    triangles = [each.triangles for each in found]
    with figure(path, 5.2, 3.4) as axes:
        axis = axes[0][0]
        points = [point["name"] for point in study["points"] if point["name"] != NONE]
        for name, colour, marker in zip(points, COLOURS, "osD^", strict=False):
            axis.plot(triangles, [each.speed_up(name) for each in found], color=colour, marker=marker, label=name)
        axis.axhline(paper.TREE_SPEED_UP, color=GREY, linestyle=":", label=f"source paper: {paper.TREE_SPEED_UP:g}")
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.set_xlabel("triangles of a mesh, geometric mean")
        axis.set_ylabel("speed-up by the tree")
        axis.grid()
        axis.legend()
