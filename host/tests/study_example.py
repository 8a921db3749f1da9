"""Synthetic studies for tests of the report of ``colonnade explore``: ``study.json`` and small pictures."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

LIBRARIES = ("asap7", "sky130")
WORKLOADS = {"teapot": 6320, "bunny": 69451, "dragon": 86482}
PRECISIONS = ("16b16s32d", "24b24s24d", "24b24s32d", "24b24s64d", "32b32s32d", "32b32s64d", "64b64s64d")
BASELINE = PRECISIONS[-1]

#: Text that must not become markup, end a script, or break a string.
HOSTILE = "<script>alert(1)</script> \"'`${x}` </script><!-- <img src=x onerror=alert(1)> {{ 7*7 }} & \u2028 \\"

_UTILISATION = {
    "ray set-up": 0.72,
    "box unit": 0.66,
    "triangle unit": 0.41,
    "shader": 0.2,
    "memory banks": 0.35,
    "pixel streams": 0.06,
}
_STALLS = {
    "idle": 0.08,
    "ray set-up": 0.2,
    "record stall": 0.11,
    "unit stall": 0.17,
    "box unit and stack": 0.24,
    "triangle unit": 0.12,
    "shader": 0.05,
    "completion": 0.03,
}
_UNITS = {
    "BoxUnit": ("traversal_unit", 45.2),
    "TriangleUnit": ("traversal_unit", 92.0),
    "Shader": ("traversal_unit", 61.0),
    "RaySetup": ("traversal_unit", 38.5),
    "RayGenerator": ("traversal_unit", 12.1),
    "HitTable": ("traversal_unit", 14.9),
    "RecordFetch": ("traversal_unit", 20.6),
    "TraversalStack": ("traversal_unit", 9.3),
    "BounceUnit": ("traversal_unit", 17.7),
    "ColourUnit": ("traversal_unit", 8.8),
    "RtController": ("traversal_unit", 6.1),
    "TMaxUnits": ("traversal_unit", 4.0),
    "CosineUnit": ("traversal_unit", 3.1),
    "ColumnBvhController": ("column", 31.0),
    "TileWalker": ("column", 5.5),
    "PixelCollector": ("column", 3.5),
    "FrameController": ("array", 9.0),
    "CounterFile": ("array", 14.0),
}


def column(key: str, label: str, unit: str, better: str | None, form: str = ".1f") -> dict[str, Any]:
    """A column of the table."""
    return {
        "key": key,
        "label": label,
        "unit": unit,
        "better": better,
        "format": form,
        "what": f"{label} of a point.",
    }


def study(folder: Path, change: Callable[[dict[str, Any]], None] | None = None) -> dict[str, Any]:
    """Write a study of seven precisions, three workloads and two libraries into `folder`; returns its content.

    One power estimate of the narrowest point failed. `change` alters the content before it is written.
    """
    content = _content()
    if change is not None:
        change(content)
    (folder / "pictures").mkdir(parents=True, exist_ok=True)
    for workload in content["workloads"]:
        if workload["reference"]:
            write_picture(folder / workload["reference"], 64.0)
    for point in content["points"]:
        for figures in point["workloads"].values():
            if figures.get("picture"):
                write_picture(folder / figures["picture"], _bits(point))
    (folder / "study.json").write_text(json.dumps(content, indent=2))
    return content


def write_picture(path: Path, bits: float, width: int = 96, height: int = 72) -> None:
    """A shaded ball on a gradient; fewer bits give coarser steps."""
    y, x = np.mgrid[0:height, 0:width] / height - 0.5
    x -= 0.5 * (width / height - 1)
    z = np.sqrt(np.maximum(0.16 - x * x - y * y, 0.0))
    light = np.clip((x * -0.4 - y * 0.6 + z) / 0.45, 0.05, 1.0)
    steps = 2.0 ** min(bits / 4, 8)
    ball = np.round(light * steps) / steps
    colour = np.stack([ball * 0.9, ball * 0.6, ball * 0.35], -1)
    sky = np.stack([0.55 + 0.2 * y, 0.65 + 0.2 * y, 0.8 + 0.1 * y], -1)
    picture = np.where((z > 0)[..., None], colour, sky)
    Image.fromarray(np.uint8(np.clip(picture, 0, 1) * 255)).save(path)


def cycles_only(content: dict[str, Any]) -> None:
    """Leave only cycles: no libraries, quality, pictures, front or index."""
    kept = {"rays_per_cycle"}
    content["columns"] = [each for each in content["columns"] if each["key"] in kept]
    content.update(libraries=[], front=None, render_index=None, search=None, baseline=None)
    for workload in content["workloads"]:
        workload["reference"] = None
    for point in content["points"]:
        point.update(area={}, power={}, failures=[], on_front=False)
        point["figures"] = {key: point["figures"][key] for key in kept}
        for figures in point["workloads"].values():
            figures["picture"] = None
            for key in ("psnr", "ssim", "flip", "dists", "psnr_baseline", "flip_baseline", "dists_baseline"):
                figures[key] = None


def without_area(content: dict[str, Any]) -> None:
    """Leave out area, power and what follows from them."""
    content.update(libraries=[], render_index=None, search=None)
    content["columns"] = [each for each in content["columns"] if "." not in each["key"]]
    content["front"] = {"objectives": ["dists_loss", "rays_per_cycle"], "points": content["front"]["points"]}
    for point in content["points"]:
        point.update(area={}, power={}, failures=[])
        point["figures"] = {key: value for key, value in point["figures"].items() if "." not in key}


def hostile(content: dict[str, Any]) -> None:
    """Put text with markup into every text of the study that can hold any."""
    renamed = {BASELINE: f"{HOSTILE} point"}

    def name(text: str) -> str:
        return renamed.get(text, text)

    content.update(title=HOSTILE, description=HOSTILE, command=HOSTILE, commit=HOSTILE)
    content["baseline"] = name(content["baseline"])
    content["axes"][0] = HOSTILE
    for each in content["columns"]:
        each.update(label=f"{each['label']} {HOSTILE}", what=HOSTILE, unit="</td>")
    content["workloads"][0].update(name=f"{HOSTILE} workload", mesh=HOSTILE, scene=HOSTILE)
    content["front"]["points"] = [name(each) for each in content["front"]["points"]]
    content["render_index"]["definition"] = HOSTILE
    for row in content["render_index"]["rows"]:
        row["name"] = name(row["name"])
    for each in content["render_index"]["sensitivity"]:
        each.update(choice=f"{each['choice']} {HOSTILE}", ranking=[name(one) for one in each["ranking"]])
    content["search"]["method"] = HOSTILE
    for point in content["points"]:
        point["name"] = name(point["name"])
        point["values"][HOSTILE] = point["values"].pop("precision")
        point["overrides"] = [HOSTILE]
        point["workloads"][f"{HOSTILE} workload"] = point["workloads"].pop("teapot")
        for area in point["area"].values():
            area["units"][f"{HOSTILE} unit"] = area["units"].pop("BoxUnit")
        for failure in point["failures"]:
            failure.update(measure=HOSTILE, reason=HOSTILE)


def _content() -> dict[str, Any]:
    points = [_point(position, precision) for position, precision in enumerate(PRECISIONS)]
    front = ["16b16s32d", "24b24s32d", "32b32s64d"]
    for point in points:
        point["on_front"] = point["name"] in front
    points[0]["failures"] = [
        {"measure": "power", "workload": "dragon", "library": "sky130", "reason": "the netlist's frame ran too long"}
    ]
    points[0]["figures"]["nj.sky130"] = None
    columns = [
        column("psnr_min", "PSNR, lowest", "dB", "higher"),
        column("dists_loss", "DISTS loss", "%", "lower", ".3f"),
        column("flip_max", "FLIP, highest", "", "lower", ".4f"),
        column("rays_per_cycle", "in-box rays per cycle", "", "higher", ".2f"),
    ]
    for library in LIBRARIES:
        columns += [
            column(f"kge.{library}", f"area, {library}", "kGE", "lower"),
            column(f"mw.{library}", f"power, {library}", "mW", "lower", ".2f"),
            column(f"nj.{library}", f"energy per ray, {library}", "nJ", "lower", ".3f"),
            column(f"index.{library}", f"RenderIndex, {library}", "", None, ".3f"),
        ]
    return {
        "version": 1,
        "title": "Mixed precision",
        "description": "Seven precisions of the edge array, on three meshes: picture, power and area.",
        "command": "colonnade explore scenes/studies/mixed-precision.toml --output out/mixed",
        "commit": "b74281a0c0ffee",
        "is_modified": False,
        "package": "0.1.0",
        "axes": ["precision", "geometry.triangleBits"],
        "columns": columns,
        "libraries": list(LIBRARIES),
        "workloads": [
            {
                "name": name,
                "mesh": name,
                "scene": "benchmark.toml",
                "triangles": triangles,
                "reference": f"pictures/reference--{name}.png",
            }
            for name, triangles in WORKLOADS.items()
        ],
        "baseline": BASELINE,
        "points": points,
        "front": {"objectives": ["dists_loss", "nj.asap7", "kge.asap7"], "points": front},
        "render_index": _render_index(points),
        "search": {"method": "NSGA-II", "evaluations": 24, "grid": 3456, "seed": 1, "history": []},
        "jobs": {"run": 40, "cached": 24, "failed": 1, "seconds": 812.0},
    }


def _bits(point: dict[str, Any]) -> float:
    """Multiply-accumulate bits of a point, by its number: names may be changed."""
    return float(PRECISIONS[int(point["config_hash"], 16)][:2])


def _point(position: int, precision: str) -> dict[str, Any]:
    mac, divider = int(precision[:2]), int(precision[6:8])
    scale = 0.35 + 0.55 * mac / 64 + 0.1 * divider / 64
    loss = 100 * math.exp(-mac / 5)
    figures: dict[str, Any] = {
        "psnr_min": min(67.0, 14.0 + 1.3 * mac + 0.02 * divider),
        "dists_loss": loss,
        "flip_max": loss / 400,
        "rays_per_cycle": 2.9 - 0.01 * position,
    }
    for library, factor in zip(LIBRARIES, (1.0, 1.25), strict=True):
        figures |= {
            f"kge.{library}": 400.0 * scale * factor,
            f"mw.{library}": 61.0 * scale**1.4 * factor,
            f"nj.{library}": 0.104 * scale**1.4 * factor,
            f"index.{library}": (1 + loss) * scale**2.4,
        }
    return {
        "name": precision,
        "values": {"precision": precision, "geometry.triangleBits": mac if mac < 32 else None},
        "config": "edge",
        "overrides": [f"precision={precision}"],
        "config_hash": f"{position:064x}",
        "figures": figures,
        "workloads": {name: _workload(precision, name, figures, step) for step, name in enumerate(WORKLOADS)},
        "area": {library: _area(scale * factor) for library, factor in zip(LIBRARIES, (1.0, 1.25), strict=True)},
        "power": {
            library: {"teapot": _power(figures[f"mw.{library}"], figures[f"nj.{library}"])} for library in LIBRARIES
        },
        "failures": [],
        "on_front": False,
    }


def _workload(precision: str, name: str, figures: dict[str, Any], step: int) -> dict[str, Any]:
    idle = 0.02 * step
    return {
        "psnr": figures["psnr_min"] + step,
        "ssim": 0.999,
        "flip": figures["flip_max"],
        "dists": figures["dists_loss"] / 1000,
        "psnr_baseline": figures["psnr_min"] + 6,
        "flip_baseline": figures["flip_max"] / 2,
        "dists_baseline": figures["dists_loss"] / 1000,
        "picture": f"pictures/{precision}--{name}.png",
        "error_bits": [],
        "cycles": 131_000 + 9_000 * step,
        "rays_per_cycle_in_box": figures["rays_per_cycle"],
        "bottleneck": "ray set-up",
        "utilisation": {unit: max(share - idle, 0.01) for unit, share in _UTILISATION.items()},
        "stalls": _STALLS | {"idle": _STALLS["idle"] + idle, "unit stall": _STALLS["unit stall"] - idle},
    }


def _area(scale: float) -> dict[str, Any]:
    units = {
        name: {"level": level, "kge": size * scale, "power_mw": 0.02 * size * scale}
        for name, (level, size) in _UNITS.items()
    }
    traversal_unit = sum(unit["kge"] for unit in units.values() if unit["level"] == "traversal_unit")
    return {
        "units": units,
        "traversal_unit_kge": traversal_unit,
        "logic_kge": 80 * traversal_unit,
        "array_kge": 80 * traversal_unit + 2000,
        "mm2_28nm": 0.08 * traversal_unit,
        "slowest_path_ns": 1.9 + scale,
        "slowest_path_fo4": 55 + 20 * scale,
        "slowest_path_unit": "BoxUnit",
    }


def _power(mw: float, nj: float) -> dict[str, Any]:
    return {
        "mw": mw,
        "mw_28nm": 1.7 * mw,
        "nj_per_ray": nj,
        "nj_per_ray_28nm": 1.7 * nj,
        "cycles": 4000,
        "rays_in_box": 5210,
        "clock_mhz": 200,
    }


def _render_index(points: list[dict[str, Any]]) -> dict[str, Any]:
    last = points[-1]["figures"]
    rows = []
    for library in LIBRARIES:
        for point in points:
            figures = point["figures"]
            norms = {
                "norm_loss": 1 + figures["dists_loss"] / 0.5,
                "norm_power": figures[f"mw.{library}"] / last[f"mw.{library}"],
                "norm_area": figures[f"kge.{library}"] / last[f"kge.{library}"],
            }
            index = math.prod(norms.values())
            rows.append(
                {"name": point["name"], "library": library, "loss": figures["dists_loss"], **norms, "index": index}
            )
    sensitivity = []
    for library in LIBRARIES:
        own = [row for row in rows if row["library"] == library]
        for choice, weight in (("1 + loss / 0.5 %", 0.5), ("1 + loss / 0.1 %", 0.1), ("1 + loss / 5 %", 5.0)):
            ranked = sorted(own, key=lambda row: (1 + row["loss"] / weight) * row["norm_power"] * row["norm_area"])
            sensitivity.append({"choice": choice, "library": library, "ranking": [row["name"] for row in ranked]})
    definition = (
        "RenderIndex = (1 + loss / 0.5 %) × power / baseline's power × area / baseline's area. A lower index is better."
    )
    return {"library": "asap7", "definition": definition, "scale": 0.005, "rows": rows, "sensitivity": sensitivity}
