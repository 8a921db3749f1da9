"""The tables of the eight precisions in ``docs/paper.md``: loss and cost, RenderIndex by each norm, savings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from colonnade_lab.common import paper
from colonnade_lab.common.markdown import markdown
from colonnade_lab.explore.render_index import PRINTED, indices
from colonnade_lab.figures.data import Data
from colonnade_lab.figures.study_tables import number

Study = Mapping[str, Any]

#: The paper's savings, and its DISTS loss.
_SAVED = (f"{100 * saved:.1f}" for saved in (paper.POWER_SAVED, paper.AREA_SAVED))
_LOSS = " to ".join(f"{100 * loss:g}" for loss in paper.LOSS)
PAPER = ("source paper, 28 nm", paper.PRECISION, "–", *_SAVED, _LOSS)


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
    rows = [
        [
            _marked(point["name"], study),
            *(number(point["figures"][key], form, scale) for key, form, scale in columns),
        ]
        for point in study["points"]
    ]
    titles = ["design", "mean loss, %", "largest, %", "lowest PSNR, dB", "array, MGE", "FO4"]
    return markdown([*titles, "mW", "nJ", "RenderIndex"], rows)


def savings(data: Data) -> str:
    """What the best precision and the paper's choice save against the baseline, beside the paper."""
    study = data.result("mixed-precision")
    points = {point["name"]: point for point in study["points"]}
    rows: list[Sequence[str]] = [PAPER]
    for name in {_best(study) or paper.PRECISION: None, paper.PRECISION: None}:
        losses = [100 * frame["dists_baseline"] for frame in points[name]["workloads"].values()]
        shares = (saved(data, name, key) for key in ("nj", "mw", "array_kge"))
        rows.append(["Colonnade, ASAP7", name, *shares, f"{min(losses):.4f} to {max(losses):.4f}"])
    return markdown(["saved, %", "design", "energy per ray", "power", "area", "DISTS loss, %"], rows)


def saved(data: Data, name: str, figure: str) -> str:
    """What a precision saves of a figure of its library against the baseline, %."""
    return f"{100 * (1 - relative(data, figure)[name]):.1f}"


def relative(data: Data, figure: str) -> dict[str, float]:
    """A figure of the library of each precision, relative to the baseline's."""
    study = data.result("mixed-precision")
    (library,) = study["libraries"]
    values = {point["name"]: point["figures"][f"{figure}.{library}"] for point in study["points"]}
    return {name: value / values[study["baseline"]] for name, value in values.items()}


def printed_index(data: Data) -> dict[str, float]:
    """The RenderIndex of each precision with the paper's terms, the lowest first."""
    found = _indices(data.result("mixed-precision"))[PRINTED]
    return dict(sorted(found.items(), key=lambda item: item[1]))


def lowest_psnr(data: Data, name: str) -> str:
    """The lowest PSNR of a precision's pictures, dB."""
    (figures,) = (p["figures"] for p in data.result("mixed-precision")["points"] if p["name"] == name)
    return f"{figures['psnr_min']:.1f}"


def _indices(study: Study) -> dict[str, dict[str, float]]:
    (library,) = study["libraries"]
    return indices(study["points"], study["baseline"], library)


def render_index(data: Data) -> str:
    """The RenderIndex of each precision by each choice of Norm, as printed first; bold: the lowest of a choice."""
    study = data.result("mixed-precision")
    choices = _indices(study)
    choices = {PRINTED: choices[PRINTED], **choices}
    rows = []
    for point in study["points"]:
        cells = []
        for found in choices.values():
            value = found.get(point["name"])
            text = number(value, "#.3g")
            cells.append(f"**{text}**" if value is not None and value == min(found.values()) else text)
        rows.append([_marked(point["name"], study), *cells])
    return markdown(["design", *choices], rows)


def _marked(name: str, study: Study) -> str:
    """The name of a design; the best one is bold, the paper's choice is called so."""
    text = f"**{name}**" if name == _best(study) else name
    return f"{text} (paper)" if name == paper.PRECISION else text


def _best(study: Study) -> str | None:
    """The design of the lowest RenderIndex."""
    rows = study["render_index"]["rows"]
    return min(rows, key=lambda row: float(row["index"]))["name"] if rows else None


TABLES: Mapping[str, Callable[[Data], str]] = {
    "precision": precision,
    "render-index": render_index,
    "savings": savings,
}
