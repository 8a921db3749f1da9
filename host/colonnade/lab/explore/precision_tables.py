"""The tables of ``docs/mixed-precision.md``, from ``study.json`` of ``scenes/studies/mixed-precision.toml``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from colonnade.lab.common.markdown import markdown

Data = Mapping[str, Any]

#: The paper's savings of 32b32s64d against its baseline, and its DISTS loss.
PAPER = ("source paper, 28 nm", "32b32s64d", "–", "33.4 %", "16.7 %", "0.6 to 1.65 %")

#: Titles of libraries.
LIBRARIES = {"asap7": "ASAP7", "sky130": "sky130"}


def quality(study: Data) -> str:
    """Loss of each design, over the meshes."""
    rows = [
        [
            f"**{point['name']}**" if point["name"] == _best(study) else point["name"],
            number(own["dists_loss"], ".3f"),
            number(own["dists_loss_max"], ".3f"),
            number(own["psnr_baseline_min"], ".1f"),
            number(own["psnr_min"], ".1f"),
            number(own["psnr_mean"], ".1f"),
            number(own["dists"], ".4f"),
            number(own["flip"], ".4f"),
            str(sum(len(frame["error_bits"] or ()) for frame in point["workloads"].values())),
        ]
        for point in study["points"]
        if (own := point["figures"])
    ]
    titles = ["design", "DISTS loss, mean, %", "largest, %", "PSNR to baseline, lowest, dB"]
    titles += ["PSNR to Embree, lowest, dB", "mean, dB", "DISTS to Embree", "FLIP to Embree", "error bits"]
    return markdown(titles, rows)


def cost(study: Data) -> str:
    """Area, power, energy and RenderIndex of each design, with each library."""
    titles = ["design"]
    for library in study["libraries"]:
        name = LIBRARIES.get(library, library)
        titles += [f"render unit, kGE, {name}", f"array, MGE, {name}", f"FO4, {name}", f"mW, {name}"]
        titles += [f"nJ per ray, {name}", f"RenderIndex, {name}"]
    rows = []
    for point in study["points"]:
        own, cells = point["figures"], []
        for library in study["libraries"]:
            cells += [
                number(own[f"unit_kge.{library}"], ".1f"),
                number(own[f"array_kge.{library}"], ".2f", 1e-3),
                number(own[f"fo4.{library}"], ".0f"),
                number(own[f"mw.{library}"], ".2f"),
                number(own[f"nj.{library}"], ".3f"),
                number(own[f"render_index.{library}"], ".3f"),
            ]
        rows.append([f"**{point['name']}**" if point["name"] == _best(study) else point["name"], *cells])
    return markdown(titles, rows)


def savings(study: Data) -> str:
    """What the best design saves against the baseline, beside the paper."""
    points = {point["name"]: point for point in study["points"]}
    base = points[study["baseline"]]["figures"]
    rows: list[Sequence[str]] = [PAPER]
    for library in study["libraries"]:
        for name in {_best(study, library) or PAPER[1]: None, PAPER[1]: None}:
            own = points[name]["figures"]
            losses = [100 * frame["dists_baseline"] for frame in points[name]["workloads"].values()]
            saved = [1 - own[f"{key}.{library}"] / base[f"{key}.{library}"] for key in ("nj", "mw", "array_kge")]
            loss = f"{min(losses):.4f} to {max(losses):.4f} %"
            rows.append([LIBRARIES.get(library, library), name, *(f"{100 * share:.1f} %" for share in saved), loss])
    return markdown(["", "design", "energy per ray saved", "power saved", "area saved", "DISTS loss of a frame"], rows)


def ranking(study: Data) -> str:
    """The three best designs by each choice of Norm."""
    rows = [
        [each["choice"], LIBRARIES.get(each["library"], each["library"]), *each["ranking"][:3], each["ranking"][-1]]
        for each in study["render_index"]["sensitivity"]
    ]
    return markdown(["Norm(loss), or all norms", "library", "best", "second", "third", "last"], rows)


def meshes(study: Data) -> str:
    """DISTS loss and PSNR against Embree of each frame."""
    names = [workload["name"] for workload in study["workloads"]]
    rows = []
    for point in study["points"]:
        frames = [point["workloads"][name] for name in names]
        cells = [f"{number(frame['dists_baseline'], '.2f', 100)} / {number(frame['psnr'], '.1f')}" for frame in frames]
        rows.append([point["name"], *cells])
    return markdown(["loss, % / PSNR, dB", *names], rows)


def conditions(study: Data) -> str:
    """The windows of the power runs."""
    rows = []
    for library in study["libraries"]:
        for name, run in study["points"][-1]["power"][library].items():
            cells = [f"{run['cycles']:,}", f"{run['rays_in_box']:,}", f"{run['clock_mhz']:g}"]
            rows.append([LIBRARIES.get(library, library), name, *cells])
    return markdown(["library", "mesh", f"cycles, {study['points'][-1]['name']}", "in-box rays", "MHz"], rows)


#: The tables of the page.
TABLES: Mapping[str, Callable[[Data], str]] = {
    "quality": quality,
    "cost": cost,
    "savings": savings,
    "ranking": ranking,
    "meshes": meshes,
    "conditions": conditions,
}


def _best(study: Data, library: str | None = None) -> str | None:
    """The design of the lowest RenderIndex, with a library or with the first one."""
    wanted = library or study["libraries"][0]
    rows = [row for row in study["render_index"]["rows"] if row["library"] == wanted]
    return min(rows, key=lambda row: float(row["index"]))["name"] if rows else None


def number(value: float | None, form: str, scale: float = 1.0) -> str:
    """The scaled value as text; a dash without one."""
    return "–" if value is None else format(value * scale, form)
