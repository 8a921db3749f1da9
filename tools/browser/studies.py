"""The studies of the page: designs with their error, energy, area and rate, as docs/data has them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from colonnade.common.progress import for_terminal
from colonnade.design.generator import manifest_for

ROOT = Path(__file__).resolve().parents[2]
STUDIES = ("mixed-precision", "energy-area")
#: Of each point the page shows these, if the study has them.
FIGURES = ("psnr_min", "psnr_mean", "rays_per_cycle", "nj_28nm.asap7", "array_mm2.asap7", "fo4.asap7")


def studies(presets: Mapping[str, Any]) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """The manifests of designs that are no presets, and for each study its title, command, columns and points.

    Args:
        presets: Manifests of presets, by name.
    """
    manifests: dict[str, Any] = {}
    found = []
    for name in STUDIES:
        file = json.loads((ROOT / "docs" / "data" / f"{name}.json").read_text(encoding="utf-8"))
        result = file["result"]
        columns = [column for column in result["columns"] if column["key"] in FIGURES]
        points = []
        for point in result["points"]:
            design = point["name"]
            if design not in presets:
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
    return manifests, found
