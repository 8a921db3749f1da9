"""The studies of the page: designs with their error, energy, area and rate, as docs/data has them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from colonnade.common.progress import for_terminal
from colonnade.design.generator import manifest_for

ROOT = Path(__file__).resolve().parents[2]
STUDIES = ("mixed-precision", "vertices-contexts", "energy-area")
#: Sliders: the study of their points, and the field of the configuration that alone changes from one to the next.
SLIDERS = {
    "precision": ("mixed-precision", "precision"),
    "vertexBits": ("vertices-contexts", "geometry.vertexBits"),
    "contexts": ("vertices-contexts", "array.contexts"),
}
#: Of each point the page shows these, if the study has them.
FIGURES = ("psnr_min", "psnr_mean", "rays_per_cycle", "nj_28nm.asap7", "array_mm2.asap7", "fo4.asap7")


def studies(presets: Mapping[str, Any]) -> tuple[dict[str, Any], list[dict[str, Any]], dict[str, Any]]:
    """Manifests of designs that are no presets; of each study title, command, columns and points; sliders by name.

    Args:
        presets: Manifests of presets, by name.
    """
    manifests: dict[str, Any] = {}
    results: dict[str, Any] = {}
    found = []
    for name in STUDIES:
        file = json.loads((ROOT / "docs" / "data" / f"{name}.json").read_text(encoding="utf-8"))
        result = results[name] = file["result"]
        columns = [column for column in result["columns"] if column["key"] in FIGURES]
        points = []
        for point in result["points"]:
            design = point["name"]
            if design not in presets and design not in manifests:
                manifest = manifest_for("edge", point["overrides"], for_terminal()).dir / "manifest.json"
                manifests[design] = json.loads(manifest.read_text(encoding="utf-8"))
            figures = {column["key"]: point["figures"].get(column["key"]) for column in columns}
            points.append({"design": design, "figures": figures})
        kept = ("key", "label", "unit", "format")
        found.append(
            {
                "title": result["title"],
                "command": file["command"][0],
                "columns": [{key: column[key] for key in kept} for column in columns],
                "points": points,
            }
        )
    return manifests, found, {name: _slider(results[study], key) for name, (study, key) in SLIDERS.items()}


def _slider(result: Mapping[str, Any], key: str) -> list[dict[str, Any]]:
    """The designs of a study that differ in one field alone, by its values."""
    section, _, field = key.rpartition(".")
    points = [
        {"design": point["name"], "value": point["values"].get(key) or point["config_values"][section][field]}
        for point in result["points"]
        if set(point["values"]) <= {key}
    ]
    return sorted(points, key=lambda point: point["value"])
