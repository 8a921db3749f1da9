"""What the tree costs: its records, and what rays read of it in the benchmark's frames, by the model.

``python -m colonnade_lab.evaluation.studies.tree_reads [CONFIG [MESH…]]`` prints a table in Markdown.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from colonnade.design.generator import manifest_for
from colonnade.design.toolchain import project_root
from colonnade.render.device_frames import render_model
from colonnade.scene.object_mesh import object_mesh
from colonnade.scene.parser import load_scene
from colonnade.scene.prepared.device_scene import DeviceScene

from colonnade_lab.common.markdown import markdown
from colonnade_lab.evaluation.bench import MESHES, geometric_mean

TITLES = ["mesh", "node records", "triangle records", "nodes per ray", "triangle tests per ray", "pairs"]


def tree_reads(config: str, meshes: Sequence[str], size: tuple[int, int]) -> dict[str, dict[str, float]]:
    """Records of each mesh, its reads per in-box ray, and the share of the leaves that are pairs.

    Args:
        config: A configuration with a tree.
        meshes: Names or files.
        size: Width and height of the frames, pixels.
    """
    manifest = manifest_for(config).manifest
    scene = load_scene(project_root() / "scenes" / "object.toml")
    found = {}
    for name in meshes:
        own = scene.with_mesh(name)
        mesh = replace(object_mesh(own, corner_colours=True), name=name)
        image = DeviceScene.of(own, manifest, mesh).image
        counters = render_model(own, mesh, manifest, size).report.counters
        found[name] = {
            "node_records": image.header.nodes,
            "triangle_records": image.header.leaves,
            "nodes": counters["nodeReads"] / counters["raysInBox"],
            "tests": counters["triangleTests"] / counters["raysInBox"],
            "pairs": float(np.mean(image.source_faces[1::2][image.source_faces[::2] >= 0] >= 0)),
        }
    return found


def table(results: dict[str, dict[str, float]]) -> str:
    """The figures of each mesh in Markdown."""
    rows: list[list[Any]] = [
        [
            name,
            f"{row['node_records']:,}",
            f"{row['triangle_records']:,}",
            f"{row['nodes']:.2f}",
            f"{row['tests']:.2f}",
            f"{row['pairs']:.0%}",
        ]
        for name, row in results.items()
    ]
    means = (f"{geometric_mean(row[key] for row in results.values()):.2f}" for key in ("nodes", "tests"))
    return markdown(TITLES, [*rows, ["geometric mean", "", "", *means, ""]])


if __name__ == "__main__":
    config, *names = sys.argv[1:] or ["edge"]
    print(table(tree_reads(config, names or MESHES, (640, 480))))
