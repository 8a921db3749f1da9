"""The tables of the report besides the one of all points. Cells are texts; the template escapes them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from colonnade_lab.report.explorer.rows import index_order
from colonnade_lab.report.explorer.study import MISSING, Study, is_number, text_of


@dataclass(frozen=True)
class Table:
    """A table of texts. The first ``names`` columns are not numbers."""

    titles: list[str]
    rows: list[list[str]]
    names: int


@dataclass(frozen=True)
class Ranks:
    """How the ranking of the points depends on a choice, for one library.

    Attributes:
        library: The library.
        choices: The choices; the first is the definition of the study.
        rows: Each point with its rank by each choice, the first choice's best point first; None without a rank.
    """

    library: str
    choices: list[str]
    rows: list[tuple[str, list[int | None]]]


_AREA = {
    "traversal_unit_kge": ("traversal unit, kGE", ".1f"),
    "logic_kge": ("all logic, kGE", ",.0f"),
    "array_kge": ("array, kGE", ",.0f"),
    "mm2_28nm": ("area at 28 nm, mm²", ".3f"),
    "slowest_path_ns": ("slowest path, ns", ".2f"),
    "slowest_path_fo4": ("slowest path, FO4", ".1f"),
    "slowest_path_unit": ("in unit", None),
}

_POWER = {
    "mw": ("power, mW", ".2f"),
    "mw_28nm": ("power at 28 nm, mW", ".2f"),
    "nj_per_ray": ("energy per ray, nJ", ".3f"),
    "nj_per_ray_28nm": ("energy per ray at 28 nm, nJ", ".3f"),
    "rays_in_box": ("in-box rays", ",.0f"),
    "cycles": ("cycles", ",.0f"),
    "clock_mhz": ("clock, MHz", ".0f"),
}

_CYCLES = {
    "cycles": ("cycles", ",.0f"),
    "rtl_cycles": ("of the RTL", ",.0f"),
    "rays_per_cycle_in_box": ("in-box rays per cycle", ".3f"),
    "bottleneck": ("bottleneck", None),
}

_INDEX = {
    "loss": ("loss", ".4g"),
    "norm_loss": ("norm of loss", ".4g"),
    "norm_power": ("norm of power", ".4g"),
    "norm_area": ("norm of area", ".4g"),
    "index": ("RenderIndex", ".4g"),
}

Formats = Mapping[str, tuple[str, str | None]]


def area_table(study: Study) -> Table | None:
    """Area and slowest path of each point and library."""
    rows = [
        ([point["name"], library], area) for point in study["points"] for library, area in point["area"].items() if area
    ]
    return _table(["point", "library"], rows, _AREA)


def power_table(study: Study) -> Table | None:
    """Power and energy per ray of each point, library and workload."""
    rows = [
        ([point["name"], library, workload], power)
        for point in study["points"]
        for library, by_workload in point["power"].items()
        for workload, power in by_workload.items()
        if power
    ]
    return _table(["point", "library", "workload"], rows, _POWER)


def cycles_table(study: Study) -> Table | None:
    """Cycles and bottleneck of each point and workload."""
    rows = [
        ([point["name"], workload], figures)
        for point in study["points"]
        for workload, figures in point["workloads"].items()
        if is_number(figures.get("cycles"))
    ]
    return _table(["point", "workload"], rows, _CYCLES)


def index_table(study: Study) -> Table | None:
    """The RenderIndex of each point and library, with its factors."""
    if not study["render_index"]:
        return None
    order = {name: position for position, name in enumerate(index_order(study))}
    rows = sorted(study["render_index"]["rows"], key=lambda row: order.get(row["name"], len(order)))
    return _table(["point", "library"], [([row["name"], row["library"]], row) for row in rows], _INDEX)


def rank_tables(study: Study) -> list[Ranks]:
    """The ranks by each choice of a norm, a table for each library."""
    sensitivity = (study["render_index"] or {}).get("sensitivity") or []
    tables = []
    for library in dict.fromkeys(each["library"] for each in sensitivity):
        rankings = {each["choice"]: each["ranking"] for each in sensitivity if each["library"] == library}
        names = dict.fromkeys(name for ranking in rankings.values() for name in ranking)
        rows = [(name, [_rank(ranking, name) for ranking in rankings.values()]) for name in names]
        tables.append(Ranks(library, list(rankings), rows))
    return tables


def workload_figures(figures: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Label and text of each measured figure of a point and a workload."""
    known = {
        "psnr": ("PSNR", "{:.1f} dB"),
        "ssim": ("SSIM", "{:.4f}"),
        "flip": ("FLIP", "{:.4f}"),
        "dists": ("DISTS", "{:.4f}"),
        "psnr_baseline": ("PSNR against the baseline", "{:.1f} dB"),
        "flip_baseline": ("FLIP against the baseline", "{:.4f}"),
        "dists_baseline": ("DISTS against the baseline", "{:.4f}"),
        "rays_per_cycle_in_box": ("in-box rays per cycle", "{:.3f}"),
        "cycles": ("cycles", "{:,.0f}"),
        "rtl_cycles": ("cycles of the RTL", "{:,.0f}"),
    }
    found = [(label, form.format(figures[key])) for key, (label, form) in known.items() if is_number(figures.get(key))]
    errors = figures.get("error_bits") or []
    return [*found, ("error bits", ", ".join(errors))] if errors else found


def _rank(ranking: Sequence[str], name: str) -> int | None:
    return ranking.index(name) + 1 if name in ranking else None


def _table(names: list[str], rows: list[tuple[list[str], Mapping[str, Any]]], formats: Formats) -> Table | None:
    """A table of the figures that any of the rows has; None without rows."""
    used = {key: form for key, form in formats.items() if any(figures.get(key) is not None for _, figures in rows)}
    if not rows or not used:
        return None
    cells = [
        [*head, *(text_of(figures.get(key), form) or MISSING for key, (_, form) in used.items())]
        for head, figures in rows
    ]
    return Table([*names, *(title for title, _ in used.values())], cells, len(names))
