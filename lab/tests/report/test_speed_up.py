"""The plot of the speed-up by a tree."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from colonnade_lab.report.speed_up import plot_speed_up, reductions


def study() -> dict[str, Any]:
    """Two meshes, reduced twice, without a tree and with one that takes the same cycles for all meshes."""
    sizes = {"a, 50": 40, "b, 50": 10, "a, 500": 400, "b, 500": 100}
    points = [
        {"name": name, "workloads": {frame: {"cycles": cycles(size)} for frame, size in sizes.items()}}
        for name, cycles in (("BVH4", lambda size: 5), ("none", lambda size: size))
    ]
    return {"workloads": [{"name": name, "triangles": size} for name, size in sizes.items()], "points": points}


def test_the_speed_up_is_that_of_the_mean_cycles_and_is_drawn(tmp_path: Path) -> None:
    found = reductions(study())
    assert [(each.maximum, each.triangles) for each in found] == [(50, pytest.approx(20)), (500, pytest.approx(200))]
    assert [each.speed_up("BVH4") for each in found] == [pytest.approx(4), pytest.approx(40)]
    plot_speed_up(study(), tmp_path / "plot.png")
    with Image.open(tmp_path / "plot.png") as picture:
        assert picture.size[0] >= 500
