"""The tables of ``docs/studies.md``: precision, energy and area, vertex bits and contexts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from colonnade.lab.common import paper
from colonnade.lab.common.markdown import markdown
from colonnade.lab.figures.data import Data

Study = Mapping[str, Any]

#: The paper's savings, and its DISTS loss.
_SAVED = (f"{100 * saved:.1f} %" for saved in (paper.POWER_SAVED, paper.AREA_SAVED))
_LOSS = " to ".join(f"{100 * loss:g}" for loss in paper.LOSS)
PAPER = ("source paper, 28 nm", paper.PRECISION, "–", *_SAVED, f"{_LOSS} %")


def precision(data: Data) -> str:
    """Loss, area, energy and RenderIndex of each precision."""
    study = data.result("mixed-precision")
    (library,) = study["libraries"]
    columns = (
        ("dists_loss", ".3f", 1),
        ("dists_loss_max", ".3f", 1),
        ("psnr_min", ".1f", 1),
        (f"array_kge.{library}", ".1f", 1e-3),
        (f"fo4.{library}", ".0f", 1),
        (f"mw.{library}", ".2f", 1),
        (f"nj.{library}", ".3f", 1),
        (f"render_index.{library}", ".3f", 1),
    )
    best = _best(study)
    rows = [
        [
            f"**{point['name']}**" if point["name"] == best else point["name"],
            *(number(point["figures"][key], form, scale) for key, form, scale in columns),
        ]
        for point in study["points"]
    ]
    titles = ["design", "DISTS loss, mean, %", "largest, %", "PSNR to Embree, lowest, dB", "array, MGE", "FO4"]
    return markdown([*titles, "mW of a row", "nJ per in-box ray", "RenderIndex"], rows)


def savings(data: Data) -> str:
    """What the best precision and the paper's choice save against the baseline, beside the paper."""
    study = data.result("mixed-precision")
    (library,) = study["libraries"]
    points = {point["name"]: point for point in study["points"]}
    base = points[study["baseline"]]["figures"]
    rows: list[Sequence[str]] = [PAPER]
    for name in {_best(study) or paper.PRECISION: None, paper.PRECISION: None}:
        own = points[name]["figures"]
        losses = [100 * frame["dists_baseline"] for frame in points[name]["workloads"].values()]
        saved = [1 - own[f"{key}.{library}"] / base[f"{key}.{library}"] for key in ("nj", "mw", "array_kge")]
        shares = (f"{100 * share:.1f} %" for share in saved)
        rows.append(["Colonnade, ASAP7", name, *shares, f"{min(losses):.4f} to {max(losses):.4f} %"])
    return markdown(["", "design", "energy per ray saved", "power saved", "area saved", "DISTS loss of a frame"], rows)


def trade(name: str, data: Data) -> str:
    """Error, rate, area and energy of each design of a study; bold: on the front."""
    study = data.result(name)
    (library,) = study["libraries"]
    key = f"energy_area.{library}"
    base = next(point for point in study["points"] if point["name"] == study["baseline"])["figures"][key]
    rows = []
    for point in study["points"]:
        own = point["figures"]
        rows.append(
            [
                f"**{point['name']}**" if point["on_front"] else point["name"],
                number(own["psnr_min"], ".1f"),
                number(own["rays_per_cycle"], ".2f"),
                number(own[f"array_kge.{library}"], ".2f", 1e-3),
                number(own[f"nj.{library}"], ".3f"),
                number(own[f"area_per_rate.{library}"], ",.0f"),
                "–" if own[key] is None or base is None else f"{100 * (own[key] / base - 1):+.1f} %",
            ]
        )
    titles = ["design", "PSNR to Embree, lowest, dB", "rays per cycle, bunny", "array, MGE", "nJ per ray"]
    return markdown([*titles, "kGE·cycle/ray", f"energy × area ÷ rate, to `{study['baseline']}`"], rows)


def _best(study: Study) -> str | None:
    """The design of the lowest RenderIndex."""
    rows = study["render_index"]["rows"]
    return min(rows, key=lambda row: float(row["index"]))["name"] if rows else None


def number(value: float | None, form: str, scale: float = 1.0) -> str:
    """The scaled value as text; a dash without one."""
    return "–" if value is None else format(value * scale, form)


TABLES: Mapping[str, Callable[[Data], str]] = {
    "precision": precision,
    "savings": savings,
    **{name: partial(trade, name) for name in ("energy-area", "vertices-contexts")},
}
