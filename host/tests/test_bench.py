"""What `colonnade bench` makes of the reports of its frames."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from colonnade import bench

CONFIG = {"array": {"rows": 2, "columns": 3}, "columnBvhMemory": {"banks": 2}}


def report(cycles: int, in_box: float) -> dict[str, Any]:
    counters = {"busyRaySetup": 60, "busyBoxUnit": 480, "busyTriangleUnit": 120, "busyShader": 6, "recordReads": 60}
    return {
        "mesh": {"triangles": 12},
        "cycles": cycles,
        "counters": counters,
        "rays_per_cycle": 2 * in_box,
        "rays_per_cycle_in_box": in_box,
    }


def test_utilisation_is_a_share_of_all_units_of_a_kind() -> None:
    use = bench.utilisation(report(100, 1.0), CONFIG)
    assert use == pytest.approx(
        {"ray set-up": 0.1, "box unit": 0.8, "triangle unit": 0.2, "shader": 0.01, "memory banks": 0.1}
    )


def test_geometric_mean() -> None:
    assert bench.geometric_mean([1.0, 4.0]) == pytest.approx(2.0)
    assert bench.geometric_mean([1.0, 0.0]) == 0.0
    assert bench.geometric_mean([]) == 0.0


def test_report_of_all_meshes(monkeypatch: pytest.MonkeyPatch) -> None:
    in_box = {"cube": 1.0, "torus": 4.0}
    manifest = SimpleNamespace(config=CONFIG)
    monkeypatch.setattr(bench, "manifest_for", lambda *_: SimpleNamespace(manifest=manifest))
    monkeypatch.setattr(bench, "render", lambda *_, mesh, **__: SimpleNamespace(report=report(100, in_box[mesh])))
    seen: list[str] = []
    result = bench.bench(Path("s.toml"), "tiny", meshes=("cube", "torus"), finished=lambda name, _: seen.append(name))
    assert seen == ["cube", "torus"]
    assert result["geomean_rays_per_cycle_in_box"] == pytest.approx(2.0)
    assert result["geomean_rays_per_cycle"] == pytest.approx(4.0)
    assert result["ratio_to_paper"] == pytest.approx(2.0 / 0.208)
    assert result["meshes"]["cube"]["bottleneck"] == "box unit"
