"""The tables of ``docs/energy-area.md``, from ``study.json`` of ``scenes/studies/energy-area.toml``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from colonnade.lab.common.markdown import markdown
from colonnade.lab.explore.precision_tables import LIBRARIES, number

Data = Mapping[str, Any]


def designs(study: Data) -> str:
    """Each design once, the least energy times area per rate first; bold: on the front."""
    library = study["libraries"][0]
    key = f"energy_area.{library}"
    points = {point["config_hash"]: point for point in reversed(study["points"])}
    base = next(point for point in study["points"] if point["name"] == study["baseline"])
    rows = []
    for point in sorted(points.values(), key=lambda point: point["figures"][key] or float("inf")):
        own = point["figures"]
        if point is not base and own == base["figures"]:
            continue  # the baseline again, with a null written out
        name = point["name"] if point is base else _changes(point, base)
        rows.append(
            [
                f"**{name}**" if point["on_front"] else name,
                number(own["psnr_min"], ".1f"),
                number(own["dists"], ".4f"),
                number(own["rays_per_cycle"], ".2f"),
                number(own[f"array_kge.{library}"], ".1f", 1e-3),
                number(own[f"nj.{library}"], ".3f"),
                number(own[f"area_per_rate.{library}"], ",.0f"),
                number(own[key], ",.0f"),
                "–" if own[key] is None else f"{100 * (own[key] / base['figures'][key] - 1):+.0f} %",
            ]
        )
    titles = ["design", "PSNR to Embree, lowest, dB", "DISTS, mean", "rays per cycle", "array, MGE", "nJ per ray"]
    titles += ["kGE·cycle/ray", "nJ·kGE·cycle/ray²", f"against {base['name']}"]
    return markdown(titles, rows)


def search(study: Data) -> str:
    """How many designs were evaluated, and how many the grid has."""
    done = study["search"]
    rows = [
        ["designs evaluated", f"{done['evaluations']:,}"],
        ["designs of the grid", f"{done['grid']:,}"],
        ["fields", f"{len(study['axes'])}"],
        ["designs on the front", f"{len(study['front']['points'])}"],
        ["library", LIBRARIES.get(study["libraries"][0], study["libraries"][0])],
    ]
    return markdown(["search", ""], rows)


def _changes(point: Data, base: Data) -> str:
    """The axes in which a point differs from another one, without the groups of the fields."""
    own, other = point["config_values"], base["config_values"]
    return ", ".join(
        str(value) if key == "precision" else f"{key.rpartition('.')[2]} {value}"
        for key, value in point["values"].items()
        if _field(own, key) != _field(other, key)
    )


def _field(config: Data, key: str) -> Any:
    group, _, field = key.rpartition(".")
    return (config[group] if group else config)[field]


#: The tables of the page.
TABLES: Mapping[str, Callable[[Data], str]] = {"search": search, "designs": designs}
