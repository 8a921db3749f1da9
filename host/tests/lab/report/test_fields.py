"""The plot of a study over its fields."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from PIL import Image

from colonnade.design import toolchain
from colonnade.lab.report.fields import _panels_of_workloads, _panels_one_by_one, plot_fields

DATA = toolchain.project_root() / "docs" / "data"


@pytest.mark.parametrize("name", ["scaling", "ablation"])
def test_plot_is_a_picture(tmp_path: Path, name: str) -> None:
    plot_fields(json.loads((DATA / f"{name}.json").read_text()), tmp_path / "plot.png")
    with Image.open(tmp_path / "plot.png") as picture:
        assert picture.size[0] >= 500


def test_fields_one_by_one_have_the_base_among_their_values() -> None:
    panels = _panels_one_by_one(json.loads((DATA / "scaling.json").read_text()))
    rows = panels[0]
    assert [(panel.title, panel.base) for panel in panels[:2]] == [("rows", 10), ("columns", 8)]
    assert {mesh: [value for value, _ in line] for mesh, line in rows.lines.items()} == {
        "bunny": [1, 2, 4, 8, 10, 16],
        "teapot": [1, 2, 4, 8, 10, 16],
    }
    assert len(panels[1].lines["bunny"]) == 5, "the base is one of the points"


def test_a_grid_has_a_line_for_each_combination_of_the_other_fields() -> None:
    panels = _panels_of_workloads(json.loads((DATA / "ablation.json").read_text()))
    assert [panel.title for panel in panels] == ["bunny", "teapot"]
    names = ["no snooping, banks 1", "no snooping, banks 2", "snooping, banks 1", "snooping, banks 2"]
    assert list(panels[0].lines) == names
    assert all([value for value, _ in line] == [1, 4, 8, 12] for line in panels[0].lines.values())
