"""The plot of a study over its fields."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from colonnade_lab.report.fields import _panels_of_workloads, _panels_one_by_one, plot_fields

AXES = {"array.rows": [1, 16], "array.columns": [4, 8]}


def study(axes: dict[str, list[Any]], points: list[dict[str, Any]]) -> dict[str, Any]:
    """A study of two meshes at a base of 10×8 with `points` beside it, each named by the values of its fields."""

    def point(values: dict[str, Any]) -> dict[str, Any]:
        array = {"rows": 10, "columns": 8, "contexts": 12}
        workloads = {mesh: {"rays_per_cycle_in_box": 1.0 + len(values)} for mesh in ("bunny", "teapot")}
        return {"values": values, "config_values": {"array": array}, "workloads": workloads}

    return {"axes": list(axes), "points": [point(each) for each in ({}, *points)], "workloads": [{"size": [64, 48]}]}


ONE_BY_ONE = study(AXES, [{key: value} for key, values in AXES.items() for value in values])
GRID_AXES = {"array.contexts": [4, 12], "columnBvhMemory.snooping": [False, True], "columnBvhMemory.banks": [1, 2]}
GRID = study(GRID_AXES, [dict(zip(GRID_AXES, values, strict=True)) for values in product(*GRID_AXES.values())])


@pytest.mark.parametrize("content", [ONE_BY_ONE, GRID])
def test_plot_is_a_picture(tmp_path: Path, content: dict[str, Any]) -> None:
    plot_fields(content, tmp_path / "plot.png")
    with Image.open(tmp_path / "plot.png") as picture:
        assert picture.size[0] >= 500


def test_fields_one_by_one_have_the_base_among_their_values() -> None:
    panels = _panels_one_by_one(ONE_BY_ONE)
    assert [(panel.title, panel.base) for panel in panels] == [("rows", 10), ("columns", 8)]
    lines = panels[0].lines
    assert {mesh: [value for value, _ in line] for mesh, line in lines.items()} == {
        "bunny": [1, 10, 16],
        "teapot": [1, 10, 16],
    }
    assert len(panels[1].lines["bunny"]) == 2, "the base is one of the points"


def test_a_grid_has_a_line_for_each_combination_of_the_other_fields() -> None:
    panels = _panels_of_workloads(GRID)
    assert [panel.title for panel in panels] == ["bunny", "teapot"]
    names = ["no snooping, banks 1", "no snooping, banks 2", "snooping, banks 1", "snooping, banks 2"]
    assert list(panels[0].lines) == names
    assert all([value for value, _ in line] == [4, 12] for line in panels[0].lines.values())
