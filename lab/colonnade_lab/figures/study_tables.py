"""Tables of studies: energy and area, vertex bits and contexts, what features cost, instances."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from colonnade_lab.common.markdown import markdown
from colonnade_lab.figures.data import Data


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


def features(data: Data) -> str:
    """Area of `edge` with and without features, and its rate of objects that do not use them."""
    study = data.result("features")
    (library,) = study["libraries"]
    area, a_rate = f"array_kge.{library}", f"area_per_rate.{library}"
    base = study["points"][0]["figures"]
    rows = []
    for point in study["points"]:
        own = point["figures"]
        more = [f"{100 * (own[key] / base[key] - 1):+.1f} %" for key in (area, a_rate)]
        rows.append([point["name"], number(own[area], ",.0f"), more[0], number(own["rays_per_cycle"], ".2f"), more[1]])
    return markdown(["design", "array, kGE", "to `edge`", "rays per cycle", "area ÷ rate, to `edge`"], rows)


def instances(data: Data) -> str:
    """Cycles of `edge` for objects as one mesh and as instances."""
    one, many = (point["workloads"] for point in data.result("instances")["points"])
    rows = []
    for scene in one:
        before, after = one[scene]["cycles"], many[scene]["cycles"]
        rows.append([f"`{scene}`", f"{before:,}", f"{after:,}", f"{100 * (after / before - 1):+.1f} %"])
    return markdown(["objects", "cycles, one mesh", "instances", "more"], rows)


def number(value: float | None, form: str, scale: float = 1.0) -> str:
    """The scaled value as text; a dash without one."""
    return "–" if value is None else format(value * scale, form)


TABLES: Mapping[str, Callable[[Data], str]] = {
    "energy-area": partial(trade, "energy-area"),
    "vertices-contexts": partial(trade, "vertices-contexts"),
    "features": features,
    "instances": instances,
}
