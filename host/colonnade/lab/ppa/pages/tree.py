"""Tables of ``docs/ppa.md``: cost and gain of the BVH."""

from __future__ import annotations

import json
from pathlib import Path

from colonnade.lab.common.markdown import markdown
from colonnade.lab.evaluation.bench import geometric_mean


def bvh(data: Path) -> str:
    """Cost of the BVH in gates."""
    files = data / "ppa-32b32s64d-yosys.json", data / "ppa-no-bvh-yosys.json"
    if not all(file.is_file() for file in files):
        return ""
    tree, none = (json.loads(file.read_text()) for file in files)
    rows = []
    for title, key in (("logic, kGE", "logic_kge"), ("memory, kbit", "memory_bits"), ("with memory, kGE", "kge")):
        on, off = (report["levels"]["render_unit"][key] for report in (tree, none))
        scale = 1000 if key == "memory_bits" else 1
        more = f"{on / off - 1:+.1%}" if off else "–"
        rows.append([f"render unit: {title}", f"{on / scale:,.1f}", f"{off / scale:,.1f}", more])
    on, off = (report["levels"]["array"]["logic_kge"] for report in (tree, none))
    rows.append(["array: logic, kGE", f"{on:,.1f}", f"{off:,.1f}", f"{on / off - 1:+.1%}"])
    return markdown(["figure", "with BVH", "without BVH", "overhead"], rows)


def nodes(data: Path) -> str:
    """Cost of the BVH in memory records."""
    file = data / "ppa-nodes.json"
    if not file.is_file():
        return ""
    report = json.loads(file.read_text())
    rows, overheads = [], []
    for name, mesh in report["meshes"].items():
        tree, none = mesh["tree"], mesh["none"]
        overheads.append(tree["records"] / none["records"])
        row = [name, f"{mesh['triangles']:,}", *(f"{tree[kind]:,}" for kind in ("nodes", "triangles", "attributes"))]
        rows.append(
            [*row, f"{none['records']:,}", f"{tree['nodes'] / none['records']:+.1%}", f"{overheads[-1] - 1:+.1%}"]
        )
    row = ["geometric mean", *[""] * 6, f"{geometric_mean(overheads) - 1:+.1%}"]
    titles = ["mesh", "triangles", "nodes", "triangle records", "attribute records", "all records without BVH"]
    return markdown([*titles, "overhead of the nodes", "total overhead"], [*rows, row])


def gain(data: Path) -> str:
    """Gain of the BVH in cycles."""
    file = data / "ppa-gain.json"
    if not file.is_file():
        return ""
    report = json.loads(file.read_text())
    reductions = report["reductions"].values()
    rows = []
    for name in next(iter(reductions))["meshes"]:
        row = [name]
        for reduction in reductions:
            mesh = reduction["meshes"][name]
            cycles = mesh["cycles"]
            row += [f"{mesh['triangles']:,}", f"{cycles['tree']:,}", f"{cycles['none']:,}", f"{mesh['gain']:.1f}"]
        rows.append(row)
    means = (["", "", "", f"**{reduction['geomean_gain']:.1f}**"] for reduction in reductions)
    rows.append(["geometric mean", *(cell for mean in means for cell in mean)])
    titles = ["triangles", "cycles with BVH", "cycles without BVH", "speed-up"] * len(reductions)
    width, height = report["size"]
    array = report["config"]["array"]
    size = f"{array['rows']}×{array['columns']} render units, {width}×{height}"
    head = f"{size}; speed-up of the paper: {report['paper_gain']}."
    return f"{head}\n\n{markdown(['reduced mesh', *titles], rows)}"
